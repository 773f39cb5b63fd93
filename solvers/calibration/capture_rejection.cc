#include "solvers/calibration/capture_rejection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "heba/base/error.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/refine/bundle_model.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/repeated_poses.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

std::vector<size_t> MembersOf(const std::vector<CaptureVerdict>& verdicts) {
  std::vector<size_t> members;
  for (size_t i = 0; i < verdicts.size(); ++i) {
    if (!verdicts[i].is_wrong) members.push_back(i);
  }
  return members;
}

Problem PartOf(const Problem& problem, const std::vector<size_t>& views) {
  Problem part{problem.camera, {}, problem.setup, problem.shape};
  for (const size_t i : views) part.views.push_back(problem.views[i]);
  return part;
}

// The noise of a robot with rounding errors only.
constexpr RobotNoise kExact = {1e-7, 1e-7};

RobotNoise AtLeast(const RobotNoise& noise, const RobotNoise& least) {
  return {std::max(noise.translation_m, least.translation_m), std::max(noise.rotation_rad, least.rotation_rad)};
}

// Two robot noises: that of the members, and that of the captures that are wrong.
struct Mixture {
  double log_likelihood = -std::numeric_limits<double>::infinity();  // Restricted, over all views.
  double ratio = 1;  // The larger of the ratios between the two noises' translations and rotations.
};

// Evaluates the mixture at `of_members`, the solution of the members. The noise of the wrong captures is the RMS of
// their corrections, computed from the poses that their images show.
Mixture MixtureOf(const Problem& problem, const Solution& of_members, const std::vector<CaptureVerdict>& verdicts,
                  const BundleOptions& options) {
  const Solution& at = of_members;
  const RobotNoise robot = AtLeast(*at.robot_noise, kExact);
  std::vector<Rigid3d> corrections;
  size_t member = 0;
  double sum_m2 = 0;
  double sum_rad2 = 0;
  double num_wrong = 0;
  for (size_t i = 0; i < verdicts.size(); ++i) {
    if (!verdicts[i].is_wrong) {
      corrections.push_back(*at.views[member++].correction);
      continue;
    }
    View view = problem.views[i];
    view.observations = ApplyShape(view.observations, at.shape);
    const std::vector<PosePair> seen = PosePairsOf(at.camera, at.hand_eye, {view});
    if (seen.empty()) return {};
    corrections.push_back(CorrectionFor(problem.setup, at.hand_eye, view.camera_mount_from_target_mount,
                                        seen.front().camera_from_target));
    const Tangent6 correction = LocalCoordinates(Rigid3d(), corrections.back());
    sum_m2 += correction.head<3>().squaredNorm();
    sum_rad2 += correction.tail<3>().squaredNorm();
    ++num_wrong;
  }
  const FreeUnknowns free = FreeOf(at.camera.Model(), options);
  std::optional<std::vector<LinearisedView>> views =
      LineariseViewsAt(problem, at, corrections, free, LossOf(LossKind::kNone));
  if (!views) return {};
  Mixture mixture;
  double choice = 0;
  if (num_wrong > 0) {
    const RobotNoise wrong =
        AtLeast({std::sqrt(sum_m2 / (3 * num_wrong)), std::sqrt(sum_rad2 / (3 * num_wrong))}, robot);
    const double translations = wrong.translation_m / robot.translation_m;
    const double rotations = wrong.rotation_rad / robot.rotation_rad;
    mixture.ratio = std::max(translations, rotations);
    for (size_t i = 0; i < verdicts.size(); ++i) {
      if (!verdicts[i].is_wrong) continue;
      (*views)[i].by_effects.leftCols<3>() *= translations;
      (*views)[i].by_effects.rightCols<3>() *= rotations;
    }
    // Penalty for choosing the wrong captures after the fact: the logarithm of the number of choices.
    const double share = num_wrong / static_cast<double>(verdicts.size());
    choice = -static_cast<double>(verdicts.size()) * (share * std::log(share) + (1 - share) * std::log(1 - share));
  }
  mixture.log_likelihood = RestrictedLogLikelihood(*views, at.pixel_sigma_px, CorrectionGroups(1, robot, true, true),
                                                   views->front().by_unknowns.cols()) -
                           choice;
  return mixture;
}

