#include "tools/batch/batch.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <map>
#include <mutex>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "tools/files/result_folder.h"
#include "tools/pages/summary.h"
#include "tools/pipeline/pipeline.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

constexpr const char* kLockName = ".heba.lock";

struct Item {
  std::string config_path;
  bool is_wrong = false;  // Whether the config cannot be read: run.reason says why.
  std::filesystem::path output;
  BatchRun run;
  bool was_there = false;
};

Item MakeItem(const std::string& path, const BatchOptions& options) {
  Item item;
  item.config_path = path;
  item.run.name = std::filesystem::path(path).stem().string();
  try {
    const RunConfig config = ReadRunConfig(path, options.settings);
    item.run.name = config.data.name;
    item.output = options.output.empty() ? config.output : options.output / item.run.name;
  } catch (const std::exception& error) {
    item.is_wrong = true;
    item.run.reason = error.what();
  }
  return item;
}

void CheckNames(const std::vector<Item>& items) {
  std::map<std::filesystem::path, const Item*> seen;
  for (const Item& item : items) {
    if (item.is_wrong) continue;
    const auto [other, is_new] = seen.emplace(item.output.lexically_normal(), &item);
    if (!is_new) {
      throw InputError(item.config_path + ": its results would overwrite those of " + other->second->config_path +
                       " (" + item.output.string() + "); give one of them another name");
    }
  }
}

Item WithRun(Item item, const BatchOptions& options, int num_threads) {
  if (item.is_wrong) return item;
  try {
    // The config is read again, because the batch may have run for hours.
    const RunConfig config = ReadRunConfig(item.config_path, options.settings);
    if (options.resume) item.run.result = CurrentResult(item.output, config);
    item.was_there = item.run.result.has_value();
    if (item.was_there) return item;
    Console console(Verbosity::kQuiet);
    const Outcome<RunResult> result = RunPipeline(config, item.output, num_threads, &console);
    if (result) {
      item.run.result = *result;
    } else {
      item.run.reason = item.config_path + ": " + FailureText(result.failure());
    }
  } catch (const std::exception& error) {
    item.run.reason = error.what();
  }
  return item;
}

std::string TimeLeft(double seconds) {
  return seconds < 90 ? Fixed(seconds, 0) + " s" : Fixed(seconds / 60, 0) + " min";
}

// Prints one line per run when it ends, with the estimated time left.
class BatchProgress {
 public:
  BatchProgress(size_t total, Verbosity verbosity, const RunDemands& demands)
      : total_(total), verbosity_(verbosity), demands_(demands) {}

  void Done(const Item& item, double seconds) {
    ++num_done_;
    if (!item.was_there) ++num_worked_;
    const Verdict* const verdict = item.run.verdict();
    if (verdict == nullptr) PrintError(item.run.reason);
    if (item.run.result) {
      const std::string not_met = WhyNotMet(*item.run.result, demands_);
      if (!not_met.empty()) PrintError(item.config_path + ": " + not_met);
    }
    if (verbosity_ == Verbosity::kQuiet) return;
    const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    std::string line = "[" + PadLeft(std::to_string(num_done_), std::to_string(total_).size()) + "/" +
                       std::to_string(total_) + "] " + item.run.name + ": " +
                       (verdict == nullptr ? "failed" : (item.was_there ? "unchanged" : Fixed(seconds, 1) + " s"));
    if (num_done_ < total_ && num_worked_ > 0) {
      line += "; about " +
              TimeLeft(elapsed / static_cast<double>(num_worked_) * static_cast<double>(total_ - num_done_)) + " left";
    }
    std::cerr << line << std::endl;
  }

 private:
  size_t total_;
  Verbosity verbosity_;
  RunDemands demands_;
  size_t num_done_ = 0;
  size_t num_worked_ = 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

int RunBatch(const std::vector<std::string>& configs, const BatchOptions& options) {
  std::vector<Item> items;
  for (const std::string& path : configs) items.push_back(MakeItem(path, options));
  CheckNames(items);
  const bool is_whole = options.shard.count == 1;
  std::optional<FolderLock> whole_lock;
  std::optional<FolderLock> shard_lock;
  if (!options.output.empty()) {
    whole_lock.emplace(options.output, kLockName, is_whole ? FolderLock::Kind::kAlone : FolderLock::Kind::kShared);
    if (is_whole) {
      RemoveStaleStaging(options.output);
    } else {
      shard_lock.emplace(options.output, kLockName + ("." + std::to_string(options.shard.index)),
                         FolderLock::Kind::kAlone);
    }
  }
  std::vector<Item*> mine;
  for (size_t i = static_cast<size_t>(options.shard.index); i < items.size();
       i += static_cast<size_t>(options.shard.count)) {
    mine.push_back(&items[i]);
  }

  const int num_mine = static_cast<int>(mine.size());
  const int num_workers = std::max(1, std::min(options.num_threads, num_mine));
  BatchProgress progress(mine.size(), options.verbosity, options.demands);
  std::mutex mutex;
  int num_started = 0;
  ParallelFor(num_mine, num_workers, [&](int index) {
    int num_threads = 1;
    {
      const std::lock_guard<std::mutex> lock(mutex);
      // The last runs share the threads that earlier ones no longer need.
      const int num_beside = std::min(num_workers, num_mine - num_started++);
      num_threads = std::max(1, options.num_threads / num_beside);
    }
    Item* item = mine[static_cast<size_t>(index)];
    const auto start = std::chrono::steady_clock::now();
    *item = WithRun(std::move(*item), options, num_threads);
    const std::lock_guard<std::mutex> lock(mutex);
    progress.Done(*item, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  });

  std::vector<BatchRun> runs;
  for (const Item* item : mine) runs.push_back(item->run);
  if (!options.output.empty() && is_whole) {
    const std::string title = options.output.filename().string();
    WriteFileAtomically(options.output / "summary.csv", SummaryCsv(runs));
    WriteFileAtomically(options.output / "summary.html", SummaryPage(title.empty() ? "batch" : title, runs));
  }
  if (options.verbosity == Verbosity::kNormal) {
    std::cout << ForTerminal(SummaryTable(runs));
    if (!options.output.empty()) std::cout << "results: " << options.output.string() << std::endl;
  }
  const bool all_good = std::all_of(runs.begin(), runs.end(), [&](const BatchRun& run) {
    return run.result && WhyNotMet(*run.result, options.demands).empty();
  });
  return all_good ? kDone : kWorkFailed;
}

}  // namespace heba
