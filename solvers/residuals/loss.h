// Robust losses rho(s) of the squared whitened distance s = (du^2 + dv^2) / sigma^2 of a point, and what they do to
// estimates when the noise is Gaussian.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace heba {

struct Loss {
  std::string_view name;
  double (*rho)(double s);
  double (*weight)(double s);  // d rho / d s
  // Both, of many.
  void (*evaluate)(const double* s, int size, double* rho, double* weight);
  // Expectations over s of two Gaussian coordinates of variance 1 (chi-square with 2 degrees of freedom):
  double mean_weight;     // E[w]
  double consistency;     // E[w s] / 2: sigma^2 = sum(w r^2) / (degrees of freedom * consistency) is unbiased
  double mean_weight2_s;  // E[w^2 s] / 2
  // The asymptotic covariance of an M-estimate is this factor times sigma^2 times the inverse of the *weighted* normal
  // matrix sum w J^T J (Huber 1981, section 7.6, for two coordinates with a radial weight).
  double covariance_factor() const { return mean_weight2_s / (consistency * consistency) * mean_weight; }
};

// How often `truncated` leaves a point out that is as it should be.
inline constexpr double kTruncatedFalseAlarm = 1e-4;

// none; huber (1.345) and cauchy (2.385), with the constants that are 95 % efficient in one dimension; truncated: least
// squares of the points that pass a test with the false-alarm rate above, nothing of the others.
const Loss* FindLoss(std::string_view name);
std::vector<std::string> LossNames();

}  // namespace heba
