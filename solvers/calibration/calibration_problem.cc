#include "solvers/calibration/calibration_problem.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <utility>

#include "solvers/calibration/capture_clusters.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/calibration/capture_rejection.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/usable_views.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/linearised_images.h"

namespace heba {
namespace {

bool IsLeftOut(const ImageSet& left_out, size_t capture) { return left_out.contains({capture, 0}); }

// Tests the captures one by one, until nothing changes.
JudgedProblem SettleEach(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options) {
  constexpr int kMaxRounds = 6;
  // The captures that the others do not contradict at an estimate without them are not tested again.
  std::set<size_t> returned;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Problem used = Without(problem, at.left_out);
    ImageSet wrong = WrongOf(FindOutlierCaptures(used, at.solution));
    for (const size_t i : returned) wrong.erase({i, 0});
    // So many are not wrong by themselves: the model is incomplete.
    const auto num_used = static_cast<double>(CapturesWithPoints(used).size());
    const bool is_model = static_cast<double>(wrong.size()) > kMostWrong * num_used;
    at.num_kept_against_test = is_model ? static_cast<int>(wrong.size()) : 0;
    ImageSet next = at.left_out;
    if (!is_model) next.insert(wrong.begin(), wrong.end());
    const std::vector<size_t> left_out = CapturesOf(at.left_out);
    const std::vector<CaptureVerdict> of_left_out = TestLeftOutCaptures(problem, at.solution, left_out);
    for (size_t k = 0; k < left_out.size(); ++k) {
      if (of_left_out[k].is_wrong) continue;
      next.erase({left_out[k], 0});
      returned.insert(left_out[k]);
    }
    if (next == at.left_out) break;
    Outcome<Solution> solution =
        RefineProblem(StartingFrom(Without(problem, next), at.solution), at.solution.poses, options);
    if (!solution) break;
    at.solution = std::move(*solution);
    at.left_out = std::move(next);
  }
  return at;
}

}  // namespace

CalibrationProblem AsProblem(const PairCalibration& calibration, const PairCalibrationOptions& options) {
  const PairSolution& solution = *calibration.refined;
  // The views, and the outcomes of those that are used. A start of the refinement may be a solution of other views.
  const bool has_outcomes = solution.views.size() == calibration.views.size();
  std::vector<std::pair<const View*, const ViewOutcome*>> views;
  for (size_t i = 0; i < calibration.views.size(); ++i) {
    views.emplace_back(&calibration.views[i], has_outcomes ? &solution.views[i] : nullptr);
  }
  for (const View& view : calibration.left_out) views.emplace_back(&view, nullptr);
  BundleOptions bundle = calibration.bundle;
  bundle.effects = solution.shared_effects;  // The effects that were estimated.
  PairProblem problem{calibration.camera, {}, options.setup, options.shape};
  PairSolution of_all = solution;
  of_all.views.clear();
  CalibrationProblem result;
  SearchedModel& model = result.model;
  for (const auto& [view, outcome] : views) {
    if (problem.views.size() >= calibration.views.size()) model.judged.left_out.insert({problem.views.size(), 0});
    problem.views.push_back(*view);
    ViewOutcome& of_view = of_all.views.emplace_back();
    if (outcome != nullptr) {
      of_view = *outcome;
    } else if (solution.robot_noise) {
      of_view.correction = Rigid3d();
    }
  }
  model.problem = HandEyeProblem(problem, bundle);
  model.problem.targets[0].symmetries = options.symmetries;
  model.options = bundle;
  model.judged.solution = ProblemSolution(of_all);
  model.judged.num_kept_against_test = calibration.num_kept_against_test;
  result.views = std::move(problem.views);
  return result;
}

