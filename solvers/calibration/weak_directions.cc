#include "solvers/calibration/weak_directions.h"

#include <algorithm>
#include <cmath>

#include "heba/base/factorisation.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/prediction.h"
#include "heba/evaluation/limits.h"
#include "solvers/residuals/inliers.h"
#include "solvers/uncertainty/information.h"

namespace heba {
namespace {

std::string AxisName(const Eigen::Vector3d& direction, const Eigen::Matrix3d& parent_from_child,
                     std::string_view parent, const std::string& child) {
  constexpr double kNearAxis = 0.9;
  const Eigen::Vector3d in_parent = parent_from_child * direction;
  Eigen::Index child_axis = 0;
  Eigen::Index parent_axis = 0;
  const double child_part = direction.cwiseAbs().maxCoeff(&child_axis);
  const double parent_part = in_parent.cwiseAbs().maxCoeff(&parent_axis);
  if (std::max(child_part, parent_part) < kNearAxis) {
    return "[" + Fixed(direction.x(), 2) + ", " + Fixed(direction.y(), 2) + ", " + Fixed(direction.z(), 2) +
           "] of the " + child;
  }
  const bool by_child = child_part >= parent_part;
  return "the " + (by_child ? child : std::string(parent)) + "'s " +
         std::string(1, "xyz"[by_child ? child_axis : parent_axis]);
}

// Returns the direction of the largest variance within three unknowns.
WeakDirection WorstOf(const Eigen::MatrixXd& covariance, Eigen::Index first, const std::string& what,
                      const Eigen::Matrix3d& parent_from_child, std::string_view parent, const std::string& child) {
  const SymmetricEigen<3> eigen = EigenOfSymmetric(covariance.block<3, 3>(first, first));
  WeakDirection weakness;
  weakness.direction = Eigen::VectorXd::Zero(covariance.rows());
  weakness.direction.segment<3>(first) = eigen.vectors.col(2);
  weakness.sigma = std::sqrt(std::max(0.0, eigen.values[2]));
  weakness.name = what + AxisName(eigen.vectors.col(2), parent_from_child, parent, child);
  return weakness;
}

}  // namespace

std::vector<WeakDirection> WorstDirections(const Eigen::MatrixXd& covariance, Eigen::Index first,
                                           const Rigid3d& parent_from_child, std::string_view parent,
                                           const std::string& child, double distance_m) {
  constexpr double kWantedM = 1e-3;
  const double wanted_rad = DegToRad(0.1);
  const Eigen::Matrix3d rotation = parent_from_child.RotationMatrix();
  WeakDirection position = WorstOf(covariance, first, "the " + child + "'s position along ", rotation, parent, child);
  position.wanted = kWantedM;
  position.doubtful = kSigmaShare.doubtful * distance_m;
  position.unit = "mm";
  position.unit_size = 1e-3;
  WeakDirection orientation =
      WorstOf(covariance, first + 3, "the " + child + "'s orientation about ", rotation, parent, child);
  orientation.wanted = wanted_rad;
  orientation.doubtful = kSigmaShare.doubtful;
  orientation.unit = "deg";
  orientation.unit_size = DegToRad(1.0);
  return {position, orientation};
}

std::vector<WeakDirection> IntrinsicDirections(const Covariance& covariance, const UnknownBlock& block,
                                               const Camera& camera) {
  constexpr double kWantedRatio = 0.002;
  constexpr double kDoubtfulRatio = 0.01;
  std::vector<WeakDirection> directions;
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    const Unknown& unknown = covariance.layout[i];
    const bool is_focal = unknown.group == UnknownGroup::kFocal;
    if (!is_focal && unknown.group != UnknownGroup::kPrincipalPoint) continue;
    WeakDirection weakness;
    weakness.name = "the camera's " + camera.Model().param_names()[static_cast<size_t>(unknown.index)];
    weakness.direction = is_focal ? AxialFocalLengthByUnknowns(camera, unknown.index, covariance.layout, block)
                                  : Eigen::VectorXd::Unit(covariance.layout.size(), i);
    weakness.sigma = std::sqrt(weakness.direction.dot(covariance.matrix * weakness.direction));
    const double size_px = is_focal ? AxialFocalLength(camera, 0) : camera.width_px;
    weakness.wanted = kWantedRatio * size_px;
    weakness.doubtful = kDoubtfulRatio * size_px;
    weakness.unit = "px";
    directions.push_back(std::move(weakness));
  }
  return directions;
}

