#include "heba/data/smooth_errors.h"

#include <cmath>
#include <string>

#include "heba/base/error.h"
#include "heba/base/units.h"

namespace heba {
namespace {

constexpr size_t kMostColumns = 24;
// The basis is complete if the part of the variance that it lacks is below this share at every pose.
constexpr double kLacking = 0.01;

// The standard deviations with which the estimation of the groups' own ones starts.
constexpr double kTranslationStartM = 1e-3;
constexpr double kRotationStartRad = 2e-3;
// The scales of their half-Cauchy priors: three times what industrial arms have at most.
constexpr double kPriorM = 3e-3;
constexpr double kPriorRad = DegToRad(0.3);

double CovarianceOf(const Rigid3d& a, const Rigid3d& b, const SmoothLengths& lengths) {
  const double translation = (a.translation - b.translation).norm() / lengths.translation_m;
  const double rotation = (a.RotationMatrix() - b.RotationMatrix()).norm() / (std::sqrt(2.0) * lengths.rotation_rad);
  return std::exp(-0.5 * (translation * translation + rotation * rotation));
}

SharedEffects EffectsOf(size_t num_functions) {
  SharedEffects effects;
  effects.name = "smooth errors of the poses";
  effects.kind = SharedEffectsKind::kSmooth;
  effects.num_fitted = 2;  // The lengths.
  effects.groups = {{"smooth translations", "m", kTranslationStartM, 0, 0, kPriorM},
                    {"smooth rotations", "rad", kRotationStartRad, 0, 0, kPriorRad}};
  for (const size_t group : {size_t{0}, size_t{1}}) {
    for (size_t k = 0; k < num_functions; ++k) {
      for (const char* const axis : {"x", "y", "z"}) {
        const std::string name =
            std::string(group == 0 ? "translation" : "rotation") + std::to_string(k + 1) + "." + axis;
        effects.effects.push_back({name, effects.num_all++, group});
      }
    }
  }
  return effects;
}

}  // namespace

SmoothErrors::SmoothErrors(const std::vector<Rigid3d>& base_from_gripper, const SmoothLengths& lengths)
    : lengths_(lengths) {
  CHECK(!base_from_gripper.empty());
  const auto num_poses = static_cast<Eigen::Index>(base_from_gripper.size());
  Eigen::VectorXd lacking = Eigen::VectorXd::Ones(num_poses);
  Eigen::MatrixXd columns(num_poses, 0);
  std::vector<Eigen::Index> places;
  while (places.size() < kMostColumns) {
    Eigen::Index place = 0;
    const double most = lacking.maxCoeff(&place);
    if (most < kLacking) break;
    const Rigid3d& pivot = base_from_gripper[static_cast<size_t>(place)];
    Eigen::VectorXd column(num_poses);
    for (Eigen::Index i = 0; i < num_poses; ++i) {
      column[i] = CovarianceOf(base_from_gripper[static_cast<size_t>(i)], pivot, lengths);
    }
    column -= columns * columns.row(place).transpose();
    column /= std::sqrt(most);
    lacking -= column.cwiseAbs2();
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols<1>() = column;
    places.push_back(place);
    pivots_.push_back(pivot);
  }
  root_ = Eigen::MatrixXd(columns(places, Eigen::all)).triangularView<Eigen::Lower>();
  effects_ = EffectsOf(places.size());
}

void SmoothErrors::SetSigmas(const std::vector<double>& sigmas) {
  CHECK_EQ(sigmas.size(), effects_.groups.size());
  for (size_t g = 0; g < sigmas.size(); ++g) effects_.groups[g].sigma = sigmas[g];
}

Eigen::VectorXd SmoothErrors::BasisAt(const Rigid3d& base_from_gripper) const {
  Eigen::VectorXd covariances(root_.rows());
  for (Eigen::Index k = 0; k < covariances.size(); ++k) {
    covariances[k] = CovarianceOf(base_from_gripper, pivots_[static_cast<size_t>(k)], lengths_);
  }
  return root_.triangularView<Eigen::Lower>().solve(covariances);
}

Matrix6X SmoothErrors::GripperByEffects(const Rigid3d& base_from_gripper) const {
  const Eigen::Matrix3d gripper_from_base = base_from_gripper.RotationMatrix().transpose();
  const Eigen::VectorXd basis = BasisAt(base_from_gripper);
  Matrix6X by_effects = Matrix6X::Zero(6, effects_.size());
  for (Eigen::Index k = 0; k < basis.size(); ++k) {
    by_effects.block<3, 3>(0, 3 * k) = basis[k] * gripper_from_base;
    by_effects.block<3, 3>(3, 3 * (basis.size() + k)) = basis[k] * gripper_from_base;
  }
  return by_effects;
}

std::shared_ptr<const PoseEffect> SmoothErrors::EffectAt(const Rigid3d& base_from_gripper) const {
  return MakeLinearEffect(GripperByEffects(base_from_gripper));
}

}  // namespace heba
