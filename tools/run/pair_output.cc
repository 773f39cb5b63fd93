#include "tools/run/pair_output.h"

#include <memory>
#include <utility>

#include "heba/data/hand_eye.h"
#include "solvers/calibration/problem_model.h"
#include "tools/run/captures.h"

namespace heba {
namespace {

// Sets the problem that was solved, and its solution, of a calibration with a refined estimate.
void SetRefined(const PairDataset& dataset, const PairCalibration& pair, Calibration* calibration) {
  const PairSolution& solution = *pair.refined;
  Problem& problem = calibration->problem;
  problem = HandEyeProblem(dataset.setup, solution);
  Solution refined = ProblemSolution(solution);
  const std::vector<CaptureOutcome> of_views = std::exchange(refined.captures, {});
  refined.captures.resize(dataset.captures.size());
  std::vector<std::shared_ptr<const PoseEffect>> effects;  // Functions of all effects, estimated or not.
  for (const Capture& capture : dataset.captures) {
    problem.captures.push_back({capture.name, {capture.base_from_gripper}, {}});
    effects.push_back(capture.effect);
  }
  SetEffects(0, solution.shared_effects, effects, &problem);
  for (size_t v = 0; v < pair.views.size(); ++v) {
    const View& view = pair.views[v];
    problem.captures[view.capture].images.push_back({0, 0, view.observations});
    refined.captures[view.capture] = of_views[v];
  }
  calibration->start = HandEyePosesOf(solution.hand_eye);
  calibration->refined = std::move(refined);
}

}  // namespace

RunOutput AsRunOutput(PairOutput run) {
  RunOutput whole;
  whole.result = std::move(run.result);
  whole.dataset = AsDataset(run.dataset);
  whole.detections = AsTargetDetections(run.detections);
  if (run.calibration.refined) {
    SetRefined(run.dataset, run.calibration, &whole.calibration);
  } else {
    whole.calibration.refined = run.calibration.refined.failure();
  }
  CalibratedPair& pair = whole.calibration.pairs.emplace_back();
  pair.robot = 0;
  pair.num_images = static_cast<int>(run.calibration.views.size() + run.calibration.unused.size());
  pair.calibration = std::move(run.calibration);
  return whole;
}

}  // namespace heba
