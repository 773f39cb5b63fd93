// Tells a function in Python how far a run is.
#pragma once

#include <optional>
#include <utility>

#include <pybind11/pybind11.h>

#include "heba/pair_run.h"

namespace heba {

// Calls a function in Python with the stage, the steps that are done, and their number. An exception of that function,
// or an interrupt from the keyboard, ends the run.
class PythonObserver final : public RunObserver {
 public:
  // `progress` may be None.
  explicit PythonObserver(pybind11::object progress) : progress_(std::move(progress)) {}

  void OnStage(RunStage stage, int num_steps) override {
    num_done_ = 0;
    num_steps_ = num_steps;
    Tell(stage);
  }
  void OnStep(RunStage stage) override {
    ++num_done_;
    Tell(stage);
  }
  bool IsCancelled() override {
    const pybind11::gil_scoped_acquire acquire;
    if (!raised_ && PyErr_CheckSignals() != 0) raised_ = pybind11::error_already_set();
    return raised_.has_value();
  }
  // Raises the exception that ended the run, if there was one. The caller holds the GIL.
  void RethrowIfRaised() const {
    if (raised_) throw pybind11::error_already_set(*raised_);
  }

 private:
  void Tell(RunStage stage) {
    const pybind11::gil_scoped_acquire acquire;
    if (progress_.is_none() || raised_) return;
    try {
      progress_(kRunStageNames[static_cast<size_t>(stage)], num_done_, num_steps_);
    } catch (const pybind11::error_already_set& error) {
      raised_ = error;
    }
  }

  pybind11::object progress_;
  int num_done_ = 0;
  int num_steps_ = 0;
  std::optional<pybind11::error_already_set> raised_;
};

}  // namespace heba
