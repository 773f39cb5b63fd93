#include "heba/data/shared_effects.h"

#include <cmath>
#include <utility>

#include "heba/base/error.h"

namespace heba {
namespace {

// exp(G effects): the tangent of the pose turns with its rotation (translation), and by the right Jacobian of the
// rotation vector (rotation).
class LinearEffect final : public PoseEffect {
 public:
  explicit LinearEffect(Matrix6X g) : g_(std::move(g)) {}
  Rigid3d Evaluate(const Eigen::VectorXd& effects, Matrix6X* tangent_from_effects) const override {
    const Tangent6 tangent = g_ * effects;
    const Rigid3d pose = Retract(Rigid3d(), tangent);
    if (tangent_from_effects == nullptr) return pose;
    tangent_from_effects->resize(6, g_.cols());
    tangent_from_effects->topRows<3>() = pose.RotationMatrix().transpose() * g_.topRows<3>();
    const double angle = tangent.tail<3>().norm();
    constexpr double kSmall = 1e-4;
    const double a = angle < kSmall ? 0.5 : (1 - std::cos(angle)) / (angle * angle);
    const double b = angle < kSmall ? 1.0 / 6 : (angle - std::sin(angle)) / (angle * angle * angle);
    const Eigen::Matrix3d skew = Skew(tangent.tail<3>());
    tangent_from_effects->bottomRows<3>() =
        (Eigen::Matrix3d::Identity() - a * skew + b * skew * skew) * g_.bottomRows<3>();
    return pose;
  }

 private:
  Matrix6X g_;
};

class SelectedEffect final : public PoseEffect {
 public:
  SelectedEffect(std::shared_ptr<const PoseEffect> effect, int num_all, const std::vector<int>& indices)
      : effect_(std::move(effect)), num_all_(num_all), indices_(indices.begin(), indices.end()) {}
  Rigid3d Evaluate(const Eigen::VectorXd& effects, Matrix6X* tangent_from_effects) const override {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(num_all_);
    all(indices_) = effects;
    if (tangent_from_effects == nullptr) return effect_->Evaluate(all, nullptr);
    Matrix6X by_all;
    const Rigid3d pose = effect_->Evaluate(all, &by_all);
    *tangent_from_effects = by_all(Eigen::all, indices_);
    return pose;
  }

 private:
  std::shared_ptr<const PoseEffect> effect_;
  Eigen::Index num_all_;
  std::vector<Eigen::Index> indices_;
};

}  // namespace

std::shared_ptr<const PoseEffect> MakeLinearEffect(Matrix6X g) { return std::make_shared<LinearEffect>(std::move(g)); }

std::shared_ptr<const PoseEffect> SelectEffects(std::shared_ptr<const PoseEffect> effect, int num_all,
                                                const std::vector<int>& indices) {
  return std::make_shared<SelectedEffect>(std::move(effect), num_all, indices);
}

std::vector<std::string> SharedEffects::Names() const {
  std::vector<std::string> names;
  for (const SharedEffect& effect : effects) names.push_back(effect.name);
  return names;
}

Eigen::VectorXd AllEffects(const SharedEffects& shared, const Eigen::VectorXd& estimated) {
  CHECK_EQ(shared.size(), estimated.size());
  Eigen::VectorXd all = Eigen::VectorXd::Zero(shared.num_all);
  for (Eigen::Index i = 0; i < estimated.size(); ++i) {
    all[shared.effects[static_cast<size_t>(i)].index] = estimated[i];
  }
  return all;
}

}  // namespace heba
