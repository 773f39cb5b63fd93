#include "solvers/cell/placing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "heba/evaluation/metrics.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/initial/target_pose.h"

namespace heba {
namespace {

// The error of a point that has no image.
constexpr double kNowherePx = 1e4;

// Returns the body of a mount, as CellPart::index of its origin.
size_t BodyOf(const Mount& mount) { return mount.part == Mount::Part::kBase ? 0 : 1 + mount.robot; }

Rigid3d WorldFromBody(size_t body, const PartPoses& poses, const ProblemCapture& capture) {
  return body == 0 ? Rigid3d() : poses.at(BasePart(body - 1)) * capture.base_from_gripper[body - 1];
}

// Returns world_from_body of the camera and of the target; two identities if they are in one body.
std::pair<Rigid3d, Rigid3d> WorldFromEnds(const Problem& problem, const PartPoses& poses, const PlacingImage& image) {
  const size_t of_camera = BodyOf(problem.cameras[image.image->camera].mount);
  const size_t of_target = BodyOf(problem.targets[image.image->target].mount);
  if (of_camera == of_target) return {};
  return {WorldFromBody(of_camera, poses, *image.capture), WorldFromBody(of_target, poses, *image.capture)};
}

bool IsPlaced(const PartPoses& poses, const PlacingImage& image) {
  return std::all_of(image.parts.begin(), image.parts.end(),
                     [&](const CellPart& part) { return poses.contains(part); });
}

Rigid3d PredictedByParts(const Problem& problem, const PartPoses& poses, const PlacingImage& image) {
  const auto [world_from_camera_body, world_from_target_body] = WorldFromEnds(problem, poses, image);
  return Inverse(world_from_camera_body * poses.at({CellPart::Kind::kCamera, image.image->camera})) *
         world_from_target_body * poses.at({CellPart::Kind::kTarget, image.image->target});
}

// Returns the pose of a part with which the camera sees the target in this pose.
Rigid3d PoseByImage(const Problem& problem, PartPoses poses, const CellPart& part, const PlacingImage& image,
                    const Rigid3d& camera_from_target) {
  const CellPart camera{CellPart::Kind::kCamera, image.image->camera};
  const CellPart target{CellPart::Kind::kTarget, image.image->target};
  poses[part] = Rigid3d();
  const auto [world_from_camera_body, world_from_target_body] = WorldFromEnds(problem, poses, image);
  const Rigid3d world_from_target = world_from_target_body * poses[target];
  const Rigid3d world_from_camera = world_from_camera_body * poses[camera];
  if (part == camera) return Inverse(world_from_camera_body) * world_from_target * Inverse(camera_from_target);
  if (part == target) return Inverse(world_from_target_body) * world_from_camera * camera_from_target;
  // A base, whose arm carries the camera or the target.
  const bool carries_camera = BodyOf(problem.cameras[image.image->camera].mount) == 1 + part.index;
  return carries_camera ? world_from_target * Inverse(world_from_camera * camera_from_target)
                        : world_from_camera * camera_from_target * Inverse(world_from_target);
}

double MisfitPx2(double rms_px) { return std::log1p(rms_px * rms_px); }

// An image that determines the pose of its target.
struct PlacedImage {
  const PlacingImage* image = nullptr;
  std::vector<TargetPose> poses;
  double variance_m2 = 0;  // Placement::variance_m2 of the best one.
};

std::vector<PlacedImage> PosedImages(const Problem& problem, const std::vector<PlacingImage>& images) {
  std::vector<PlacedImage> posed;
  for (const PlacingImage& image : images) {
    std::vector<TargetPose> poses =
        EstimateTargetPose(problem.cameras[image.image->camera].camera, image.image->observations);
    std::erase_if(poses, [](const TargetPose& pose) { return !pose.covariance_at_1px; });
    if (poses.empty()) continue;
    const double error_px = std::max(poses.front().rms_px, 1.0);
    const double variance_m2 = error_px * error_px * PointVarianceM2(*poses.front().covariance_at_1px);
    posed.push_back({&image, std::move(poses), variance_m2});
  }
  std::stable_sort(posed.begin(), posed.end(),
                   [](const PlacedImage& a, const PlacedImage& b) { return a.variance_m2 < b.variance_m2; });
  return posed;
}

// Places one part of a rig by images of which all other parts are in place.
class Placer {
 public:
  Placer(const Problem& problem, const PartPoses& poses, const CellPart& part, const std::vector<PlacingImage>& images)
      : problem_(problem), poses_(poses), part_(part), images_(images) {}

  // Returns the poses of the part that one pose of the target in an image allows, one for each reading order.
  std::vector<Rigid3d> PosesBy(const PlacingImage& image, const TargetPose& seen) const {
    std::vector<Rigid3d> allowed;
    for (const Rigid3d& symmetry : problem_.targets[image.image->target].symmetries) {
      allowed.push_back(PoseByImage(problem_, poses_, part_, image, seen.camera_from_target * Inverse(symmetry)));
      // The orientation of a target that is not placed is what the reading makes it.
      if (part_ == CellPart{CellPart::Kind::kTarget, image.image->target}) break;
    }
    return allowed;
  }

  PartPoses With(const Rigid3d& pose) const {
    PartPoses poses = poses_;
    poses[part_] = pose;
    return poses;
  }

  double Misfit(const Rigid3d& pose) const { return MisfitOf(problem_, With(pose), images_); }

