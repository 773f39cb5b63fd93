// The arms, tools and bases with which an arm reaches all poses, and how well each explains the captures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/geometry/rigid3.h"
#include "heba/pair_calibration.h"
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

// Returns the other arms of `arms` with as many joints. Those of the same maker come first; the names of arms begin
// with that of their maker.
std::vector<ArmReading> OtherArms(const ArmReading& stated, const std::vector<Arm>& arms);
bool HaveSameMaker(const Arm& a, const Arm& b);
// Returns the tools along the flange's z axis, from -0.4 to 0.4 m in steps of `step_m` without zero.
std::vector<ArmReading> OtherTools(const ArmReading& stated, double step_m);
// Returns bases that are up to 1 m higher or lower, in steps of `step_m`, and the base that hangs upside down.
std::vector<ArmReading> OtherBases(const ArmReading& stated, double step_m);

// Returns the pose of the tip for each pose of the gripper.
std::vector<Rigid3d> TipPoses(const ArmReading& reading, const std::vector<Rigid3d>& base_from_gripper);

// Returns the readings under which the arm reaches all poses, in one configuration if its configurations have names.
// `hard_first`: the order in which poses are tried.
std::vector<ArmReading> Reaching(const std::vector<ArmReading>& readings, const std::vector<Rigid3d>& base_from_gripper,
                                 const std::vector<size_t>& hard_first, int num_threads);

// A reading in one configuration, and how well it explains the captures.
struct FittedReading {
  ArmReading reading;
  ArmBranch branch;
  EffectsFit fit;
};

// Fits the errors of the arm to a calibration that was made without them, once for each reading in each configuration,
// in those of `only` if it is not empty, or with the joints next to joints_near. Those that cannot be fitted are left
// out. `base_from_gripper`: one pose per capture of the data set.
std::vector<FittedReading> FitReadings(const PairCalibration& calibration, const PairCalibrationOptions& options,
                                       const std::vector<ArmReading>& readings,
                                       const std::vector<Rigid3d>& base_from_gripper,
                                       const std::vector<std::string>& only, int num_threads);

}  // namespace heba
