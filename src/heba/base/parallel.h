// Parallel loops with a result that does not depend on the number of threads.
#pragma once

#include <functional>

namespace heba {

// Calls `work(i)` for every i in [0, count) on up to `num_threads` threads, the calling thread included. Calls run
// concurrently, so each must write only to memory of its own. If calls throw, the exception of the smallest such index
// is rethrown after all threads have ended.
void ParallelFor(int count, int num_threads, const std::function<void(int)>& work);

// Returns the number of processors that this process may use, at least 1.
int NumProcessors();

}  // namespace heba
