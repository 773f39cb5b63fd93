// Tells a function in Python how far a run is.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <utility>

#include <pybind11/pybind11.h>

#include "heba/run_types.h"

namespace heba {

// Ends a run of another thread at its next step.
class Cancellation {
 public:
  void Request() { *is_requested_ = true; }
  bool is_requested() const { return *is_requested_; }

 private:
  std::shared_ptr<std::atomic<bool>> is_requested_ = std::make_shared<std::atomic<bool>>(false);
};

// Calls a function in Python with the stage, the steps that are done, and their number. An exception of that function,
// or a cancellation, ends the run; nothing in Python is called after
// a cancellation.
class PythonObserver final : public RunObserver {
 public:
  // `progress` may be None.
  PythonObserver(pybind11::object progress, Cancellation cancellation)
      : progress_(std::move(progress)), cancellation_(std::move(cancellation)) {}

  void OnStage(RunStage stage, int num_steps) override {
    num_done_ = 0;
    num_steps_ = num_steps;
    Tell(stage);
  }
  void OnStep(RunStage stage) override {
    ++num_done_;
    Tell(stage);
  }
  bool IsCancelled() override { return cancellation_.is_requested() || raised_.has_value(); }
  // Raises the exception that ended the run, if there was one. The caller holds the GIL.
  void RethrowIfRaised() const {
    if (raised_) throw pybind11::error_already_set(*raised_);
  }

 private:
  void Tell(RunStage stage) {
    if (cancellation_.is_requested()) return;
    const pybind11::gil_scoped_acquire acquire;
    if (progress_.is_none() || raised_) return;
    try {
      progress_(kRunStageNames[static_cast<size_t>(stage)], num_done_, num_steps_);
    } catch (const pybind11::error_already_set& error) {
      raised_ = error;
    }
  }

  pybind11::object progress_;
  Cancellation cancellation_;
  int num_done_ = 0;
  int num_steps_ = 0;
  std::optional<pybind11::error_already_set> raised_;
};

}  // namespace heba
