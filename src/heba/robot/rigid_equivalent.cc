#include "heba/robot/rigid_equivalent.h"

#include <cmath>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"

namespace heba {
namespace {

// The differences that count as much as a change of a parameter by the prior deviation of its group does. They are so
// small that the prior decides only what the poses hardly show.
constexpr double kUnitM = 1e-6;
constexpr double kUnitRad = 2e-6;

}  // namespace

RigidEquivalent FitRigidEquivalent(const Arm& nominal, const Eigen::VectorXd& errors,
                                   const std::vector<Eigen::VectorXd>& joints) {
  CHECK(!joints.empty());
  const SharedEffects geometry = ArmErrors(nominal, ArmErrorModel::kGeometry);
  const Arm yielding = WithChanges(nominal, errors);
  Tangent6 weights;
  weights << Eigen::Vector3d::Constant(1 / kUnitM), Eigen::Vector3d::Constant(1 / kUnitRad);
  Eigen::VectorXd precisions(geometry.size());
  for (Eigen::Index i = 0; i < geometry.size(); ++i) {
    const double sigma = geometry.groups[geometry.effects[static_cast<size_t>(i)].group].sigma;
    precisions[i] = 1 / (sigma * sigma);
  }

  RigidEquivalent rigid;
  rigid.errors = errors;
  for (int j = 0; j < nominal.num_joints(); ++j) rigid.errors[ArmParamPlace(j, ArmParam::kCompliance)] = 0;
  Eigen::VectorXd change = Eigen::VectorXd::Zero(geometry.size());
  const Eigen::VectorXd start = rigid.errors;
  // Compliances turn joints by a thousandth of a radian, so that the second step changes the tip by nanometres.
  constexpr int kNumSteps = 3;
  for (int step = 0; step <= kNumSteps; ++step) {
    const Arm arm = WithChanges(nominal, rigid.errors);
    Eigen::MatrixXd information = precisions.asDiagonal();
    Eigen::VectorXd gradient = precisions.cwiseProduct(-change);
    double squares_m = 0;
    double squares_rad = 0;
    for (const Eigen::VectorXd& positions : joints) {
      Matrix6X by_params;
      const Rigid3d base_from_tip = BaseFromTip(arm, positions, nullptr, &by_params);
      // The torques of gravity are those of the nominal arm, in both.
      const Tangent6 missing = LocalCoordinates(base_from_tip, BaseFromTip(yielding, positions));
      squares_m += missing.head<3>().squaredNorm();
      squares_rad += missing.tail<3>().squaredNorm();
      Matrix6X by_effects(6, geometry.size());
      for (Eigen::Index i = 0; i < geometry.size(); ++i) {
        by_effects.col(i) = weights.cwiseProduct(by_params.col(geometry.effects[static_cast<size_t>(i)].index));
      }
      information += by_effects.transpose() * by_effects;
      gradient += by_effects.transpose() * weights.cwiseProduct(missing);
    }
    rigid.left_m = std::sqrt(squares_m / static_cast<double>(joints.size()));
    rigid.left_rad = std::sqrt(squares_rad / static_cast<double>(joints.size()));
    if (step == kNumSteps) break;
    change += SolveSymmetric(information, gradient);
    rigid.errors = start;
    for (Eigen::Index i = 0; i < geometry.size(); ++i) {
      rigid.errors[geometry.effects[static_cast<size_t>(i)].index] += change[i];
    }
  }
  return rigid;
}

}  // namespace heba
