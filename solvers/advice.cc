#include "solvers/advice.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Eigenvalues>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/prediction.h"
#include "solvers/robot_noise.h"
#include "solvers/variance_components.h"

namespace heba {
namespace {

// A direction of the unknowns that is known worse than it should be.
struct Weakness {
  std::string name;
  Eigen::VectorXd direction;  // Of unit length, in the unknowns.
  double sigma = 0;
  double wanted = 0;
  std::string unit;
  double unit_size = 1;  // Of `unit`, in the unknowns' unit.
};

std::string AxisName(const Eigen::Vector3d& direction, const Eigen::Matrix3d& parent_from_child,
                     const std::string& parent, const std::string& child) {
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
  return "the " + (by_child ? child : parent) + "'s " + std::string(1, "xyz"[by_child ? child_axis : parent_axis]);
}

// The worst direction within three unknowns.
Weakness WorstOf(const Eigen::MatrixXd& covariance, Eigen::Index first, const std::string& what,
                 const Eigen::Matrix3d& parent_from_child, const std::string& parent, const std::string& child) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance.block<3, 3>(first, first));
  Weakness weakness;
  weakness.direction = Eigen::VectorXd::Zero(covariance.rows());
  weakness.direction.segment<3>(first) = eigen.eigenvectors().col(2);
  weakness.sigma = std::sqrt(std::max(0.0, eigen.eigenvalues()[2]));
  weakness.name = what + AxisName(eigen.eigenvectors().col(2), parent_from_child, parent, child);
  return weakness;
}

std::vector<Weakness> FindWeaknesses(const Problem& problem, const Solution& solution,
                                     const std::vector<std::string>& names, const Eigen::MatrixXd& covariance) {
  constexpr double kWantedM = 1e-3;
  const double wanted_rad = DegToRad(0.1);
  constexpr double kWantedRatio = 0.002;
  const std::string camera_mount(CameraMountName(problem.setup));
  const std::string target_mount(TargetMountName(problem.setup));
  const Eigen::Matrix3d r_x = solution.hand_eye.camera_mount_from_camera.RotationMatrix();
  const Eigen::Matrix3d r_z = solution.hand_eye.target_mount_from_target.RotationMatrix();
  std::vector<Weakness> weaknesses = {
      WorstOf(covariance, 0, "the camera's position along ", r_x, camera_mount, "camera"),
      WorstOf(covariance, 3, "the camera's orientation about ", r_x, camera_mount, "camera"),
      WorstOf(covariance, 6, "the board's position along ", r_z, target_mount, "target"),
      WorstOf(covariance, 9, "the board's orientation about ", r_z, target_mount, "target")};
  for (size_t i = 0; i < weaknesses.size(); ++i) {
    const bool is_position = i % 2 == 0;
    weaknesses[i].wanted = is_position ? kWantedM : wanted_rad;
    weaknesses[i].unit = is_position ? "mm" : "deg";
    weaknesses[i].unit_size = is_position ? 1e-3 : DegToRad(1.0);
  }
  for (size_t i = 12; i < names.size(); ++i) {
    const std::string part = names[i].substr(names[i].find('.') + 1);
    const bool is_focal = part == "fx" || part == "fy";
    if (!is_focal && part != "cx" && part != "cy") continue;
    const Eigen::Index k = static_cast<Eigen::Index>(i);
    Weakness weakness;
    weakness.name = std::string("the camera's ") + part;
    weakness.direction = Eigen::VectorXd::Unit(covariance.rows(), k);
    weakness.sigma = std::sqrt(covariance(k, k));
    weakness.wanted = kWantedRatio * (is_focal ? solution.camera.params[0] : solution.camera.width_px);
    weakness.unit = "px";
    weaknesses.push_back(std::move(weakness));
  }
  weaknesses.erase(std::remove_if(weaknesses.begin(), weaknesses.end(),
                                  [](const Weakness& weakness) { return weakness.sigma <= weakness.wanted; }),
                   weaknesses.end());
  std::sort(weaknesses.begin(), weaknesses.end(),
            [](const Weakness& a, const Weakness& b) { return a.sigma / a.wanted > b.sigma / b.wanted; });
  return weaknesses;
}

