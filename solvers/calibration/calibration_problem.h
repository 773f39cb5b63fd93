// A calibration as a problem with one camera, one target and one arm.
#pragma once

#include "heba/pair_calibration_types.h"
#include "solvers/calibration/model_search.h"

namespace heba {

struct CalibrationProblem {
  // The views of which each is a capture of the problem: those that are used, and then those that the calibration left
  // out because they contradict the others.
  std::vector<View> views;
  SearchedModel model;
};

// Returns the problem of a calibration whose refinement succeeded; `options` are those of the calibration. Camera,
// target and arm have no name.
CalibrationProblem AsProblem(const PairCalibration& calibration, const PairCalibrationOptions& options);

// Returns the problem with its captures in the order of View::capture.
CalibrationProblem InOrder(CalibrationProblem problem);

// Returns what is chosen of a calibration.
ModelSpace SpaceOf(const PairCalibrationOptions& options, const CalibrationProblem& problem);

// Returns a calibration with the parts that follow from a model of its problem: the lens, the error model, the captures
// that are left out, and the refined solution. `effects` are those that the model has without a choice.
PairCalibration WithModelOf(PairCalibration calibration, const CalibrationProblem& problem,
                            const std::shared_ptr<const SharedEffects>& effects);

// Returns the captures of images that are left out.
std::vector<size_t> CapturesOf(const ImageSet& images);

// Tests all captures under the model (Judge; FindOutlierCaptures and TestLeftOutCaptures), takes back those that it
// explains and leaves out those that contradict it.
JudgedProblem SettleCaptures(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options);

}  // namespace heba