CalibrationProblem InOrder(CalibrationProblem problem) {
  std::vector<size_t> order(problem.views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return problem.views[a].capture < problem.views[b].capture; });
  CalibrationProblem ordered = problem;
  JudgedProblem& judged = ordered.model.judged;
  judged.left_out.clear();
  for (size_t k = 0; k < order.size(); ++k) {
    const size_t i = order[k];
    ordered.views[k] = problem.views[i];
    ordered.model.problem.captures[k] = problem.model.problem.captures[i];
    judged.solution.captures[k] = problem.model.judged.solution.captures[i];
    if (IsLeftOut(problem.model.judged.left_out, i)) judged.left_out.insert({k, 0});
  }
  return ordered;
}

ModelSpace SpaceOf(const PairCalibrationOptions& options, const CalibrationProblem& problem) {
  ModelSpace space;
  space.robot_noise = options.choose.robot_noise;
  space.shapes = {options.choose.target_shape};
  space.twists = space.shapes;
  space.lenses = {options.choose.lenses};
  if (options.choose.effects.empty()) return space;
  ArmErrorModels& arm = space.arms.emplace_back();
  arm.models = options.choose.effects;
  std::vector<std::shared_ptr<const PoseEffect>>& effects = arm.effects_of_captures.emplace_back();
  for (const View& view : problem.views) effects.push_back(view.effect);
  return space;
}

PairCalibration WithModelOf(PairCalibration calibration, const CalibrationProblem& problem,
                            const std::shared_ptr<const SharedEffects>& effects) {
  const SearchedModel& model = problem.model;
  const ProblemCamera& camera = model.problem.cameras[0];
  const ProblemTarget& target = model.problem.targets[0];
  calibration.camera = camera.camera;
  BundleOptions& bundle = calibration.bundle;
  bundle.robot = model.options.robot;
  bundle.robot_noise_prior = model.options.robot_noise_prior;
  bundle.robot_noise_start = model.options.robot_noise_start;
  bundle.free_shape = target.free_shape;
  bundle.target_scale_sigma = target.scale_sigma;
  bundle.effects = model.problem.effects.empty() ? nullptr : model.problem.effects[0];
  calibration.alternatives.clear();
  for (const ProblemAlternative& one : model.alternatives) {
    calibration.alternatives.push_back(AlternativeOf(one, 0, effects));
  }
  if (!model.lenses.empty() && !model.lenses[0].empty()) calibration.camera_alternatives = model.lenses[0];
  calibration.num_kept_against_test = model.judged.num_kept_against_test;

  PairSolution solution = HandEyeSolution(model.judged.solution, bundle);
  const std::vector<ViewOutcome> outcomes = std::move(solution.views);
  solution.views.clear();
  const std::vector<PosePair> pairs_before = std::move(calibration.pairs);
  calibration.pairs.clear();
  calibration.views.clear();
  calibration.left_out.clear();
  // Views with too few points for a pose come last.
  for (const bool has_pose : {true, false}) {
    for (size_t i = 0; i < problem.views.size(); ++i) {
      const View& view = problem.views[i];
      if ((view.observations.size() >= kMinPosePoints) != has_pose) continue;
      if (IsLeftOut(model.judged.left_out, i)) {
        calibration.left_out.push_back(view);
        continue;
      }
      calibration.views.push_back(view);
      solution.views.push_back(outcomes[i]);
      if (i < pairs_before.size()) calibration.pairs.push_back(pairs_before[i]);
    }
  }
  std::vector<View> posed = calibration.views;
  std::erase_if(posed, [](const View& view) { return view.observations.size() < kMinPosePoints; });
  std::vector<PosePair> pairs = PosePairsOf(calibration.camera, solution.hand_eye, posed);
  if (pairs.size() == posed.size()) calibration.pairs = std::move(pairs);
  calibration.refined = std::move(solution);
  return calibration;
}

std::vector<size_t> CapturesOf(const ImageSet& images) {
  std::vector<size_t> captures;
  for (const auto& [capture, image] : images) captures.push_back(capture);
  return captures;
}

JudgedProblem SettleCaptures(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options) {
  if (options.loss == LossKind::kNone) return at;
  return JudgeWithClusters(SettleEach, problem, std::move(at), options);
}

}  // namespace heba
