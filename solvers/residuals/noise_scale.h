// The size of the pixel noise, from residuals.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/problem.h"
#include "solvers/residuals/loss.h"

namespace heba {

// Never less than this: below it, residuals are round-off.
inline constexpr double kMinSigmaPx = 1e-6;

// One coordinate's sigma from the squared distances of points, robustly: from their median, which is 2 ln 2 sigma^2 for
// Gaussian noise. Half the points may be anything.
double SigmaFromMedian(std::vector<double> squared_distances_px2);

// One coordinate's sigma of an M-estimate: the fixed point of sigma^2 = sum(w(s) r^2) / (dof * E[w s] / 2), s =
// r^2 / sigma^2; for the loss `none` the root of the mean square. `num_unknowns` are what the fit freed: 2 points less
// these are the degrees of freedom.
double SigmaOfFit(const std::vector<double>& squared_distances_px2, int num_unknowns, const Loss& loss,
                  double start_px);

// What detectors say of their points (Observations::covariances_px2), in the typical case: the median over all points
// of one coordinate's sigma. Nothing if they say nothing.
std::optional<double> TypicalDetectorSigma(const std::vector<View>& views);

// Fills in Observations::whitening: what a detector says of each point, and `unmodelled_sigma_px`, equal for all, of
// what it cannot know (print, paper, lens, robot), in such a measure that the typical point keeps its size: a pixel
// sigma still means a point's. Without covariances all points count alike.
void WeightByCovariance(double unmodelled_sigma_px, std::vector<View>* views);

}  // namespace heba
