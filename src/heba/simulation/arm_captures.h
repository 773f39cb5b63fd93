// Simulates the captures of an arm whose kinematics are not those that its controller assumes.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/camera/camera.h"
#include "heba/data/pair_problem.h"
#include "heba/robot/arm.h"
#include "heba/simulation/scene.h"

namespace heba {

struct ArmMotionOptions {
  MotionOptions motion;
  Rigid3d tip_from_gripper;
  // Whether captures are taken in any configuration of the arm, or all in that of the first one.
  bool has_several_configurations = true;
};

// The cell and the positions of the joints that the controller commands.
struct ArmCaptures {
  HandEye hand_eye;
  std::vector<Eigen::VectorXd> joints;
};

// Draws a cell that the arm can reach, and captures in it, with all of `points_in_target` in the image. Returns a
// Failure if no cell was found in which the arm reaches enough of the poses.
Outcome<ArmCaptures> SimulateArmCaptures(Setup setup, const Camera& camera, const Points3& points_in_target, bool z_out,
                                         const Arm& arm, const ArmMotionOptions& options, Rng& rng);

// Returns a posture that reaches the pose, away from singularities, or nothing: in the configuration of `near`, if it
// is given and if the configurations of the arm have names, otherwise in a random one. For an arm without names of
// configurations, `near` must be given, and the posture is near it.
std::optional<Eigen::VectorXd> DrawPosture(const Arm& arm, const Rigid3d& base_from_tip,
                                           const std::optional<Eigen::VectorXd>& near, bool has_several_configurations,
                                           Rng& rng);

// Returns errors of all parameters of an arm that captures can determine, with these standard deviations of offsets,
// lengths, angles and compliances; the others are zero. Compliances are not negative, and zero for joints that carry
// little weight (JointsThatYield).
struct ArmErrorSigmas {
  double offset_rad = 0;
  double length_m = 0;
  double angle_rad = 0;
  double compliance_rad_per_nm = 0;
};
Eigen::VectorXd DrawArmErrors(const Arm& arm, const ArmErrorSigmas& sigmas, Rng& rng);

// The pose of the gripper if the arm has these parameters.
Rigid3d BaseFromGripper(const Arm& arm, const Eigen::VectorXd& joints, const Rigid3d& tip_from_gripper);

}  // namespace heba
