#include "tools/pipeline/reference_session.h"

#include <algorithm>
#include <optional>

#include "heba/base/error.h"
#include "heba/location.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

constexpr size_t kFewestPoints = 4;

// Returns the camera and the targets of a run, all of which stand in one base, without captures. The lens of the camera
// is not taken for granted.
Problem StandingStill(const RunResult& result, size_t camera) {
  Problem problem = result.rig;
  problem.captures.clear();
  problem.effects.clear();
  problem.robots.resize(1);
  problem.cameras = {result.rig.cameras[camera]};
  problem.cameras[0].mount = {0, Mount::Part::kBase};
  problem.cameras[0].camera = result.solution.cameras[camera];
  problem.cameras[0].free_intrinsics = BundleOptions().free_intrinsics;
  for (ProblemTarget& target : problem.targets) {
    target.mount = {0, Mount::Part::kBase};
    target.free_shape.clear();
  }
  return problem;
}

// Returns the solution of such a problem in the frame of the camera, with what the run knows of its lens and its noise.
Solution InCamera(const RunResult& result, size_t camera, const Problem& problem) {
  const Solution& of_run = result.solution;
  Solution solution;
  solution.poses.world_from_base = {Rigid3d()};
  solution.poses.mount_from_camera = {Rigid3d()};
  solution.poses.mount_from_target.resize(problem.targets.size());
  solution.cameras = {of_run.cameras[camera]};
  solution.shapes = of_run.shapes;
  solution.pixel_sigmas_px = {of_run.pixel_sigmas_px[camera]};
  solution.image_sigmas_px = {of_run.image_sigmas_px[camera]};
  solution.unmodelled_sigma_px = {std::nullopt};
  solution.robot_noise = {std::nullopt};
  solution.robot_noise_stddev = {std::nullopt};
  solution.smooth_noise = {std::nullopt};
  solution.covariance.layout = UnknownsOf(problem);
  solution.covariance.matrix =
      Eigen::MatrixXd::Zero(solution.covariance.layout.size(), solution.covariance.layout.size());
  solution.covariance_dof = of_run.covariance_dof;
  return solution;
}

}  // namespace

ReferenceSession ReadReferenceSession(const FinishedRun& run, const std::vector<SessionImage>& references,
                                      const std::vector<SessionImage>& images, int num_threads) {
  const size_t camera = images.front().camera;
  ReferenceSession session;
  Problem& problem = session.problem;
  problem = StandingStill(run.result, camera);
  Solution& solution = session.solution;
  solution = InCamera(run.result, camera, problem);
  const SeenTargets in_references = DetectTargets(run, references, num_threads);
  std::vector<bool> is_known(run.targets.size(), false);
  std::string why_unknown = "no reference image shows the target";
  for (size_t t = 0; t < run.targets.size(); ++t) {
    std::vector<CameraObservations> seen;
    for (const std::vector<Detection>& in_image : in_references) {
      if (in_image[t].ids.size() >= kFewestPoints) seen.push_back({0, ObservationsOf(*run.targets[t], in_image[t])});
    }
    if (seen.empty()) continue;
    const Outcome<std::vector<LocatedTarget>> located = LocateTargetInCell(problem, solution, t, seen, {StatedPose()});
    if (!located) {
      why_unknown = FailureText(located.failure());
      continue;
    }
    is_known[t] = true;
    solution.poses.mount_from_target[t] = located->front().world_from_target;
    const UnknownBlock block = solution.covariance.layout.Block(TargetPoseBlock(problem.targets[t]));
    solution.covariance.matrix.block<6, 6>(block.first, block.first) = located->front().pose_covariance.by_image;
  }
  if (std::find(is_known.begin(), is_known.end(), true) == is_known.end()) {
    throw InputError("the reference images: " + why_unknown);
  }
  const SeenTargets seen = DetectTargets(run, images, num_threads);
  for (size_t i = 0; i < images.size(); ++i) {
    ProblemCapture& capture = problem.captures.emplace_back();
    capture.name = images[i].path.string();
    capture.base_from_gripper = {Rigid3d()};
    for (size_t t = 0; t < run.targets.size(); ++t) {
      if (!is_known[t] || seen[i][t].ids.size() < kFewestPoints) continue;
      capture.images.push_back(
          {0, t,
           InPredictedOrder(solution.cameras[0], problem.targets[t].symmetries, solution.shapes[t],
                            solution.poses.mount_from_target[t], ObservationsOf(*run.targets[t], seen[i][t]))});
    }
    if (!capture.images.empty()) continue;
    const std::string reason = run.targets.size() == 1 ? seen[i].front().reason : "";
    session.notes.push_back(capture.name + ": shows no target of the reference images" +
                            (reason.empty() ? "" : ": " + reason));
  }
  return session;
}

}  // namespace heba
