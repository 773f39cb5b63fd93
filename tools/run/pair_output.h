// The run of one camera, one target and one arm, as the run of any number of them.
#pragma once

#include <vector>

#include "heba/run_types.h"
#include "tools/run/captures.h"

namespace heba {

// A PairOutput is what such a run ends with.
struct PairOutput {
  RunResult result;  // The result has the short form.
  Dataset dataset;   // RunOutput::dataset.
  std::vector<TargetDetection> detections;
  EffectsOfCaptures effects;  // The effects at the captures of `dataset`.
  PairCalibration calibration;
};

// Returns it in the general form. Its parts have the names that they have in the data set.
RunOutput AsRunOutput(PairOutput run);

}  // namespace heba
