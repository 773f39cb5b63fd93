// Shows on the console what a run does.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/run_types.h"
#include "tools/text/console.h"

namespace heba {

// Shows the progress of the stages.
class ProgressObserver : public RunObserver {
 public:
  explicit ProgressObserver(Verbosity verbosity) : verbosity_(verbosity) {}
  void OnStage(RunStage stage, int num_steps) override;
  void OnStep(RunStage stage) override;
  void OnStageEnd(RunStage stage) override;

 private:
  Verbosity verbosity_;
  std::optional<Progress> progress_;
};

// Shows the progress as an observer of type `Shown` does, and tells a listener, which may be null, about the stages;
// the listener can cancel the run. `arguments` are those of `Shown`.
template <class Shown>
class SharedObserver final : public Shown {
 public:
  template <class... Arguments>
  explicit SharedObserver(RunObserver* listener, Arguments&&... arguments)
      : Shown(std::forward<Arguments>(arguments)...), listener_(listener) {}
  void OnStage(RunStage stage, int num_steps) override {
    Shown::OnStage(stage, num_steps);
    if (listener_ != nullptr) listener_->OnStage(stage, num_steps);
  }
  void OnStep(RunStage stage) override {
    Shown::OnStep(stage);
    if (listener_ != nullptr) listener_->OnStep(stage);
  }
  void OnStageEnd(RunStage stage) override {
    Shown::OnStageEnd(stage);
    if (listener_ != nullptr) listener_->OnStageEnd(stage);
  }
  bool IsCancelled() override { return listener_ != nullptr && listener_->IsCancelled(); }

 private:
  RunObserver* listener_;
};

// Adds notes on the run of one camera, one target and one arm to the console. `dataset` and `console` must outlive it.
class ConsoleObserver : public ProgressObserver {
 public:
  ConsoleObserver(const Dataset& dataset, Console* console)
      : ProgressObserver(console->verbosity()), dataset_(dataset), console_(console) {}
  void OnDetected(const std::vector<std::string>& notes, int num_seen, int num_images) override;
  void OnCalibrated(const PairCalibration& calibration) override;
  void OnHoldOuts(const std::vector<HoldOut>& hold_outs) override;

 private:
  void Note(const std::string& text) { console_->Note(dataset_.name + ": " + text); }

  const Dataset& dataset_;
  Console* console_;
};

}  // namespace heba
