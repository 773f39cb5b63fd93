#include "heba/robot/arm_errors.h"

#include <algorithm>
#include <utility>

#include "heba/base/rng.h"
#include "heba/base/units.h"

namespace heba {
namespace {

class ArmEffect final : public PoseEffect {
 public:
  ArmEffect(Arm nominal, Eigen::VectorXd joints, const Rigid3d& tip_from_gripper)
      : nominal_(std::move(nominal)),
        joints_(std::move(joints)),
        tip_from_gripper_(tip_from_gripper),
        gripper_from_base_(Inverse(BaseFromTip(nominal_, joints_) * tip_from_gripper)),
        gripper_from_tip_(Adjoint(Inverse(tip_from_gripper))),
        torques_(GravityTorques(nominal_, joints_)) {}

  Rigid3d Evaluate(const Eigen::VectorXd& effects, Matrix6X* tangent_from_effects) const override {
    Matrix6X by_params;
    const Rigid3d base_from_tip = BaseFromTip(WithChanges(nominal_, effects), joints_, torques_, nullptr,
                                              tangent_from_effects == nullptr ? nullptr : &by_params);
    if (tangent_from_effects != nullptr) *tangent_from_effects = gripper_from_tip_ * by_params;
    return gripper_from_base_ * base_from_tip * tip_from_gripper_;
  }

 private:
  Arm nominal_;
  Eigen::VectorXd joints_;
  Rigid3d tip_from_gripper_;
  Rigid3d gripper_from_base_;
  Eigen::Matrix<double, 6, 6> gripper_from_tip_;
  Eigen::VectorXd torques_;
};

// Returns, for each joint, the first joint of the run of parallel axes to which its axis belongs.
std::vector<int> FirstOfParallels(const Arm& arm) {
  std::vector<int> first;
  for (int j = 0; j < arm.num_joints(); ++j) {
    first.push_back(j > 0 && IsParallelToNext(arm, j - 1) ? first.back() : j);
  }
  return first;
}

}  // namespace

std::shared_ptr<const PoseEffect> MakeArmEffect(const Arm& nominal, const Eigen::VectorXd& joints,
                                                const Rigid3d& tip_from_gripper) {
  return std::make_shared<ArmEffect>(nominal, joints, tip_from_gripper);
}

Matrix6X GripperByJoints(const Arm& arm, const Eigen::VectorXd& joints, const Rigid3d& tip_from_gripper) {
  Matrix6X by_joints;
  BaseFromTip(arm, joints, &by_joints);
  return Adjoint(Inverse(tip_from_gripper)) * by_joints;
}

std::vector<UndeterminedParam> UndeterminedParams(const Arm& arm, Setup setup) {
  const bool is_camera_in_base = setup == Setup::kEyeToHand;
  return UndeterminedParams(arm, is_camera_in_base ? "the hand-eye pose" : "the board's pose",
                            is_camera_in_base ? "the board's pose" : "the hand-eye pose");
}

std::vector<UndeterminedParam> UndeterminedParams(const Arm& arm, const std::string& in_base,
                                                  const std::string& on_flange) {
  const int last = arm.num_joints() - 1;
  const std::vector<int> first_of = FirstOfParallels(arm);
  std::vector<UndeterminedParam> undetermined;
  for (int j = 0; j <= last; ++j) {
    for (const ArmParam param : {ArmParam::kTheta, ArmParam::kD, ArmParam::kA, ArmParam::kAlpha}) {
      const int place = ArmParamPlace(j, param);
      const int first = first_of[static_cast<size_t>(j)];
      const bool is_of_base = (j == 0 && param == ArmParam::kTheta) || (first == 0 && param == ArmParam::kD);
      if (j == last || (param == ArmParam::kD && first_of.back() == first && first != 0)) {
        undetermined.push_back({place, on_flange});
      } else if (is_of_base) {
        undetermined.push_back({place, in_base});
      } else if (param == ArmParam::kD && first != j) {
        undetermined.push_back({place, ArmParamName(ArmParamPlace(first, ArmParam::kD))});
      }
    }
  }
  return undetermined;
}

std::vector<bool> JointsThatYield(const Arm& arm) {
  constexpr int kNumDraws = 20;
  constexpr double kLeastShare = 0.05;
  constexpr double kNothingNm = 0.05;  // It would turn a joint by some 1e-6 rad.
  Rng rng(1);
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(arm.num_joints());
  for (int draw = 0; draw < kNumDraws; ++draw) {
    Eigen::VectorXd joints(arm.num_joints());
    for (double& joint : joints) joint = rng.Uniform(-kPi, kPi);
    largest = largest.cwiseMax(GravityTorques(arm, joints).cwiseAbs());
  }
  const double least_nm = std::max(kNothingNm, kLeastShare * largest.maxCoeff());
  std::vector<bool> yields;
  for (int j = 0; j < arm.num_joints(); ++j) {
    yields.push_back(arm.joints[static_cast<size_t>(j)].is_turning && largest[j] > least_nm);
  }
  return yields;
}

SharedEffects ArmErrors(const Arm& arm, ArmErrorModel model) {
  const bool has_gravity = model == ArmErrorModel::kGravity;
  const bool has_geometry = model == ArmErrorModel::kGeometry || has_gravity;
  CHECK(!has_gravity || arm.load != nullptr);
  SharedEffects errors;
  errors.name = has_gravity    ? "joint offsets, geometry and compliance"
                : has_geometry ? "joint offsets and geometry"
                               : "joint offsets";
  errors.num_all = arm.num_params();
  enum Group : size_t { kOffsets, kLengths, kAngles, kCompliances };
  errors.groups = {{"offsets", "rad", DegToRad(kOffsetPriorDeg)}};
  if (has_geometry) {
    errors.groups.push_back({"lengths", "m", kLengthPriorM, kLeastLengthM, kMostLengthM});
    errors.groups.push_back(
        {"angles", "rad", DegToRad(kAnglePriorDeg), DegToRad(kLeastAngleDeg), DegToRad(kMostAngleDeg)});
  }
  if (has_gravity) errors.groups.push_back({"compliances", "rad/(N m)", kCompliancePriorRadPerNm});
  const std::vector<bool> yields = JointsThatYield(arm);
  const std::vector<UndeterminedParam> undetermined = UndeterminedParams(arm, Setup::kEyeToHand);
  for (int place = 0; place < arm.num_params(); ++place) {
    const int joint = place / kNumArmParams;
    const ArmParam param = ParamAt(place);
    if (param == ArmParam::kCompliance) {
      if (has_gravity && yields[static_cast<size_t>(joint)]) {
        errors.effects.push_back({ArmParamName(place), place, kCompliances});
      }
      continue;
    }
    // The zero of a sliding joint is its d.
    const bool is_turning = arm.joints[static_cast<size_t>(joint)].is_turning;
    const bool is_offset = param == (is_turning ? ArmParam::kTheta : ArmParam::kD);
    const bool is_known = std::any_of(undetermined.begin(), undetermined.end(),
                                      [&](const UndeterminedParam& other) { return other.place == place; });
    if (is_known || (!is_offset && !has_geometry)) continue;
    if (param == ArmParam::kBeta && !IsParallelToNext(arm, joint)) continue;
    const size_t group = param == ArmParam::kTheta ? kOffsets : ArmParamUnit(arm, place) == "rad" ? kAngles : kLengths;
    if (group >= errors.groups.size()) continue;
    errors.effects.push_back({ArmParamName(place), place, group});
  }
  return errors;
}

}  // namespace heba
