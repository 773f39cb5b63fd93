#include "solvers/calibration/capture_rejection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/calibration/problem_model.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/initial/target_pose.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/residuals/inliers.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The noise of a robot with rounding errors only.
constexpr RobotNoise kExact = {1e-7, 1e-7};

RobotNoise AtLeast(const RobotNoise& noise, const RobotNoise& least) {
  return {std::max(noise.translation_m, least.translation_m), std::max(noise.rotation_rad, least.rotation_rad)};
}

// Two robot noises: that of the members, and that of the captures that are wrong.
struct Mixture {
  double log_likelihood = -std::numeric_limits<double>::infinity();  // Restricted, over all captures.
  double ratio = 1;  // The larger of the ratios between the two noises' translations and rotations.
};

// Returns the correction of the robot's pose that the image of a capture shows; nothing if it shows none.
std::optional<Rigid3d> ShownCorrection(const Problem& problem, const Solution& at, const ProblemCapture& capture) {
  const std::vector<Rigid3d> base_from_gripper = WithErrors(capture, at.effects);
  const std::vector<TargetPose> poses =
      EstimateTargetPose(at.cameras[0], ApplyShape(capture.images[0].observations, at.shapes[0]));
  const TargetPose* const seen = NearestPose(poses, CameraFromTarget(problem, at.poses, 0, 0, base_from_gripper));
  if (seen == nullptr) return std::nullopt;
  return Inverse(base_from_gripper[0]) *
         PoseOfArm(problem, at.poses, 0, 0, 0, base_from_gripper, seen->camera_from_target);
}

// Evaluates the mixture at the solution of the members. The noise of the wrong captures is the RMS of their
// corrections, computed from the poses that their images show.
Mixture MixtureOf(const Problem& problem, const Solution& at, const ImageSet& wrong) {
  const RobotNoise robot = AtLeast(*at.robot_noise[0], kExact);
  FitState state = StateOf(at);
  double sum_m2 = 0;
  double sum_rad2 = 0;
  for (const auto& [i, image] : wrong) {
    const std::optional<Rigid3d> correction = ShownCorrection(problem, at, problem.captures[i]);
    if (!correction) return {};
    state.corrections[i] = {*correction};
    const Tangent6 tangent = LocalCoordinates(Rigid3d(), *correction);
    sum_m2 += tangent.head<3>().squaredNorm();
    sum_rad2 += tangent.tail<3>().squaredNorm();
  }
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(WeightedAs(at, problem), state, NoiseOf(at), LossOf(LossKind::kNone));
  if (!views) return {};
  Mixture mixture;
  double choice = 0;
  if (!wrong.empty()) {
    const auto num_wrong = static_cast<double>(wrong.size());
    const RobotNoise of_wrong =
        AtLeast({std::sqrt(sum_m2 / (3 * num_wrong)), std::sqrt(sum_rad2 / (3 * num_wrong))}, robot);
    const double translations = of_wrong.translation_m / robot.translation_m;
    const double rotations = of_wrong.rotation_rad / robot.rotation_rad;
    mixture.ratio = std::max(translations, rotations);
    const std::vector<size_t> captures = CapturesWithPoints(problem);
    for (size_t v = 0; v < captures.size(); ++v) {
      if (!wrong.contains({captures[v], 0})) continue;
      (*views)[v].by_effects.leftCols<3>() *= translations;
      (*views)[v].by_effects.rightCols<3>() *= rotations;
    }
    // Penalty for choosing the wrong captures after the fact: the logarithm of the number of choices.
    const auto num_all = static_cast<double>(captures.size());
    const double share = num_wrong / num_all;
    choice = -num_all * (share * std::log(share) + (1 - share) * std::log(1 - share));
  }
  mixture.log_likelihood =
      RestrictedLogLikelihood(*views, at.pixel_sigmas_px[0], CorrectionGroups(1, robot, true, true),
                              views->front().by_unknowns.cols()) -
      choice;
  return mixture;
}

// Returns whether one noise for all captures explains them better than wrong poses with a more accurate robot.
bool IsNoiseOfAll(const Problem& problem, const JudgedProblem& judged, const AdjustmentOptions& options_in) {
  AdjustmentOptions options = options_in;
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  const Problem start = StartingFrom(problem, judged.solution);
  const Outcome<Solution> of_all = RefineProblem(start, judged.solution.poses, options);
  if (!of_all) return false;
  // Both fits use the same points with the same weights.
  const Problem kept = WithoutRejected(start, *of_all);
  options.loss = LossKind::kNone;
  const Outcome<Solution> of_members = RefineProblem(Without(kept, judged.left_out), judged.solution.poses, options);
  if (!of_members) return true;
  Solution in_common_weights = *of_members;
  in_common_weights.unmodelled_sigma_px = of_all->unmodelled_sigma_px;
  const Mixture one_noise = MixtureOf(kept, *of_all, {});
  const Mixture two_noises = MixtureOf(kept, in_common_weights, judged.left_out);
  return one_noise.log_likelihood >= two_noises.log_likelihood || two_noises.ratio < kDistinct;
}

}  // namespace

JudgedProblem JudgeCaptures(const Problem& problem_in, const Solution& solution, const AdjustmentOptions& options) {
  const Problem problem = WithoutNoisyJoints(problem_in);
  JudgedProblem judged{solution, {}};
  // Each capture has the outcome of the last solution that used it.
  std::vector<CaptureOutcome> outcomes = solution.captures;
  ImageSet without;  // The captures that the solution did not use.
  constexpr int kMaxRounds = 8;
  for (int round = 0; round < kMaxRounds; ++round) {
    Solution at = judged.solution;
    at.captures = outcomes;
    judged.left_out = WrongOf(FindOutlierCaptures(problem, at));
    if (judged.left_out == without) break;
    without = judged.left_out;
    const Outcome<Solution> refined =
        RefineProblem(StartingFrom(Without(problem, without), judged.solution), judged.solution.poses, options);
    if (!refined) break;
    judged.solution = *refined;
    for (size_t i = 0; i < outcomes.size(); ++i) {
      if (!without.contains({i, 0})) outcomes[i] = refined->captures[i];
    }
  }
  const size_t num_wrong = judged.left_out.size();
  const size_t num_all = CapturesWithPoints(problem).size();
  const bool is_doubtful = static_cast<double>(num_wrong) > kMostWrong * static_cast<double>(num_all);
  if (is_doubtful && IsNoiseOfAll(problem, judged, options)) {
    // Starts from the solution of the better captures; with all of them the first solution may be far off.
    const Outcome<Solution> refined =
        RefineProblem(StartingFrom(problem, judged.solution), judged.solution.poses, options);
    return {refined ? *refined : solution, {}, static_cast<int>(num_wrong)};
  }
  if (2 * num_wrong > num_all) return {solution, {}, static_cast<int>(num_wrong)};
  return judged;
}

}  // namespace heba
