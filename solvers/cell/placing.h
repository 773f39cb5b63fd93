// Places a part of a rig by the images in which everything else is placed.
//
// A target that looks the same in several orientations can be read in several orders, in each image by itself. Images
// of it then allow several poses of the part, unless they are taken from different sides or show other targets too.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "heba/data/problem.h"

namespace heba {

// A camera, target or base of an arm, or the origin of a rigid body: the first base, with everything that is fixed on
// a base, or a gripper with everything that it carries.
struct CellPart {
  enum class Kind { kOrigin, kCamera, kTarget, kBase };
  Kind kind = Kind::kOrigin;
  // The index of the camera, target or arm; that of an origin is 0 for the first base, 1 + r for the gripper of arm r.
  size_t index = 0;
  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 sees a zero in a defaulted comparison.
  friend auto operator<=>(const CellPart&, const CellPart&) = default;
};

CellPart BasePart(size_t robot);
CellPart GripperPart(size_t robot);

// The pose of each part that is placed, in its body.
using PartPoses = std::map<CellPart, Rigid3d>;

// An image with points. The problem must outlive it.
struct PlacingImage {
  const ProblemCapture* capture = nullptr;
  const ProblemImage* image = nullptr;
  std::vector<CellPart> parts;  // The parts whose poses determine camera_from_target, without origins.
};
std::vector<PlacingImage> PlacingImages(const Problem& problem);

// The order in which the points of a symmetric target are read.
struct ReadingOrder {
  Points3 points_in_target;
  double rms_px = 0;  // The error of the image with these points; large if a point has no image.
};
// Returns the reading order with the smallest error, if the camera sees the target in this pose.
ReadingOrder BestReadingOrder(const Problem& problem, const ProblemImage& image, const Rigid3d& camera_from_target);

// Returns how badly the poses explain the images whose parts are all placed, each in its best reading order: the sum of
// log(1 + (rms / 1 px)^2), which wrong images increase by about as much for any poses.
double MisfitOf(const Problem& problem, const PartPoses& poses, const std::vector<PlacingImage>& images);

// Poses whose misfits differ by more than this are told apart: as by one image that fits the better ones, while the
// worse ones are off by 7 px.
inline constexpr double kClearMisfit = 4;

// A pose that images allow.
struct Placement {
  Rigid3d pose;
  size_t target = 0;  // The target in the image that it comes from.
  // The variance of a point half a metre away if that image has an error of 1 px, or its own error if that is larger.
  double variance_m2 = 0;
};

// Returns the poses of `part` that the images allow, the best first: several if a symmetric target can be read in
// several orders that nothing tells apart. All parts of the images but this one must be placed. Each image that
// determines the pose of its target proposes one for each reading order, and the one with the smallest misfit to all
// images is averaged with those of the others, which count for less the less they agree. Returns an empty list if no
// image determines the pose of its target.
std::vector<Placement> PlaceByImages(const Problem& problem, const PartPoses& poses, const CellPart& part,
                                     const std::vector<PlacingImage>& images);

// The variance of a point half a metre away, for a covariance of a pose.
double PointVarianceM2(const Eigen::Matrix<double, 6, 6>& covariance);

}  // namespace heba
