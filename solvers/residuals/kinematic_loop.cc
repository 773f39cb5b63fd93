#include "solvers/residuals/kinematic_loop.h"

#include <algorithm>
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

}  // namespace

std::shared_ptr<const PoseEffect> MakeLinearEffect(Matrix6X g) { return std::make_shared<LinearEffect>(std::move(g)); }

LoopFactor KnownFactor(const Rigid3d& pose) {
  LoopFactor factor;
  factor.known = pose;
  return factor;
}

LoopFactor SharedFactor(int index) {
  LoopFactor factor;
  factor.kind = LoopFactor::Kind::kShared;
  factor.index = index;
  return factor;
}

LoopFactor EffectFactor(int index, std::shared_ptr<const PoseEffect> effect) {
  LoopFactor factor;
  factor.kind = LoopFactor::Kind::kEffect;
  factor.index = index;
  factor.effect = std::move(effect);
  return factor;
}

LoopFactor OwnFactor(int index) {
  LoopFactor factor;
  factor.kind = LoopFactor::Kind::kOwn;
  factor.index = index;
  return factor;
}

LoopFactor Inverse(LoopFactor factor) {
  factor.is_inverted = !factor.is_inverted;
  return factor;
}

KinematicLoop::KinematicLoop(std::vector<LoopFactor> factors) : factors_(std::move(factors)) {
  const auto places_of = [&](LoopFactor::Kind kind) -> std::vector<int>* {
    if (kind == LoopFactor::Kind::kShared) return &shared_;
    if (kind == LoopFactor::Kind::kEffect) return &effects_;
    return kind == LoopFactor::Kind::kOwn ? &own_ : nullptr;
  };
  for (LoopFactor& factor : factors_) {
    if (std::vector<int>* const places = places_of(factor.kind)) {
      places->push_back(factor.index);
    } else if (factor.is_inverted) {
      factor.known = Inverse(factor.known);
      factor.is_inverted = false;
    }
  }
  for (std::vector<int>* const places : {&shared_, &effects_, &own_}) {
    std::sort(places->begin(), places->end());
    places->erase(std::unique(places->begin(), places->end()), places->end());
  }
  for (const LoopFactor& factor : factors_) {
    const std::vector<int>* const places = places_of(factor.kind);
    slots_.push_back(
        places == nullptr
            ? 0
            : static_cast<size_t>(std::lower_bound(places->begin(), places->end(), factor.index) - places->begin()));
  }
}

// A tangent of the factor F_j in the child frame is a perturbation on the left of camera_from_target by the adjoint of
// F_0 ... F_j; that of an inverted factor by minus the adjoint of F_0 ... F_(j-1).
Rigid3d KinematicLoop::Evaluate(const LoopPoses& poses, LoopDerivatives* derivatives) const {
  Rigid3d left;
  if (derivatives != nullptr) {
    derivatives->shared.assign(shared_.size(), Matrix6::Zero());
    derivatives->effects.assign(effects_.size(), Matrix6X());
    derivatives->own.assign(own_.size(), Matrix6::Zero());
  }
  Matrix6X tangent_from_effects;
  for (size_t j = 0; j < factors_.size(); ++j) {
    const LoopFactor& factor = factors_[j];
    const auto index = static_cast<size_t>(factor.index);
    Rigid3d pose;
    switch (factor.kind) {
      case LoopFactor::Kind::kKnown:
        left = j == 0 ? factor.known : left * factor.known;
        continue;
      case LoopFactor::Kind::kShared:
        pose = poses.shared[index];
        break;
      case LoopFactor::Kind::kEffect:
        pose = factor.effect->Evaluate(poses.effects[index], derivatives == nullptr ? nullptr : &tangent_from_effects);
        break;
      case LoopFactor::Kind::kOwn:
        pose = poses.own[index];
        break;
    }
    // -I holds exactly for the first factor, which is usually the inverse of a camera's pose.
    Matrix6 left_from_tangent;
    const bool is_needed = derivatives != nullptr;
    if (is_needed && factor.is_inverted) left_from_tangent = j == 0 ? Matrix6(-Matrix6::Identity()) : -Adjoint(left);
    const Rigid3d next = factor.is_inverted ? Inverse(pose) : pose;
    left = j == 0 ? next : left * next;
    if (!is_needed) continue;
    if (!factor.is_inverted) left_from_tangent = Adjoint(left);
    switch (factor.kind) {
      case LoopFactor::Kind::kKnown:
        break;
      case LoopFactor::Kind::kShared:
        derivatives->shared[slots_[j]] += left_from_tangent;
        break;
      case LoopFactor::Kind::kOwn:
        derivatives->own[slots_[j]] += left_from_tangent;
        break;
      case LoopFactor::Kind::kEffect: {
        Matrix6X& by_effects = derivatives->effects[slots_[j]];
        if (by_effects.size() == 0) by_effects.setZero(6, tangent_from_effects.cols());
        by_effects += left_from_tangent * tangent_from_effects;
        break;
      }
    }
  }
  return left;
}

}  // namespace heba
