// Estimation of the pixel noise from residuals, and weighting of points by their covariances: equation (5)
// of docs/estimation.md.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/pair_problem.h"
#include "solvers/residuals/loss.h"

namespace heba {

// Lower bound of every sigma: smaller residuals are round-off.
inline constexpr double kMinSigmaPx = 1e-6;

// Returns a robust estimate of one coordinate's sigma from the squared distances of points: their median is 2 ln 2
// sigma^2 for Gaussian noise. Up to half of the points may be outliers. Returns kMinSigmaPx if there are no points.
double SigmaFromMedian(std::vector<double> squared_distances_px2);

// Returns the sigma of one coordinate for an M-estimate: the fixed point of sigma^2 = sum(w(s) r^2) / (dof * E[w s] /
// 2), s = r^2 / sigma^2, found by iteration from `start_px`; for the loss `none` the square root of sum(r^2) / dof.
// The degrees of freedom are twice the number of points minus `num_unknowns`, the number of free parameters of the
// fit.
double SigmaOfFit(const std::vector<double>& squared_distances_px2, int num_unknowns, const Loss& loss,
                  double start_px);

// Returns the typical sigma of one coordinate according to the detectors (Observations::covariances_px2): the square
// root of the median variance over all points. Returns nothing if there are no covariances.
std::optional<double> TypicalDetectorSigma(const std::vector<const Observations*>& all);
std::optional<double> TypicalDetectorSigma(const std::vector<View>& views);

// Fills in Observations::whitening from the detector's covariance of each point plus `unmodelled_sigma_px`, equal for
// all points, for errors that a detector cannot know (print, paper, lens, robot). The whitening is scaled such that
// the typical point keeps its size, so a pixel sigma still is the sigma of a point. Without covariances all points
// are weighted equally.
void WeightByCovariance(double unmodelled_sigma_px, const std::vector<Observations*>& all);

}  // namespace heba
