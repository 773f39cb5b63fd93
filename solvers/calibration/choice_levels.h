// The levels by which a model is rejected in favour of a larger one.
#pragma once

namespace heba {

// Significance level: a model is rejected if data that deviate from it as much would be rarer than this.
inline constexpr double kModelRejected = 0.01;
// The level for a model without systematic errors of the robot (of an arm's parameters, or smooth ones) against one
// with them. Robots have such errors: taken for random ones, they leave sigmas of a part of their size, while
// superfluous ones shrink to little (AreLikely of smooth_search.h). For the errors of an arm the probabilities exceed
// the true ones by far: at this level, less than 1 % of exact arms are rejected.
inline constexpr double kRandomErrorsRejected = 0.05;
// The least ModelAlternative::odds: an arm whose offsets have errors has others too, and those are left out only if the
// captures show that they are smaller than those of other arms. If they are estimated needlessly, they shrink to
// nothing; if they are left out, the sigmas lack them.
inline constexpr double kLeastOdds = 3;

}  // namespace heba