// Two further captures, in words and as what they would add.
struct Cure {
  std::string words;
  std::vector<LinearView> views;
};

// A view of all that any capture saw, if it is in the picture from there.
std::optional<View> ImaginedView(const Problem& problem, const Solution& solution, const Observations& points,
                                 const Rigid3d& camera_from_target) {
  View view;
  view.camera_mount_from_target_mount = solution.hand_eye.camera_mount_from_camera * camera_from_target *
                                        Inverse(solution.hand_eye.target_mount_from_target);
  view.observations = points;
  view.observations.covariances_px2.clear();
  view.observations.whitening.clear();
  if (!Predict(solution.camera.Model(), solution.camera.params.data(), camera_from_target, points,
               &view.observations.pixels, nullptr)) {
    return std::nullopt;
  }
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d pixel = view.observations.pixels.col(i);
    if ((pixel.array() < 0).any() || pixel.x() > problem.camera.width_px || pixel.y() > problem.camera.height_px) {
      return std::nullopt;
    }
  }
  return view;
}

std::vector<Cure> FindCures(const Problem& problem, const Solution& solution, const FreeParameters& free) {
  const View& fullest = *std::max_element(problem.views.begin(), problem.views.end(), [](const View& a, const View& b) {
    return a.observations.size() < b.observations.size();
  });
  const Observations& points = fullest.observations;
  std::vector<Rigid3d> poses;
  for (const View& view : problem.views) {
    poses.push_back(CameraFromTarget(solution.hand_eye, view.camera_mount_from_target_mount));
  }
  const Rigid3d mean = MeanPose(poses);
  const Eigen::Vector3d middle = points.points_in_target.rowwise().mean();
  // Moves about the middle of the points, as the camera sees it.
  const auto turned = [&](const Eigen::Vector3d& axis_in_target, double angle_rad) {
    const Rigid3d about(ExpRotation(angle_rad * axis_in_target), Eigen::Vector3d::Zero());
    return mean * Rigid3d(Eigen::Quaterniond::Identity(), middle) * about *
           Rigid3d(Eigen::Quaterniond::Identity(), -middle);
  };
  const auto moved = [&](const Eigen::Vector3d& by_m) { return Rigid3d(mean.rotation, mean.translation + by_m); };
  const double depth_m = (mean * middle).z();
  const double side_m = 0.25 * depth_m * problem.camera.width_px / solution.camera.params[0];
  const bool carries_board = problem.setup == Setup::kEyeToHand;
  const std::string tilt = carries_board ? "with the board tilted" : "with the camera tilted against the board";
  const std::string turn = carries_board ? "with the board turned" : "with the camera turned";
  struct Motion {
    std::string words;
    std::function<Rigid3d(double)> pose;  // For +1 and -1.
  };
  const double tilt_rad = DegToRad(25.0);
  const double turn_rad = DegToRad(45.0);
  const std::vector<Motion> motions = {
      {"two captures " + tilt + " by 25 deg to and fro about the board's x",
       [&](double side) { return turned(Eigen::Vector3d::UnitX(), side * tilt_rad); }},
      {"two captures " + tilt + " by 25 deg to and fro about the board's y",
       [&](double side) { return turned(Eigen::Vector3d::UnitY(), side * tilt_rad); }},
      {"two captures " + turn + " by 45 deg to and fro in the board's plane",
       [&](double side) { return turned(Eigen::Vector3d::UnitZ(), side * turn_rad); }},
      {"two captures from " + Fixed(250 * depth_m, 0) + " mm nearer and farther",
       [&](double side) { return moved(0.25 * side * depth_m * (mean * middle).normalized()); }},
      {"two captures with the board at the left and right of the picture",
       [&](double side) {
         return moved({side * side_m, 0, 0});
       }},
      {"two captures with the board at the top and bottom of the picture",
       [&](double side) {
         return moved({0, side * side_m, 0});
       }},
  };
  std::vector<Cure> cures;
  for (const Motion& motion : motions) {
    Problem imagined{solution.camera, {}, problem.setup, solution.shape};
    for (const double side : {1.0, -1.0}) {
      std::optional<View> view = ImaginedView(problem, solution, points, motion.pose(side));
      if (view) imagined.views.push_back(std::move(*view));
    }
    if (imagined.views.size() < 2) continue;
    std::optional<std::vector<LinearView>> views =
        LineariseViews(imagined, solution.hand_eye, {}, free, solution.pixel_sigma_px, *FindLoss("none"));
    if (views) cures.push_back({motion.words, std::move(*views)});
  }
  return cures;
}

