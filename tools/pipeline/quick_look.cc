#include "tools/pipeline/quick_look.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"
#include "heba/refinement.h"
#include "heba/session_check.h"
#include "solvers/uncertainty/robot_noise.h"
#include "tools/run/earlier_run.h"
#include "tools/text/check_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// Returns the covariance of the only camera's pose with the captures of a session; nothing if they cannot be combined.
std::optional<Eigen::Matrix<double, 6, 6>> CovarianceWith(const std::shared_ptr<const FinishedRun>& run,
                                                          Problem problem) {
  const RunResult& result = run->result;
  if (problem.cameras.size() != 1 || problem.robots.size() != 1) return std::nullopt;
  problem.cameras[0].free_intrinsics = FreeIntrinsicsOf(result, 0);
  const Solution& solution = result.solution;
  try {
    problem = WithPrior(std::move(problem), {result.name, {run, &run->result}, {}});
  } catch (const InputError&) {
    return std::nullopt;
  }
  AdjustmentOptions options;
  options.loss = LossKind::kNone;
  constexpr double kLeastPx = 1e-6;  // A file may state an exact camera.
  options.pixel_noise_px = std::max(solution.pixel_sigmas_px[0], kLeastPx);
  const bool is_exact = !solution.robot_noise[0];
  options.robot = is_exact ? AdjustmentOptions::Robot::kExact : AdjustmentOptions::Robot::kGivenNoise;
  if (!is_exact) options.robot_noise = NoiseElsewhere(solution, 0);
  const Outcome<Solution> updated = RefineProblem(problem, solution.poses, options);
  return updated ? PoseCovarianceOf(updated->covariance, CameraPoseBlock(problem.cameras[0])) : std::nullopt;
}

}  // namespace

std::string QuickLook(const std::shared_ptr<const FinishedRun>& run, const std::vector<SessionImage>& images,
                      const std::vector<ArmsAtImage>& poses, const std::vector<std::vector<Detection>>& seen) {
  const Session session = SessionOf(*run, images, poses, seen);
  SessionOptions options = SessionOptionsOf(*run, true);
  options.wobble = {};  // It is one session.
  const Outcome<SessionCheck> check = CheckSession(session.problem, run->result.solution, options);
  if (!check && check.failure().code == "hidden_point")
    return "shows the target elsewhere: the pose of the robot belongs to another image";
  if (!check) return "";
  const bool is_one = check->num_images == 1;
  if (DecisionOf(*check) != "holds") {
    return (is_one ? "contradicts the captures before: " : "contradict the captures before: ") +
           ChangeText(session.problem, *check) + "; or the pose of the robot is wrong";
  }
  std::string text = is_one ? "agrees with the captures before" : "agree with the captures before";
  if (const std::optional<Eigen::Matrix<double, 6, 6>> covariance = CovarianceWith(run, session.problem)) {
    const auto [sigma_m, sigma_rad] = LargestSigmas(*covariance);
    text += "; with " + std::string(is_one ? "it" : "them") + " the camera's pose is known to " +
            ShownAmount(1000 * sigma_m, 2) + " mm and " + ShownAmount(RadToDeg(sigma_rad), 2) + " deg";
  }
  return text;
}

}  // namespace heba
