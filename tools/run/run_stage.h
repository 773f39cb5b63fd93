// Tells an observer of a run about the stages, and ends a run that was cancelled.
#pragma once

#include "heba/run_types.h"

namespace heba {

// Ends a run that was cancelled. Run catches it.
struct Cancelled {};

// Throws Cancelled if the run is to end.
void EndIfCancelled(RunObserver* observer);

// Reports the steps of one stage to an observer, which may be null.
class StageReport {
 public:
  // Throws Cancelled if the run is to end.
  StageReport(RunStage stage, int num_steps, RunObserver* observer);
  ~StageReport();
  StageReport(const StageReport&) = delete;
  StageReport& operator=(const StageReport&) = delete;
  // Throws Cancelled if the run is to end. Not thread-safe.
  void Step();

 private:
  RunStage stage_;
  RunObserver* observer_;
};

}  // namespace heba