// Returns whether one noise for all captures explains them better than wrong poses with a more accurate robot.
bool IsNoiseOfAll(const Problem& problem, const JudgedCaptures& judged, const BundleOptions& options_in) {
  BundleOptions options = options_in;
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  Problem start = problem;
  start.camera = judged.solution.camera;
  start.shape = judged.solution.shape;
  const Outcome<Solution> of_all = RefineHandEye(start, judged.solution.hand_eye, options);
  if (!of_all) return false;
  // Both fits use the same points with the same weights.
  Problem kept = WithoutRejected(start, *of_all);
  options.loss = LossKind::kNone;
  const Outcome<Solution> of_members =
      RefineHandEye(PartOf(kept, MembersOf(judged.verdicts)), judged.solution.hand_eye, options);
  if (!of_members) return true;
  Solution in_common_weights = *of_members;
  in_common_weights.unmodelled_sigma_px = of_all->unmodelled_sigma_px;
  const Mixture one_noise = MixtureOf(kept, *of_all, std::vector<CaptureVerdict>(problem.views.size()), options);
  const Mixture two_noises = MixtureOf(kept, in_common_weights, judged.verdicts, options);
  return one_noise.log_likelihood >= two_noises.log_likelihood || two_noises.ratio < kDistinct;
}

}  // namespace

int JudgedCaptures::NumWrong() const {
  return static_cast<int>(
      std::count_if(verdicts.begin(), verdicts.end(), [](const CaptureVerdict& v) { return v.is_wrong; }));
}

JudgedCaptures JudgeCaptures(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  if (NumNoisyJoints(problem.views) > 0) {
    // Captures are judged by a white noise of the robot.
    Problem white = problem;
    for (View& view : white.views) view.gripper_by_joints.resize(6, 0);
    return JudgeCaptures(white, solution, options);
  }
  const FreeUnknowns free = FreeOf(problem.camera.Model(), options);
  JudgedCaptures judged;
  judged.verdicts.resize(problem.views.size());
  judged.solution = solution;
  // Each view has the outcome of the last solution that used it.
  std::vector<ViewOutcome> outcomes = solution.views;
  std::vector<size_t> members = MembersOf(judged.verdicts);
  constexpr int kMaxRounds = 8;
  for (int round = 0; round < kMaxRounds; ++round) {
    Solution at = judged.solution;
    at.views = outcomes;
    std::vector<CaptureVerdict> verdicts = FindOutlierCaptures(problem, at, free);
    const std::vector<size_t> next = MembersOf(verdicts);
    judged.verdicts = std::move(verdicts);
    if (next == members) break;
    members = next;
    Problem part = PartOf(problem, members);
    part.camera = judged.solution.camera;
    part.shape = judged.solution.shape;
    const Outcome<Solution> refined = RefineHandEye(part, judged.solution.hand_eye, options);
    if (!refined) break;
    judged.solution = *refined;
    for (size_t k = 0; k < members.size(); ++k) outcomes[members[k]] = refined->views[k];
  }
  const int num_wrong = judged.NumWrong();
  if (num_wrong > kMostWrong * static_cast<double>(problem.views.size()) && IsNoiseOfAll(problem, judged, options)) {
    judged.num_kept_against_test = num_wrong;
    for (CaptureVerdict& verdict : judged.verdicts) verdict.is_wrong = false;
    Problem all = problem;
    all.camera = judged.solution.camera;
    all.shape = judged.solution.shape;
    // Starts from the solution of the better captures; with all of them the first solution may be far off.
    const Outcome<Solution> refined = RefineHandEye(all, judged.solution.hand_eye, options);
    judged.solution = refined ? *refined : solution;
  }
  return judged;
}

}  // namespace heba
