#include "tools/run/run_stage.h"

namespace heba {

void EndIfCancelled(RunObserver* observer) {
  if (observer != nullptr && observer->IsCancelled()) throw Cancelled();
}

StageReport::StageReport(RunStage stage, int num_steps, RunObserver* observer) : stage_(stage), observer_(observer) {
  EndIfCancelled(observer);
  if (observer != nullptr) observer->OnStage(stage, num_steps);
}

StageReport::~StageReport() {
  if (observer_ != nullptr) observer_->OnStageEnd(stage_);
}

void StageReport::Step() {
  if (observer_ != nullptr) observer_->OnStep(stage_);
  EndIfCancelled(observer_);
}

}  // namespace heba