// The pixels' noise, in the views' unit, and the robot's, as the captures have them.
VarianceComponents FindNoise(const std::vector<LinearView>& views) {
  VarianceComponents start;
  start.translation_m2 = 1e-8;
  start.rotation_rad2 = 1e-8;
  return EstimateVariances(views, start, true, true);
}

}  // namespace

std::vector<std::string> AdviseOnCaptures(const Problem& problem, const Solution& solution,
                                          const FreeParameters& free) {
  const std::vector<std::string> names = UnknownNames(solution.camera.Model(), free);
  const std::vector<Weakness> weaknesses = FindWeaknesses(problem, solution, names, solution.covariance.matrix);
  if (weaknesses.empty()) return {};
  std::vector<std::string> advice;
  const std::vector<Cure> cures = FindCures(problem, solution, free);
  const RobotNoise robot = solution.robot_noise.value_or(RobotNoise{});
  const Eigen::MatrixXd information =
      InvertInformation({names, solution.covariance.matrix}, 1.0).matrix;  // The covariance's inverse.
  for (const Weakness& weakness : weaknesses) {
    double best_sigma = std::numeric_limits<double>::infinity();
    std::string best_words;
    for (const Cure& cure : cures) {
      const Information with{names, information + MarginalInformation(cure.views, robot, 1.0)};
      const Eigen::MatrixXd covariance = InvertInformation(with, 1.0).matrix;
      const double sigma = std::sqrt(weakness.direction.dot(covariance * weakness.direction));
      if (sigma >= best_sigma) continue;
      best_sigma = sigma;
      best_words = cure.words;
    }
    std::string sentence = weakness.name + " is known to " + Significant(weakness.sigma / weakness.unit_size, 2) + " " +
                           weakness.unit + " only (one sigma)";
    constexpr double kHelps = 0.85;
    if (best_sigma < kHelps * weakness.sigma) {
      sentence +=
          "; " + best_words + " would make it " + Significant(best_sigma / weakness.unit_size, 2) + " " + weakness.unit;
    } else {
      sentence += "; no two captures would better it much, many would";
    }
    advice.push_back(std::move(sentence));
  }
  return advice;
}

std::string AdviseOnRobot(const Problem& problem, const Solution& solution, const FreeParameters& free) {
  constexpr size_t kMinCaptures = 6;
  if (problem.views.size() < kMinCaptures) return "";
  const std::optional<std::vector<LinearView>> views = LineariseViewsAt(problem, solution, {}, free, *FindLoss("none"));
  if (!views) return "";
  const VarianceComponents found = FindNoise(*views);
  double by_robot = 0;
  double by_pixels = 0;
  for (const LinearView& view : *views) {
    by_robot += found.translation_m2 * view.by_correction.leftCols<3>().squaredNorm() +
                found.rotation_rad2 * view.by_correction.rightCols<3>().squaredNorm();
    by_pixels += found.pixel * static_cast<double>(view.offset.size() + view.num_rest);
  }
  if (by_robot <= by_pixels) return "";
  return "the captures speak of a robot whose poses are off by " +
         Significant(1000 * std::sqrt(found.translation_m2), 2) + " mm and " +
         Significant(RadToDeg(std::sqrt(found.rotation_rad2)), 2) +
         " deg (one sigma an axis), but were taken as exact: the uncertainty stated is too small; use "
         "refine.robot_noise: auto";
}

