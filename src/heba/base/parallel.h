// Work spread over threads with a result that does not depend on their number.
#pragma once

#include <functional>

namespace heba {

// Calls `work(i)` for every i in [0, count) on up to `num_threads` threads (the caller's is one). Each call must write
// to its own place only. The exception of the smallest index that threw is thrown again after all threads have ended.
void ParallelFor(int count, int num_threads, const std::function<void(int)>& work);

// Processors that this process may use, at least 1.
int NumProcessors();

}  // namespace heba