std::vector<WeakDirection> ByNeed(std::vector<WeakDirection> directions) {
  std::stable_sort(directions.begin(), directions.end(), [](const WeakDirection& a, const WeakDirection& b) {
    return a.sigma / a.wanted > b.sigma / b.wanted;
  });
  return directions;
}

std::vector<CandidateMotion> CandidateMotions(const Camera& camera, const Rigid3d& camera_from_target,
                                              const Eigen::Vector3d& middle) {
  // Rotates the target about the centre of its points.
  const auto turned = [&](const Eigen::Vector3d& axis_in_target, double angle_rad) {
    const Rigid3d about(ExpRotation(angle_rad * axis_in_target), Eigen::Vector3d::Zero());
    return camera_from_target * Rigid3d(Eigen::Quaterniond::Identity(), middle) * about *
           Rigid3d(Eigen::Quaterniond::Identity(), -middle);
  };
  const auto moved = [&](const Eigen::Vector3d& by_m) {
    return Rigid3d(camera_from_target.rotation, camera_from_target.translation + by_m);
  };
  constexpr double kTiltDeg = 25;
  constexpr double kTurnDeg = 45;
  const auto turned_both_ways = [&](const Eigen::Vector3d& axis_in_target, double angle_deg) {
    return std::array{turned(axis_in_target, DegToRad(angle_deg)), turned(axis_in_target, -DegToRad(angle_deg))};
  };
  const auto moved_both_ways = [&](const Eigen::Vector3d& by_m) { return std::array{moved(by_m), moved(-by_m)}; };
  const Eigen::Vector3d centre = camera_from_target * middle;
  const double side_m = 0.25 * centre.z() * camera.width_px / camera.params[0];
  return {{"tilt_about_x", {{"angle_deg", kTiltDeg}}, turned_both_ways(Eigen::Vector3d::UnitX(), kTiltDeg)},
          {"tilt_about_y", {{"angle_deg", kTiltDeg}}, turned_both_ways(Eigen::Vector3d::UnitY(), kTiltDeg)},
          {"rotate_in_plane", {{"angle_deg", kTurnDeg}}, turned_both_ways(Eigen::Vector3d::UnitZ(), kTurnDeg)},
          {"nearer_and_farther",
           {{"distance_mm", 250 * centre.z()}},
           moved_both_ways(0.25 * centre.z() * centre.normalized())},
          {"left_and_right", {}, moved_both_ways({side_m, 0, 0})},
          {"top_and_bottom", {}, moved_both_ways({0, side_m, 0})}};
}

std::optional<ImaginedPoints> ImaginePoints(const Camera& camera, const Observations& points,
                                            const Rigid3d& camera_from_target) {
  Observations seen = points;
  seen.covariances_px2.clear();
  seen.whitening.clear();
  if (!Predict(camera.Model(), camera.params.data(), camera_from_target, points, &seen.pixels, nullptr)) {
    return std::nullopt;
  }
  std::vector<bool> is_inside;
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d pixel = seen.pixels.col(i);
    is_inside.push_back((pixel.array() >= 0).all() && pixel.x() <= camera.width_px && pixel.y() <= camera.height_px);
  }
  const auto num_outside = static_cast<int>(std::count(is_inside.begin(), is_inside.end(), false));
  return ImaginedPoints{num_outside == 0 ? std::move(seen) : KeepPoints(seen, is_inside), num_outside};
}

Finding FindingOf(const std::vector<WeakDirection>& directions) {
  const auto grade_of = [](const WeakDirection& direction) {
    return direction.sigma > direction.doubtful ? Grade::kDoubtful : Grade::kGood;
  };
  Finding finding{Grade::kGood, FindingCode("weak_direction")};
  for (const WeakDirection& direction : directions) {
    const double sigma = direction.sigma / direction.unit_size;
    finding.grade = std::max(finding.grade, grade_of(direction));
    finding.numbers.emplace_back(direction.name + ", " + direction.unit, sigma);
    finding.parts.push_back({grade_of(direction),
                             FindingCode("weak_direction_of"),
                             {{"sigma", sigma}},
                             {{"direction", direction.name}, {"unit", direction.unit}}});
  }
  return finding;
}

Finding SuggestionOf(const CandidateMotion& motion, bool moves_target, const WeakDirection& direction, double sigma) {
  Finding suggested{Grade::kGood, FindingCode("suggested_captures"), motion.numbers};
  suggested.numbers.emplace_back("sigma", sigma / direction.unit_size);
  suggested.names = {{"motion", motion.name},
                     {"moved", moves_target ? "target" : "camera"},
                     {"direction", direction.name},
                     {"unit", direction.unit}};
  return suggested;
}

}  // namespace heba
