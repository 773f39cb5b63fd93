// The run of one camera, one target and one arm, as the run of any number of them.
#pragma once

#include <vector>

#include "heba/pair_run_types.h"
#include "heba/run_types.h"

namespace heba {

// A PairOutput is what such a run ends with.
struct PairOutput {
  RunResult result;  // The result has the short form.
  // The data set without the captures that were left out, with the size of its camera filled in, and the detection in
  // each capture; no detections if the target's poses were given.
  PairDataset dataset;
  std::vector<CaptureDetection> detections;
  PairCalibration calibration;
};

// Returns it in the general form, whose parts have no names (heba/data/hand_eye.h). Its captures are those of
// PairOutput::dataset.
RunOutput AsRunOutput(PairOutput run);

}  // namespace heba