  // Returns the mean of the poses by all images, each in the reading order nearest to `pose`, if it fits better.
  Rigid3d Averaged(const Rigid3d& pose, const std::vector<PlacedImage>& posed) const {
    const PartPoses poses = With(pose);
    Tangent6 sum = Tangent6::Zero();
    double sum_of_weights = 0;
    for (const PlacedImage& image : posed) {
      std::optional<Tangent6> nearest;
      for (const TargetPose& seen : image.poses) {
        for (const Rigid3d& symmetry : problem_.targets[image.image->image->target].symmetries) {
          const Rigid3d by_image =
              PoseByImage(problem_, poses_, part_, *image.image, seen.camera_from_target * Inverse(symmetry));
          const Tangent6 step = LocalCoordinates(pose, by_image);
          if (!nearest || step.tail<3>().norm() < nearest->tail<3>().norm()) nearest = step;
        }
      }
      const double rms_px =
          BestReadingOrder(problem_, *image.image->image, PredictedByParts(problem_, poses, *image.image)).rms_px;
      const double weight = 1 / (image.variance_m2 * std::pow(1 + rms_px * rms_px, 2));
      sum += weight * *nearest;
      sum_of_weights += weight;
    }
    const Rigid3d mean = Retract(pose, sum / sum_of_weights);
    return Misfit(mean) < Misfit(pose) ? mean : pose;
  }

 private:
  const Problem& problem_;
  const PartPoses& poses_;
  CellPart part_;
  const std::vector<PlacingImage>& images_;
};

}  // namespace

CellPart BasePart(size_t robot) {
  return robot == 0 ? CellPart{CellPart::Kind::kOrigin, 0} : CellPart{CellPart::Kind::kBase, robot};
}

CellPart GripperPart(size_t robot) { return {CellPart::Kind::kOrigin, 1 + robot}; }

std::vector<PlacingImage> PlacingImages(const Problem& problem) {
  std::vector<PlacingImage> images;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.observations.size() == 0) continue;
      PlacingImage& placing = images.emplace_back(PlacingImage{&capture, &image, {}});
      placing.parts = {{CellPart::Kind::kCamera, image.camera}, {CellPart::Kind::kTarget, image.target}};
      const size_t of_camera = BodyOf(problem.cameras[image.camera].mount);
      const size_t of_target = BodyOf(problem.targets[image.target].mount);
      for (const size_t body : {of_camera, of_target}) {
        // The base of the first arm is the origin.
        if (of_camera != of_target && body > 1) placing.parts.push_back(BasePart(body - 1));
      }
    }
  }
  return images;
}

ReadingOrder BestReadingOrder(const Problem& problem, const ProblemImage& image, const Rigid3d& camera_from_target) {
  ReadingOrder best{image.observations.points_in_target, kNowherePx};
  for (const Rigid3d& symmetry : problem.targets[image.target].symmetries) {
    Observations read = image.observations;
    read.points_in_target =
        ((symmetry.RotationMatrix() * image.observations.points_in_target).colwise() + symmetry.translation).eval();
    const std::optional<SquaredErrors> errors =
        ViewErrors(problem.cameras[image.camera].camera, camera_from_target, read);
    if (!errors || !(errors->RmsPx() < best.rms_px)) continue;
    best = {std::move(read.points_in_target), *errors->RmsPx()};
  }
  return best;
}

double MisfitOf(const Problem& problem, const PartPoses& poses, const std::vector<PlacingImage>& images) {
  double sum = 0;
  for (const PlacingImage& image : images) {
    if (!IsPlaced(poses, image)) continue;
    sum += MisfitPx2(BestReadingOrder(problem, *image.image, PredictedByParts(problem, poses, image)).rms_px);
  }
  return sum;
}

std::vector<Placement> PlaceByImages(const Problem& problem, const PartPoses& poses, const CellPart& part,
                                     const std::vector<PlacingImage>& images) {
  const std::vector<PlacedImage> posed = PosedImages(problem, images);
  const Placer placer(problem, poses, part, images);
  // The images that determine the pose best, so many that some of them are right.
  constexpr size_t kMostProposals = 10;
  struct Proposal {
    std::vector<Rigid3d> poses;
    std::vector<double> misfits;
    const PlacedImage* image = nullptr;
  };
  std::optional<Proposal> best;
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < std::min(posed.size(), kMostProposals); ++i) {
    for (const TargetPose& seen : posed[i].poses) {
      Proposal proposal{placer.PosesBy(*posed[i].image, seen), {}, &posed[i]};
      for (const Rigid3d& pose : proposal.poses) proposal.misfits.push_back(placer.Misfit(pose));
      const double misfit = *std::min_element(proposal.misfits.begin(), proposal.misfits.end());
      if (!(misfit < least)) continue;
      least = misfit;
      best = std::move(proposal);
    }
  }
  std::vector<Placement> placements;
  if (!best) return placements;
  for (size_t k = 0; k < best->poses.size(); ++k) {
    if (best->misfits[k] > least + kClearMisfit) continue;
    placements.push_back(
        {placer.Averaged(best->poses[k], posed), best->image->image->image->target, best->image->variance_m2});
    if (best->misfits[k] == least) std::swap(placements.front(), placements.back());
  }
  return placements;
}

double PointVarianceM2(const Eigen::Matrix<double, 6, 6>& covariance) {
  constexpr double kLeverM = 0.5;
  return covariance.topLeftCorner<3, 3>().trace() + kLeverM * kLeverM * covariance.bottomRightCorner<3, 3>().trace();
}

}  // namespace heba
