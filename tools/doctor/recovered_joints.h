// The arms, tools and bases with which an arm reaches all poses, and how well each explains the captures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/calibration.h"
#include "heba/geometry/rigid3.h"
#include "heba/robot/arm.h"
#include "solvers/calibration/model_choice.h"
#include "tools/run/arm_setup.h"

namespace heba {

// One way in which poses may be those of an arm whose joints are not recorded.
struct ArmReading {
  enum class Mistake { kNone, kArm, kTool, kBase };
  Mistake mistake = Mistake::kNone;  // The one that leads from this reading to the config's.
  Arm arm;
  Rigid3d tip_from_gripper;
  Rigid3d arm_base_from_base;  // The base of the poses in that of the arm.
  double length_m = 0;         // The length of another tool, or the height of another base.
  // Joints of each capture that may be near those of this reading; may be empty.
  std::vector<Eigen::VectorXd> joints_near = {};
};

// Returns the other arms of `arms` with as many joints.
std::vector<ArmReading> OtherArms(const ArmReading& stated, const std::vector<Arm>& arms);
// Returns the tools along the flange's z axis, from -0.4 to 0.4 m in steps of `step_m` without zero.
std::vector<ArmReading> OtherTools(const ArmReading& stated, double step_m);
// Returns bases that are up to 1 m higher or lower, in steps of `step_m`, and the base that hangs upside down.
std::vector<ArmReading> OtherBases(const ArmReading& stated, double step_m);

// Returns the pose of the tip for each pose of the gripper.
std::vector<Rigid3d> TipPoses(const ArmReading& reading, const std::vector<Rigid3d>& base_from_gripper);

// Returns the readings under which the arm reaches all poses. `hard_first`: the order in which poses are tried.
std::vector<ArmReading> Reaching(const std::vector<ArmReading>& readings, const std::vector<Rigid3d>& base_from_gripper,
                                 const std::vector<size_t>& hard_first, int num_threads);

// A reading with the configuration that explains the captures best, and how well.
struct FittedReading {
  ArmReading reading;
  ArmBranch branch;
  EffectsFit fit;
};

// Fits the errors of the arm to a calibration that was made without them, once for each reading in each configuration,
// in that of `only` if it is not empty, or with the joints next to joints_near. Readings that cannot be fitted are left
// out. `base_from_gripper`: one pose per capture of the data set.
std::vector<FittedReading> FitReadings(const Calibration& calibration, const CalibrationOptions& options,
                                       const std::vector<ArmReading>& readings,
                                       const std::vector<Rigid3d>& base_from_gripper, const std::string& only,
                                       int num_threads);

}  // namespace heba
