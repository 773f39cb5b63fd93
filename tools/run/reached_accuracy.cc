#include "tools/run/reached_accuracy.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/data/prediction.h"
#include "heba/data/stated_pose.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"
#include "heba/location.h"
#include "heba/simulation/scene.h"
#include "solvers/initial/usable_views.h"

namespace heba {
namespace {

// An image of a camera that determines the pose of its target.
struct SeenTarget {
  const ProblemCapture* capture = nullptr;
  size_t target = 0;
  Observations observations;   // The points, of the target as manufactured.
  Rigid3d camera_from_target;  // The pose by the solution, with the errors that captures share.
  Eigen::Vector3d middle;      // The mean of the observed points, in the target.

  double DistanceM() const { return (camera_from_target * middle).norm(); }
};

std::vector<SeenTarget> TargetsSeenBy(size_t camera, const Problem& used, const Solution& solution) {
  std::vector<SeenTarget> seen;
  for (const ProblemCapture& capture : used.captures) {
    for (const ProblemImage& image : capture.images) {
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
std::optional<Eigen::Matrix3d> CovarianceOfMiddle(size_t camera, const SeenTarget& seen, const Problem& used,
                                                  const Solution& solution) {
  std::vector<StatedPose> grippers;
  for (size_t r = 0; r < used.robots.size(); ++r) grippers.push_back(StatedPoseOf(used, *seen.capture, r));
  const Outcome<LocatedTarget> located = LocateInCell(used, solution, {{camera, seen.observations}}, grippers);
  if (!located) return std::nullopt;
  const Eigen::Matrix3d target_from_world = located->world_from_target.RotationMatrix().transpose();
  return target_from_world * located->covariance.by_calibration_m2 * target_from_world.transpose();
}

// Returns the target moved to `place_in_camera`, with the pixels that the camera then sees; nothing if it has none or,
// with `is_within_image`, if its middle is not in the image.
std::optional<SeenTarget> MovedTo(const Eigen::Vector3d& place_in_camera, const Camera& camera, bool is_within_image,
                                  SeenTarget seen) {
  seen.camera_from_target.translation += place_in_camera - seen.camera_from_target * seen.middle;
  if (is_within_image && !AreInImage(camera, seen.camera_from_target, seen.middle, 0)) return std::nullopt;
  const bool is_seen = Predict(camera.Model(), camera.params.data(), seen.camera_from_target, seen.observations,
                               &seen.observations.pixels, nullptr);
  return is_seen ? std::optional(std::move(seen)) : std::nullopt;
}

// The accuracy of a camera at one place.
struct PlaceReach {
  std::optional<double> radius_m;
  Unreached unreached = Unreached::kNeverSeen;  // The reason if there is no radius.

  bool IsInView() const { return radius_m || unreached != Unreached::kNotInView; }
};

PlaceReach ReachOf(const SeenTarget& seen, size_t camera, double confidence, const Problem& used,
                   const Solution& solution) {
  const std::optional<Eigen::Matrix3d> covariance = CovarianceOfMiddle(camera, seen, used, solution);
  if (!covariance) return {std::nullopt, Unreached::kUndetermined};
  return {ConfidenceRadius(*covariance, confidence, solution.covariance_dof), {}};
}

// Returns the accuracy of a fixed camera at each required position, of a target as the fullest image shows it.
std::vector<PlaceReach> ReachedAt(const PlacedRequirement& required, size_t camera, const std::vector<SeenTarget>& seen,
                                  const Problem& used, const Solution& solution) {
  std::vector<PlaceReach> reached(required.places_in_base_m.size());
  const auto fullest = std::max_element(seen.begin(), seen.end(), [](const SeenTarget& a, const SeenTarget& b) {
    return a.observations.size() < b.observations.size();
  });
  if (fullest == seen.end()) return reached;
  const Rigid3d world_from_camera =
      solution.poses.world_from_base[used.cameras[camera].mount.robot] * solution.poses.mount_from_camera[camera];
  for (size_t k = 0; k < reached.size(); ++k) {
    // A position concerns those of several cameras that have it in their image. A single camera is judged there even if
    // its image ends before.
    const std::optional<SeenTarget> moved = MovedTo(Inverse(world_from_camera) * required.places_in_base_m[k],
                                                    solution.cameras[camera], used.cameras.size() > 1, *fullest);
    reached[k] = moved ? ReachOf(*moved, camera, required.confidence, used, solution)
                       : PlaceReach{std::nullopt, Unreached::kNotInView};
  }
  return reached;
}

// Returns the worst of the accuracies at the positions that a camera sees; nothing if it sees none of them, and others
// see all.
std::optional<PlaceReach> WorstOf(const std::vector<PlaceReach>& reached, bool is_any_unseen) {
  PlaceReach worst{0.0, {}};
  bool sees_any = false;
  for (const PlaceReach& reach : reached) {
    if (!reach.IsInView() && !is_any_unseen) continue;
    sees_any = true;
    if (!reach.radius_m) return reach;
    worst.radius_m = std::max(*worst.radius_m, *reach.radius_m);
  }
  return sees_any ? std::optional(worst) : std::nullopt;
}

// Returns whether no camera sees one of the positions.
bool IsAnyUnseen(const std::map<size_t, std::vector<PlaceReach>>& reached_of_cameras, size_t num_places) {
  for (size_t k = 0; k < num_places; ++k) {
    const bool is_seen = std::any_of(reached_of_cameras.begin(), reached_of_cameras.end(),
                                     [&](const auto& entry) { return entry.second[k].IsInView(); });
    if (!is_seen) return true;
  }
  return false;
}

}  // namespace

std::vector<std::optional<WorkingPoint>> WorkingPointsOf(const Problem& used, const Solution& solution,
                                                         const std::vector<Eigen::VectorXd>& changes) {
  std::vector<std::optional<WorkingPoint>> points(used.cameras.size());
  for (size_t c = 0; c < points.size(); ++c) {
    std::vector<SeenTarget> seen = TargetsSeenBy(c, used, solution);
    if (seen.empty()) continue;
    const auto median = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
    std::nth_element(seen.begin(), median, seen.end(),
                     [](const SeenTarget& a, const SeenTarget& b) { return a.DistanceM() < b.DistanceM(); });
    const std::optional<Eigen::Matrix3d> in_target = CovarianceOfMiddle(c, *median, used, solution);
    if (!in_target) continue;
    const Eigen::Matrix3d rotation = median->camera_from_target.RotationMatrix();
    WorkingPoint point{median->camera_from_target * median->middle, rotation * *in_target * rotation.transpose()};
    const std::string block = TargetPoseBlock(used.targets[median->target]);
    for (const Eigen::VectorXd& change : changes) {
      const Eigen::Vector3d in_camera = rotation * change.segment<3>(solution.covariance.layout.Block(block).first);
      point.covariance_m2 += in_camera * in_camera.transpose();
    }
    points[c] = point;
  }
  return points;
}

std::vector<CameraRequirement> ReachedAccuracies(const std::vector<PlacedRequirement>& requirements,
                                                 const Problem& used, const Solution& solution,
                                                 const std::vector<std::optional<WorkingPoint>>& working_points) {
  std::vector<CameraRequirement> reached;
  if (requirements.empty()) return reached;
  std::vector<std::vector<SeenTarget>> seen;
  for (size_t c = 0; c < used.cameras.size(); ++c) seen.push_back(TargetsSeenBy(c, used, solution));
  for (const PlacedRequirement& required : requirements) {
    const auto add = [&](size_t camera, const std::string& place, const PlaceReach& reach) {
      reached.push_back({camera, {required.within_m, required.confidence, place, reach.radius_m, reach.unreached}});
    };
    std::map<size_t, std::vector<PlaceReach>> placed;
    for (size_t c = 0; c < used.cameras.size(); ++c) {
      const ProblemCamera& camera = used.cameras[c];
      if (!required.camera.empty() && required.camera != camera.name) continue;
      if (!required.places_in_base_m.empty() && camera.mount.part == Mount::Part::kBase) {
        placed[c] = ReachedAt(required, c, seen[c], used, solution);
      } else {
        PlaceReach reach;
        if (working_points[c]) {
          reach.radius_m =
              ConfidenceRadius(working_points[c]->covariance_m2, required.confidence, solution.covariance_dof);
        }
        add(c, "the working point", reach);
      }
    }
    const bool is_any_unseen = IsAnyUnseen(placed, required.places_in_base_m.size());
    for (const auto& [c, of_camera] : placed) {
      const std::optional<PlaceReach> worst = WorstOf(of_camera, is_any_unseen);
      if (worst) add(c, required.text, *worst);
    }
  }
  return reached;
}

}  // namespace heba
