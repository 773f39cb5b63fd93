#include "tools/run/rig_requirements.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/data/prediction.h"
#include "heba/data/stated_pose.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"
#include "heba/rig_location.h"
#include "solvers/initial/usable_views.h"

namespace heba {
namespace {

// An image of a camera that determines the pose of its target.
struct SeenTarget {
  const RigCapture* capture = nullptr;
  size_t target = 0;
  Observations observations;   // Of the target as manufactured.
  Rigid3d camera_from_target;  // By the solution, with the errors that captures share.
  Eigen::Vector3d middle;      // Of the observed points, in the target.

  double DistanceM() const { return (camera_from_target * middle).norm(); }
};

std::vector<SeenTarget> TargetsSeenBy(size_t camera, const RigProblem& used, const RigSolution& solution) {
  std::vector<SeenTarget> seen;
  for (const RigCapture& capture : used.captures) {
    for (const RigImage& image : capture.images) {
      if (image.camera != camera || image.observations.size() < kMinPosePoints) continue;
      Observations observations = ApplyShape(image.observations, solution.shapes[image.target]);
      const Eigen::Vector3d middle = observations.points_in_target.rowwise().mean();
      seen.push_back(
          {&capture, image.target, std::move(observations),
           CameraFromTarget(used, solution.poses, camera, image.target, WithErrors(capture, solution.effects)),
           middle});
    }
  }
  return seen;
}

// Returns the covariance of the middle of the target by the calibration, m^2, in the target's axes; nothing if its pose
// cannot be determined.
std::optional<Eigen::Matrix3d> CovarianceOfMiddle(size_t camera, const SeenTarget& seen, const RigProblem& used,
                                                  const RigSolution& solution) {
  std::vector<StatedPose> grippers;
  for (size_t r = 0; r < used.robots.size(); ++r) {
    StatedPose& gripper = grippers.emplace_back(seen.capture->base_from_gripper[r]);
    if (!seen.capture->effects.empty()) gripper.effect = seen.capture->effects[r];
  }
  const Outcome<RigLocation> located = LocateInRig(used, solution, {{camera, seen.observations}}, grippers);
  if (!located) return std::nullopt;
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << Eigen::Matrix3d::Identity(), -Skew(seen.middle);
  return by_pose * located->by_calibration * by_pose.transpose();
}

// Returns the target moved to `place_in_camera`, with the pixels that the camera then sees; nothing if its middle is
// not in the image.
std::optional<SeenTarget> MovedTo(const Eigen::Vector3d& place_in_camera, const Camera& camera, SeenTarget seen) {
  seen.camera_from_target.translation += place_in_camera - seen.camera_from_target * seen.middle;
  if (!Predict(camera.Model(), camera.params.data(), seen.camera_from_target, seen.observations,
               &seen.observations.pixels, nullptr)) {
    return std::nullopt;
  }
  const Eigen::Vector2d middle = seen.observations.pixels.rowwise().mean();
  const bool is_in_image =
      (middle.array() >= 0).all() && middle.x() <= camera.width_px - 1 && middle.y() <= camera.height_px - 1;
  return is_in_image ? std::optional(std::move(seen)) : std::nullopt;
}

// Returns the radius that is reached at all places, or nothing if the camera does not see one of them.
std::optional<double> ReachedAt(const PlacedRequirement& required, size_t camera, const std::vector<SeenTarget>& seen,
                                const RigProblem& used, const RigSolution& solution) {
  const auto fullest = std::max_element(seen.begin(), seen.end(), [](const SeenTarget& a, const SeenTarget& b) {
    return a.observations.size() < b.observations.size();
  });
  if (fullest == seen.end()) return std::nullopt;
  const Rigid3d world_from_camera =
      WorldFromMount(used.cameras[camera].mount, solution.poses.world_from_base, fullest->capture->base_from_gripper) *
      solution.poses.mount_from_camera[camera];
  double reached_m = 0;
  for (const Eigen::Vector3d& place : required.places_in_base_m) {
    const std::optional<SeenTarget> moved =
        MovedTo(Inverse(world_from_camera) * place, solution.cameras[camera], *fullest);
    const std::optional<Eigen::Matrix3d> covariance =
        moved ? CovarianceOfMiddle(camera, *moved, used, solution) : std::nullopt;
    if (!covariance) return std::nullopt;
    reached_m = std::max(reached_m, ConfidenceRadius(*covariance, required.confidence, solution.covariance_dof));
  }
  return reached_m;
}

// Returns the radius that is reached where the target was seen.
std::optional<double> ReachedWhereSeen(const PlacedRequirement& required, size_t camera, std::vector<SeenTarget> seen,
                                       const RigProblem& used, const RigSolution& solution) {
  if (seen.empty()) return std::nullopt;
  const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
  std::nth_element(seen.begin(), middle, seen.end(),
                   [](const SeenTarget& a, const SeenTarget& b) { return a.DistanceM() < b.DistanceM(); });
  const std::optional<Eigen::Matrix3d> covariance = CovarianceOfMiddle(camera, *middle, used, solution);
  if (!covariance) return std::nullopt;
  return ConfidenceRadius(*covariance, required.confidence, solution.covariance_dof);
}

}  // namespace

std::vector<RigRequirement> ReachedInRig(const std::vector<PlacedRequirement>& requirements, const RigProblem& used,
                                         const RigSolution& solution) {
  std::vector<RigRequirement> reached;
  for (const PlacedRequirement& required : requirements) {
    std::vector<RigRequirement> placed;
    for (size_t c = 0; c < used.cameras.size(); ++c) {
      const RigCamera& camera = used.cameras[c];
      if (!required.camera.empty() && required.camera != camera.name) continue;
      std::vector<SeenTarget> seen = TargetsSeenBy(c, used, solution);
      const bool is_placed = !required.places_in_base_m.empty() && camera.mount.part == Mount::Part::kBase;
      Requirement entry{required.within_m, required.confidence, is_placed ? required.text : "the working point", {}};
      entry.reached_m = is_placed ? ReachedAt(required, c, seen, used, solution)
                                  : ReachedWhereSeen(required, c, std::move(seen), used, solution);
      (is_placed ? placed : reached).push_back({c, std::move(entry)});
    }
    const auto is_in_view = [](const RigRequirement& entry) { return entry.requirement.reached_m.has_value(); };
    if (std::any_of(placed.begin(), placed.end(), is_in_view)) {
      std::erase_if(placed, [&](const RigRequirement& entry) { return !is_in_view(entry); });
    }
    for (RigRequirement& entry : placed) reached.push_back(std::move(entry));
  }
  return reached;
}

}  // namespace heba
