// The uncertainty of the estimated kinematics of an arm, at the captures and away from them.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/data/stated_pose.h"
#include "heba/evaluation/evaluation.h"
#include "heba/robot/arm_postures.h"

namespace heba {

// Returns a pose of the gripper that the controller states (base_from_gripper) with the effects of the arm's errors and
// of the noise of its joints at these joints (rad or m).
StatedPose WithArmErrors(const RobotSummary& robot, const Rigid3d& stated, const Eigen::VectorXd& joints);
// Likewise with the joints of the configuration of the captures. Returns a Failure as TruePose does
// (heba/evaluation/pose_correction.h).
Outcome<StatedPose> WithArmErrors(const RobotSummary& robot, const Rigid3d& stated);

// Returns a pose of the gripper that the controller states with the errors that it has: with those of the arm, at
// `joints` if they are given, otherwise at those of the configuration of the captures; with none if `robot` is null,
// because the run has not estimated any. Returns a Failure if joints are given that the arm does not have or that are
// far from the pose, or if they are needed.
Outcome<StatedPose> WithErrorsOfArm(const RobotSummary* robot, const Rigid3d& stated,
                                    const std::optional<Eigen::VectorXd>& joints);

// Returns the estimated errors of an arm that are larger than arms have, each as "joint2.a +5.2 mm": another arm, or
// errors that are none of its geometry.
std::vector<std::string> ImplausibleErrors(const RobotSummary& robot);

// The true pose of the gripper according to a calibration, and the covariance of its position relative to something
// that is fixed, along the axes of the base of the first arm, m^2: by the calibration, that is by the errors of the arm
// and of the poses of bases and of what is fixed.
struct LocatedGripper {
  Rigid3d base_from_gripper;
  Eigen::Matrix3d covariance_m2;
};
// Locates the gripper at a pose that the controller states.
using GripperLocator = std::function<LocatedGripper(const StatedPose&)>;
// Returns the locator of the arm of a single camera, relative to what is fixed: the camera, or the target of the
// captures. The solution must outlive it.
GripperLocator LocatorOf(Setup setup, const PairSolution& solution);

// A part of a rig that no arm moves.
struct FixedPart {
  enum class Kind { kCamera, kTarget };
  Kind kind = Kind::kCamera;
  size_t index = 0;

  std::string Name(const Problem& rig) const;  // In words: "camera left".
};
// Returns the first fixed camera or, if no camera is fixed, the first fixed target; nothing if all are carried.
std::optional<FixedPart> FindFixedPart(const Problem& rig);
// Returns the locator of one arm of a rig, relative to a fixed part. Problem and solution must outlive it.
GripperLocator LocatorOf(const Problem& rig, const Solution& solution, size_t robot, const FixedPart& fixed);

// Returns one sigma of a coordinate, root mean square over the three.
double SigmaM(const Eigen::Matrix3d& covariance_m2);

// The names of the signs of a Configuration.
inline constexpr std::array<const char*, 3> kFlipNames = {"shoulder", "elbow", "wrist"};

// Sigmas of the gripper's position (LocatedGripper), root mean square over poses of captures.
struct ConfigurationSigmas {
  double captured_m = 0;  // In the configuration of the captures.
  // With only the shoulder, the elbow or the wrist flipped; nothing if the arm reaches no pose with it.
  std::array<std::optional<double>, 3> flipped_m;
  std::optional<double> others_m;  // In all other configurations.
};
// Returns nothing if the captures are in several configurations or if theirs has no name.
std::optional<ConfigurationSigmas> SigmasByConfiguration(const GripperLocator& locate, const RobotSummary& robot,
                                                         const std::vector<Rigid3d>& base_from_gripper);

// The correction of the arm and its uncertainty on a grid of positions of the gripper, in the mean orientation of the
// captures and in one configuration.
struct ArmMap {
  static constexpr int kMostCells = 20;  // Along either axis.
  struct Cell {
    Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
    double correction_m = 0;  // Distance between the stated and the true position.
    double sigma_m = 0;       // One sigma of the position (LocatedGripper).
  };
  int vertical_axis = 1;                             // The axis of the rows: 1 for the base's y, 2 for its z.
  Eigen::Vector3d mean_m = Eigen::Vector3d::Zero();  // The slice is through this position.
  double step_m = 0;                                 // Size of a cell.
  std::vector<Cell> cells;                           // The cells in reach.
  std::string configuration;                         // Empty if it has no name.
  std::vector<Eigen::Vector3d> captures_m;           // The positions of the gripper in the captures.
};
// Returns the map of the base's x and `vertical_axis`, through the mean position of the captures, with at most
// kMostCells x kMostCells cells; nothing if the arm does not reach the mean pose, or a pose does not determine its
// joints.
std::optional<ArmMap> MapArm(const GripperLocator& locate, const RobotSummary& robot,
                             const std::vector<Rigid3d>& base_from_gripper, int vertical_axis);

}  // namespace heba
