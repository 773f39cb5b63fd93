#include "tools/run/pair_output.h"

#include <memory>
#include <utility>

#include "heba/data/hand_eye.h"
#include "solvers/calibration/problem_model.h"

namespace heba {
namespace {

// Sets the problem that was solved, and its solution, of a calibration with a refined estimate.
void SetRefined(const Dataset& dataset, const EffectsOfCaptures& effects, const PairCalibration& pair,
                Calibration* calibration) {
  const PairSolution& solution = *pair.refined;
  Problem& problem = calibration->problem;
  problem = HandEyeProblem(SetupOf(dataset), solution);
  Solution refined = ProblemSolution(solution);
  const std::vector<CaptureOutcome> of_views = std::exchange(refined.captures, {});
  refined.captures.resize(dataset.captures.size());
  for (const Recording& capture : dataset.captures) {
    problem.captures.push_back({capture.name, capture.base_from_gripper, {}});
  }
  std::vector<std::shared_ptr<const PoseEffect>> of_captures = effects.effects;
  of_captures.resize(dataset.captures.size());
  SetEffects(0, solution.shared_effects, of_captures, &problem);
  for (size_t v = 0; v < pair.views.size(); ++v) {
    const View& view = pair.views[v];
    problem.captures[view.capture].images.push_back({0, 0, view.observations});
    refined.captures[view.capture] = of_views[v];
  }
  calibration->start = HandEyePosesOf(solution.hand_eye);
  calibration->refined = std::move(refined);
}

// Gives the parts of a problem the names of those of `named`, and their state in the calibration.
void NameParts(const Problem& named, const PairCalibration& calibration, Problem* problem) {
  problem->robots = named.robots;
  ProblemCamera& camera = problem->cameras.front();
  camera.name = named.cameras.front().name;
  camera.mount_name = named.cameras.front().mount_name;
  camera.free_intrinsics = calibration.bundle.free_intrinsics;
  camera.prior = calibration.bundle.camera_prior;
  ProblemTarget& target = problem->targets.front();
  target.name = named.targets.front().name;
  target.mount_name = named.targets.front().mount_name;
  target.free_shape = calibration.bundle.free_shape;
  target.symmetries = named.targets.front().symmetries;
}

// Gives the parts of a run with a refined estimate the names that they have in the data set.
void NameParts(const PairCalibration& pair, RunOutput* run) {
  Calibration& calibration = run->calibration;
  Problem named = run->dataset.rig;
  named.targets.front().symmetries = run->dataset.targets.front()->Symmetries();
  NameParts(named, pair, &calibration.problem);
  calibration.refined->covariance.layout = UnknownsOf(calibration.problem);
  calibration.refined->covariance_repeatable.layout = calibration.refined->covariance.layout;
  CHECK_EQ(calibration.refined->covariance.layout.size(), calibration.refined->covariance.matrix.rows());
  RunResult& result = run->result;
  NameParts(named, pair, &result.rig);
  // The basis of smooth errors is not written.
  const bool is_smooth =
      pair.refined->shared_effects != nullptr && pair.refined->shared_effects->kind == SharedEffectsKind::kSmooth;
  if (is_smooth) result.rig.effects.clear();
  result.solution = WithEffectsOf(result.rig, *calibration.refined);
  result.solution.captures.clear();
}

}  // namespace

RunOutput AsRunOutput(PairOutput run) {
  RunOutput whole;
  whole.result = std::move(run.result);
  whole.dataset = std::move(run.dataset);
  whole.detections = std::move(run.detections);
  const PairCalibration& calibration = run.calibration;
  if (calibration.refined) {
    SetRefined(whole.dataset, run.effects, calibration, &whole.calibration);
    if (!IsShort(whole.dataset.rig)) NameParts(calibration, &whole);
  } else {
    whole.calibration.refined = calibration.refined.failure();
  }
  CalibratedPair& pair = whole.calibration.pairs.emplace_back();
  pair.robot = 0;
  pair.num_images = static_cast<int>(calibration.views.size() + calibration.unused.size());
  pair.calibration = std::move(run.calibration);
  return whole;
}

}  // namespace heba
