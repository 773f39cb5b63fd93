#include "solvers/residuals/kinematic_loop.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/error.h"

namespace heba {
LoopFactor KnownFactor(const Rigid3d& pose) { return {.known = pose}; }

LoopFactor SharedFactor(int index) { return {.kind = LoopFactor::Kind::kShared, .index = index}; }

LoopFactor EffectFactor(int index, std::shared_ptr<const PoseEffect> effect) {
  return {.kind = LoopFactor::Kind::kEffect, .index = index, .effect = std::move(effect)};
}

LoopFactor OwnFactor(int index) { return {.kind = LoopFactor::Kind::kOwn, .index = index}; }

LoopFactor Inverse(LoopFactor factor) {
  factor.is_inverted = !factor.is_inverted;
  return factor;
}

KinematicLoop::KinematicLoop(std::vector<LoopFactor> factors) {
  const auto pattern = std::make_shared<Pattern>();
  pattern->factors = std::move(factors);
  const auto indices_of = [&](LoopFactor::Kind kind) -> std::vector<int>* {
    if (kind == LoopFactor::Kind::kShared) return &pattern->shared;
    if (kind == LoopFactor::Kind::kEffect) return &pattern->effects;
    return kind == LoopFactor::Kind::kOwn ? &pattern->own : nullptr;
  };
  for (LoopFactor& factor : pattern->factors) {
    if (factor.kind == LoopFactor::Kind::kEffect) pose_effects_.push_back(std::exchange(factor.effect, nullptr));
    if (std::vector<int>* const indices = indices_of(factor.kind)) {
      indices->push_back(factor.index);
      continue;
    }
    known_.push_back(factor.is_inverted ? Inverse(factor.known) : factor.known);
    factor.known = Rigid3d();
  }
  for (std::vector<int>* const indices : {&pattern->shared, &pattern->effects, &pattern->own}) {
    std::sort(indices->begin(), indices->end());
    indices->erase(std::unique(indices->begin(), indices->end()), indices->end());
  }
  size_t num_known = 0;
  for (size_t j = 0; j < pattern->factors.size(); ++j) {
    const LoopFactor& factor = pattern->factors[j];
    pattern->is_first.push_back(std::none_of(
        pattern->factors.begin(), pattern->factors.begin() + static_cast<std::ptrdiff_t>(j),
        [&](const LoopFactor& before) { return before.kind == factor.kind && before.index == factor.index; }));
    const std::vector<int>* const indices = indices_of(factor.kind);
    if (indices == nullptr) {
      pattern->slots.push_back(num_known++);
      continue;
    }
    const auto found = std::lower_bound(indices->begin(), indices->end(), factor.index);
    pattern->slots.push_back(static_cast<size_t>(found - indices->begin()));
  }
  pattern_ = pattern;
}

KinematicLoop KinematicLoop::With(std::vector<Rigid3d> known,
                                  std::vector<std::shared_ptr<const PoseEffect>> effects) const {
  CHECK_EQ(known.size(), known_.size());
  CHECK_EQ(effects.size(), pose_effects_.size());
  KinematicLoop loop = *this;
  loop.known_ = std::move(known);
  loop.pose_effects_ = std::move(effects);
  for (size_t j = 0; j < pattern_->factors.size(); ++j) {
    const LoopFactor& factor = pattern_->factors[j];
    if (factor.kind != LoopFactor::Kind::kKnown || !factor.is_inverted) continue;
    Rigid3d& pose = loop.known_[pattern_->slots[j]];
    pose = Inverse(pose);
  }
  return loop;
}

std::vector<LoopFactor> KinematicLoop::Factors() const {
  std::vector<LoopFactor> factors = pattern_->factors;
  auto pose_effect = pose_effects_.begin();
  for (size_t j = 0; j < factors.size(); ++j) {
    if (factors[j].kind == LoopFactor::Kind::kEffect) factors[j].effect = *pose_effect++;
    if (factors[j].kind != LoopFactor::Kind::kKnown) continue;
    factors[j].known = known_[pattern_->slots[j]];
    if (factors[j].is_inverted) factors[j].known = Inverse(factors[j].known);
  }
  return factors;
}

// A tangent of the factor F_j in the child frame is a perturbation on the left of camera_from_target by the adjoint of
// F_0 ... F_j; that of an inverted factor by minus the adjoint of F_0 ... F_(j-1).
Rigid3d KinematicLoop::Evaluate(const LoopPoses& poses, LoopDerivatives* derivatives) const {
  Rigid3d left;
  if (derivatives != nullptr) {
    derivatives->shared.resize(pattern_->shared.size());
    derivatives->effects.resize(pattern_->effects.size());
    derivatives->own.resize(pattern_->own.size());
  }
  Rigid3d of_effects;
  Matrix6X tangent_from_effects;
  auto pose_effect = pose_effects_.begin();
  for (size_t j = 0; j < pattern_->factors.size(); ++j) {
    const LoopFactor& factor = pattern_->factors[j];
    const size_t slot = pattern_->slots[j];
    const auto index = static_cast<size_t>(factor.index);
    const Rigid3d* pose = &of_effects;
    switch (factor.kind) {
      case LoopFactor::Kind::kKnown:
        left = j == 0 ? known_[slot] : left * known_[slot];
        continue;
      case LoopFactor::Kind::kShared:
        pose = &poses.shared[index];
        break;
      case LoopFactor::Kind::kEffect:
        of_effects =
            (*pose_effect++)->Evaluate(poses.effects[index], derivatives == nullptr ? nullptr : &tangent_from_effects);
        break;
      case LoopFactor::Kind::kOwn:
        pose = &poses.own[index];
        break;
    }
    Matrix6 left_from_tangent;
    if (factor.is_inverted) {
      // -I holds exactly for the first factor, which is usually the inverse of a camera's pose.
      if (derivatives != nullptr) left_from_tangent = j == 0 ? Matrix6(-Matrix6::Identity()) : Matrix6(-Adjoint(left));
      left = j == 0 ? Inverse(*pose) : left * Inverse(*pose);
    } else {
      left = j == 0 ? *pose : left * *pose;
      if (derivatives != nullptr) left_from_tangent = Adjoint(left);
    }
    if (derivatives == nullptr) continue;
    const auto add_to = [&](auto* sum, const auto& derivative) {
      if (pattern_->is_first[j]) {
        *sum = derivative;
      } else {
        *sum += derivative;
      }
    };
    if (factor.kind == LoopFactor::Kind::kEffect) {
      add_to(&derivatives->effects[slot], Matrix6X(left_from_tangent * tangent_from_effects));
    } else {
      add_to(factor.kind == LoopFactor::Kind::kShared ? &derivatives->shared[slot] : &derivatives->own[slot],
             left_from_tangent);
    }
  }
  return left;
}

}  // namespace heba