TargetAdvice AdviseOnTarget(const Problem& problem, const Solution& solution, const FreeParameters& free) {
  constexpr size_t kMinCaptures = 6;
  const CameraModel& model = problem.camera.Model();
  if (HasShape(free, model) || problem.views.size() < kMinCaptures) return {"", free};
  // All of the shape; where the captures do not show that, what they do.
  const std::vector<std::vector<TargetShapeGroup>> sought = {
      {TargetShapeGroup::kScale, TargetShapeGroup::kBend}, {TargetShapeGroup::kScale}, {TargetShapeGroup::kBend}};
  for (const std::vector<TargetShapeGroup>& groups : sought) {
    FreeParameters with_shape = FreeOf(model, {}, groups);
    std::copy(free.begin(), free.end(), with_shape.begin());
    const std::optional<std::vector<LinearView>> views =
        LineariseViewsAt(problem, solution, {}, with_shape, *FindLoss("none"));
    if (!views) return {"", free};
    const VarianceComponents noise = FindNoise(*views);
    const RobotNoise robot{std::sqrt(noise.translation_m2), std::sqrt(noise.rotation_rad2)};
    const Information information{UnknownNames(model, with_shape), MarginalInformation(*views, robot, noise.pixel)};
    if (CheckObservable(information)) continue;
    const Eigen::MatrixXd covariance = InvertInformation(information, 1.0).matrix;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(covariance.rows());
    for (const LinearView& view : *views) {
      right +=
          view.by_unknowns.transpose() *
          MarginalCovariance(view, noise.pixel, noise.translation_m2, noise.rotation_rad2).ldlt().solve(view.offset);
    }
    const Eigen::VectorXd step = covariance * right;
    const Eigen::Index size = 2 * static_cast<Eigen::Index>(groups.size());
    const Eigen::VectorXd found = step.tail(size);
    const double statistic = found.dot(covariance.bottomRightCorner(size, size).ldlt().solve(found));
    const double tail =
        FisherTail(statistic / static_cast<double>(size), static_cast<double>(size), DegreesOfFreedom(*views, noise));
    constexpr double kBeyondDoubt = 1e-4;
    constexpr double kMatters[] = {3e-4, 1e-4};  // Of the scale; of a bend, m.
    std::vector<std::string> words;
    std::vector<std::string> names;
    bool matters = false;
    for (size_t g = 0; g < groups.size(); ++g) {
      const bool is_scale = groups[g] == TargetShapeGroup::kScale;
      const Eigen::Vector2d value = found.segment<2>(2 * static_cast<Eigen::Index>(g));
      names.emplace_back(kTargetShapeGroupNames[static_cast<size_t>(groups[g])]);
      matters = matters || value.cwiseAbs().maxCoeff() > kMatters[is_scale ? 0 : 1];
      words.push_back(is_scale ? "its scale is " + Fixed(1 + value.x(), 5) + " along x and " + Fixed(1 + value.y(), 5) +
                                     " along y"
                               : "its middle stands " + Fixed(1000 * value.x(), 2) + " mm (along x) and " +
                                     Fixed(1000 * value.y(), 2) + " mm (along y) above its edges");
    }
    if (!(tail < kBeyondDoubt) || !matters) return {"", free};
    return {"the captures speak of a target that is not as designed: " + Join(words, ", ") +
                "; measure it, or use refine.target_shape: [" + Join(names, ", ") + "]" +
                (std::find(free.begin(), free.end(), true) == free.end()
                     ? " (a focal length that is held at a wrong value looks like a wrong scale)"
                     : ""),
            with_shape};
  }
  return {"", free};
}

}  // namespace heba
