// Robust losses rho(s) of a point's squared whitened distance s = (du^2 + dv^2) / sigma^2, and their effect on
// estimates when the noise is Gaussian.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/data/loss_kind.h"

namespace heba {

struct Loss {
  LossKind kind;
  std::string_view name;
  double (*rho)(double s);
  double (*weight)(double s);  // d rho / d s
  // Evaluates both for `size` values.
  void (*evaluate)(const double* s, int size, double* rho, double* weight);
  // Expectations for s = sum of squares of two Gaussian coordinates of variance 1 (chi-square with 2 degrees of
  // freedom):
  double mean_weight;     // E[w]
  double consistency;     // E[w s] / 2: sigma^2 = sum(w r^2) / (degrees of freedom * consistency) is unbiased
  double mean_weight2_s;  // E[w^2 s] / 2
  // The asymptotic covariance of an M-estimate is this factor times sigma^2 times the inverse of the *weighted* normal
  // matrix sum w J^T J (Huber 1981, section 7.6, for two coordinates with a radial weight).
  double covariance_factor() const { return mean_weight2_s / (consistency * consistency) * mean_weight; }
};

// Probability that `truncated` rejects a point whose noise is Gaussian with the assumed sigma.
inline constexpr double kTruncatedFalseAlarm = 1e-4;

// Returns the loss `none`; `huber` (1.345) and `cauchy` (2.385), with the constants that have 95 % efficiency in one
// dimension; or `truncated`: least squares over the points that pass a test with the false-alarm rate above; the others
// have no weight.
const Loss& LossOf(LossKind kind);

// Returns the loss of points that are known to be inliers: `none` for `truncated`, whose outliers are removed.
inline LossKind OfInliers(LossKind kind) { return kind == LossKind::kTruncated ? LossKind::kNone : kind; }

// The names of the losses in configs, in the order of LossKind.
std::vector<std::string> LossNames();
// Returns nothing if there is no loss of this name.
std::optional<LossKind> FindLossKind(std::string_view name);

}  // namespace heba
