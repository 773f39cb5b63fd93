// A calibration from the images of a data set, as the calibration of one camera, one target and one arm (pair_images)
// and that of any number of them (cell_images) return it.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/drift.h"
#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "tools/run/arm_setup.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"

namespace heba {

// An ImageRun is what a run begins with, once its images have been searched.
struct ImageRun {
  Dataset dataset;
  RunOptions options;
  std::vector<TargetDetection> detections;
  std::vector<DuplicateInDataset> duplicates;  // The images must not be used.
  RunObserver* observer = nullptr;             // May be null.
  bool is_first = true;  // Whether the observer is told if there is no calibration: of several attempts, the first one.
};

struct CalibratedImages {
  // The calibration uses these detections, which differ from the given ones if the images were searched again.
  std::vector<TargetDetection> detections;
  // The points of all images, corrected for the drifts. Its captures are those of the data set.
  Problem seen;
  // The captures of its problem are those of the data set. The adjustment succeeded.
  Calibration calibration;
  std::vector<Drift> drifts;                  // The images were corrected for these.
  std::vector<std::optional<ArmSetup>> arms;  // One per arm, or empty; nothing for an arm that is not estimated.
  std::vector<Finding> findings;              // About smooth errors of arms, motions and drifts.
  // The options of the final refinement of one camera, one target and one arm, of which Calibration::pairs has the
  // calibration; its parts have no names then.
  std::optional<PairCalibrationOptions> pair_options;
};

}  // namespace heba
