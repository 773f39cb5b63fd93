#include "heba/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace heba {

void ParallelFor(int count, int num_threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  std::mutex mutex;
  int failed_index = count;
  std::exception_ptr failure;
  const auto run = [&] {
    while (true) {
      const int index = next++;
      if (index >= count) return;
      try {
        work(index);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (index < failed_index) {
          failed_index = index;
          failure = std::current_exception();
        }
      }
    }
  };
  std::vector<std::thread> threads;
  for (int i = 1; i < std::min(num_threads, count); ++i) threads.emplace_back(run);
  run();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

int NumProcessors() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

}  // namespace heba
