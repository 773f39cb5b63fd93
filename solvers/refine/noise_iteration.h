// The alternation between the fit and the noise that its residuals are whitened with (docs/estimation.md, section 5).
#pragma once

#include "heba/base/error.h"
#include "solvers/refine/fit.h"

namespace heba {

// Effects of a robot with a smaller standard deviation, rad or m, count as exact.
inline constexpr double kExactEffect = 1e-8;

// Returns the noise with both sigmas at least 1e-8 m and 1e-8 rad: a robot with smaller sigmas counts as exact.
RobotNoise AtLeastExact(const RobotNoise& noise);

// Returns the part of a typical point's sigma that its detector does not know; at least the error of print and paper.
double UnmodelledSigmaPx(double pixel_sigma_px, double detector_px);

// The estimate and the noise that it is whitened with depend on each other: alternates between both until they
// converge. `scale` is that of the pixel noise.
Outcome<Fit> IterateNoiseAndFit(Fit fit, const Loss& loss, NoiseScale scale, const AdjustmentOptions& options);

}  // namespace heba
