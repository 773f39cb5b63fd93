#include "solvers/residuals/kinematic_loop.h"

#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {

Rigid3d RandomPose(Rng& rng) {
  Tangent6 tangent;
  tangent << rng.NormalVector3(), rng.NormalVector3();
  return Retract(Rigid3d(), tangent);
}

// Values of the unknowns of the loops below.
struct Values {
  std::vector<Rigid3d> shared;
  std::vector<Eigen::VectorXd> effects;
  std::vector<Rigid3d> own;

  LoopPoses Poses() const { return {shared, effects, own}; }
};

Values RandomValues(uint64_t seed) {
  Rng rng(seed);
  Values values;
  for (int i = 0; i < 3; ++i) values.shared.push_back(RandomPose(rng));
  for (int i = 0; i < 2; ++i) values.own.push_back(RandomPose(rng));
  values.effects.push_back(0.1 * Eigen::Vector4d{rng.Normal(), rng.Normal(), rng.Normal(), rng.Normal()});
  return values;
}

Matrix6X RandomMatrix(uint64_t seed) {
  Rng rng(seed);
  return Matrix6X::NullaryExpr(6, 4, [&] { return rng.Normal(); });
}

// Returns the left perturbation from one pose to another, to first order.
Tangent6 LeftDifference(const Rigid3d& from, const Rigid3d& to) {
  const Rigid3d difference = to * Inverse(from);
  Tangent6 tangent;
  tangent << difference.translation, LogRotation(difference.rotation);
  return tangent;
}

void ExpectDerivatives(const KinematicLoop& loop, const Values& values) {
  LoopDerivatives derivatives;
  const Rigid3d here = loop.Evaluate(values.Poses(), &derivatives);
  ASSERT_EQ(derivatives.shared.size(), loop.shared().size());
  ASSERT_EQ(derivatives.own.size(), loop.own().size());
  ASSERT_EQ(derivatives.effects.size(), loop.effects().size());
  constexpr double kStep = 1e-6;
  const auto expect = [&](const auto& column, const Values& plus, const Values& minus) {
    const Tangent6 numeric = (LeftDifference(here, loop.Evaluate(plus.Poses(), nullptr)) -
                              LeftDifference(here, loop.Evaluate(minus.Poses(), nullptr))) /
                             (2 * kStep);
    EXPECT_LT((numeric - column).norm(), 1e-7 * (1 + numeric.norm()));
  };
  const auto moved = [&](std::vector<Rigid3d> Values::*poses, int index, int k, double step) {
    Values other = values;
    Rigid3d& pose = (other.*poses)[static_cast<size_t>(index)];
    pose = Retract(pose, step * Tangent6::Unit(k));
    return other;
  };
  for (int k = 0; k < 6; ++k) {
    for (size_t i = 0; i < loop.shared().size(); ++i) {
      expect(derivatives.shared[i].col(k), moved(&Values::shared, loop.shared()[i], k, kStep),
             moved(&Values::shared, loop.shared()[i], k, -kStep));
    }
    for (size_t i = 0; i < loop.own().size(); ++i) {
      expect(derivatives.own[i].col(k), moved(&Values::own, loop.own()[i], k, kStep),
             moved(&Values::own, loop.own()[i], k, -kStep));
    }
  }
  for (size_t i = 0; i < loop.effects().size(); ++i) {
    const auto index = static_cast<size_t>(loop.effects()[i]);
    for (Eigen::Index k = 0; k < values.effects[index].size(); ++k) {
      Values plus = values;
      Values minus = values;
      plus.effects[index][k] += kStep;
      minus.effects[index][k] -= kStep;
      expect(derivatives.effects[i].col(k), plus, minus);
    }
  }
}

