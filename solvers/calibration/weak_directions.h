// The directions in which a result is known least, and the captures that would determine them better.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera.h"
#include "heba/data/pair_problem.h"
#include "heba/data/pair_solution.h"
#include "heba/evaluation/finding.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// A direction of the unknowns and what is known about it.
struct WeakDirection {
  std::string name;           // Such as "the camera's position along the base's x".
  Eigen::VectorXd direction;  // In the space of the unknowns; of length 1 except for a focal length.
  double sigma = 0;           // m, rad or px.
  double wanted = 0;          // The sigma from which the direction is worth naming.
  double doubtful = 0;        // The sigma from which it makes the result doubtful.
  std::string unit;
  double unit_size = 1;  // Size of `unit`, in the unknowns' unit.

  bool IsWeak() const { return sigma > wanted; }
};

// Returns the directions of the largest sigmas of the position and of the orientation of a pose, whose tangent starts
// at `first` in the covariance. Each is named by the axis of `child` or of `parent` that is close to it, or by a vector
// in `child`. Worth naming are 1 mm and 0.1 deg; doubtful is the share kSigmaShare of `distance_m`, at which the camera
// works, and that many rad.
std::vector<WeakDirection> WorstDirections(const Eigen::MatrixXd& covariance, Eigen::Index first,
                                           const Rigid3d& parent_from_child, std::string_view parent,
                                           const std::string& child, double distance_m);
// Returns the focal lengths and the coordinates of the principal point that are unknown. `block` is that of the camera,
// and may be empty. Worth naming are 0.2 % of the focal length and of the image's width, doubtful 1 %: errors of
// intrinsics and poses partly cancel at a located target.
std::vector<WeakDirection> IntrinsicDirections(const Covariance& covariance, const UnknownBlock& block,
                                               const Camera& camera);
// Returns the directions by the ratio of what is known to what is wanted, the worst first.
std::vector<WeakDirection> ByNeed(std::vector<WeakDirection> directions);

// A standard motion of two additional captures.
struct CandidateMotion {
  std::string name;                                     // The name `motion` of a finding `suggested_captures`.
  std::vector<std::pair<std::string, double>> numbers;  // The size of the motion.
  std::array<Rigid3d, 2> camera_from_target;
};
// Returns the motions that are tried about a pose of the target: tilted about its axes, rotated in its plane, nearer
// and farther, towards the sides of the image. `middle` is the centre of its points, in its frame.
std::vector<CandidateMotion> CandidateMotions(const Camera& camera, const Rigid3d& camera_from_target,
                                              const Eigen::Vector3d& middle);

// The images of points as a camera would see them, without noise and without weights.
struct ImaginedPoints {
  Observations inside;  // The points that lie in the image.
  int num_outside = 0;
};
// Returns nothing if a point has no image. `points` lie where they are, not as designed.
std::optional<ImaginedPoints> ImaginePoints(const Camera& camera, const Observations& points,
                                            const Rigid3d& camera_from_target);

// Captures are suggested if they reduce the sigma of a direction to less than this share of it.
inline constexpr double kHelps = 0.85;

// Returns the finding `weak_direction` with a part `weak_direction_of` for each direction, of which there is at least
// one. It is good if none of them is weak.
Finding FindingOf(const std::vector<WeakDirection>& directions);
// Returns its part `suggested_captures`: the sigma of the direction with these captures.
Finding SuggestionOf(const CandidateMotion& motion, bool moves_target, const WeakDirection& direction, double sigma);

}  // namespace heba