TEST(KinematicLoopTest, DerivativesAreThoseOfTheProduct) {
  Rng rng(3);
  const Values values = RandomValues(4);
  const LoopFactor effect = EffectFactor(0, MakeLinearEffect(RandomMatrix(5)));
  const LoopFactor known = KnownFactor(RandomPose(rng));
  const std::vector<std::vector<LoopFactor>> loops = {
      {OwnFactor(0)},
      {Inverse(SharedFactor(0)), known, SharedFactor(1)},
      {Inverse(SharedFactor(0)), Inverse(known), Inverse(OwnFactor(1)), SharedFactor(2)},
      {known, Inverse(SharedFactor(2)), known, effect, OwnFactor(1), SharedFactor(0), Inverse(OwnFactor(0))},
      {SharedFactor(1), Inverse(effect), known},
      // Unknowns that occur twice.
      {Inverse(SharedFactor(0)), known, SharedFactor(1), known, SharedFactor(0)},
      {effect, OwnFactor(0), known, effect, Inverse(OwnFactor(0))},
  };
  for (size_t i = 0; i < loops.size(); ++i) {
    SCOPED_TRACE(i);
    ExpectDerivatives(KinematicLoop(loops[i]), values);
  }
}

TEST(KinematicLoopTest, IsTheProductOfItsFactors) {
  Rng rng(7);
  const Values values = RandomValues(8);
  const Rigid3d known = RandomPose(rng);
  const KinematicLoop loop({Inverse(SharedFactor(2)), KnownFactor(known), Inverse(OwnFactor(0)), SharedFactor(0)});
  const Rigid3d expected = Inverse(values.shared[2]) * known * Inverse(values.own[0]) * values.shared[0];
  const Rigid3d found = loop.Evaluate(values.Poses(), nullptr);
  EXPECT_LT(DistanceM(found, expected), 1e-12);
  EXPECT_LT(AngleRad(found, expected), 1e-12);
  EXPECT_EQ(loop.shared(), (std::vector<int>{0, 2}));
  EXPECT_EQ(loop.own(), (std::vector<int>{0}));
  EXPECT_TRUE(loop.effects().empty());
}

TEST(KinematicLoopTest, OtherKnownPosesReplaceThoseOfAPattern) {
  Rng rng(9);
  const Values values = RandomValues(10);
  const std::vector<Rigid3d> known = {RandomPose(rng), RandomPose(rng)};
  const KinematicLoop pattern(
      {Inverse(KnownFactor(RandomPose(rng))), SharedFactor(0), KnownFactor(RandomPose(rng)), OwnFactor(0)});
  const KinematicLoop loop = pattern.With(known);
  const Rigid3d expected = Inverse(known[0]) * values.shared[0] * known[1] * values.own[0];
  EXPECT_LT(DistanceM(loop.Evaluate(values.Poses(), nullptr), expected), 1e-12);
  const std::vector<LoopFactor> factors = loop.Factors();
  ASSERT_EQ(factors.size(), 4U);
  EXPECT_LT(DistanceM(factors[0].known, known[0]), 1e-12);
  EXPECT_TRUE(factors[0].is_inverted);
}

// A loop with other functions of the effects is the one that is made of them.
TEST(KinematicLoopTest, OtherEffectsReplaceThoseOfAPattern) {
  Rng rng(11);
  const Values values = RandomValues(12);
  const Rigid3d known = RandomPose(rng);
  const std::shared_ptr<const PoseEffect> effect = MakeLinearEffect(RandomMatrix(13));
  const auto factors_with = [&](const Rigid3d& pose, const std::shared_ptr<const PoseEffect>& of_effects) {
    return std::vector<LoopFactor>{Inverse(SharedFactor(0)), Inverse(EffectFactor(0, of_effects)), KnownFactor(pose),
                                   SharedFactor(1)};
  };
  const KinematicLoop pattern(factors_with(RandomPose(rng), MakeLinearEffect(RandomMatrix(14))));
  const KinematicLoop expected(factors_with(known, effect));
  const KinematicLoop loop = pattern.With({known}, {effect});
  LoopDerivatives derivatives;
  LoopDerivatives expected_derivatives;
  EXPECT_LT(
      DistanceM(loop.Evaluate(values.Poses(), &derivatives), expected.Evaluate(values.Poses(), &expected_derivatives)),
      1e-15);
  EXPECT_TRUE(derivatives.effects[0] == expected_derivatives.effects[0]);
  EXPECT_EQ(loop.Factors()[1].effect, effect);
}

}  // namespace
}  // namespace heba
