#include "heba/base/distributions.h"

#include <cmath>
#include <limits>

#include "heba/base/error.h"

namespace heba {
namespace {

constexpr double kTiny = 1e-300;
constexpr double kPrecision = 1e-15;
constexpr int kMaxTerms = 10000;

// Returns the regularised upper incomplete gamma function Q(a, x): by its series for x < a + 1, otherwise by its
// continued fraction (Abramowitz and Stegun 6.5.29 and 6.5.31; the fraction is evaluated by Lentz's method).
double UpperGamma(double a, double x) {
  if (x <= 0) return 1;
  const double front = std::exp(-x + a * std::log(x) - std::lgamma(a));
  if (x < a + 1) {
    double term = 1 / a;
    double sum = term;
    for (int n = 1; n < kMaxTerms && std::abs(term) > kPrecision * std::abs(sum); ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return 1 - front * sum;
  }
  double b = x + 1 - a;
  double c = 1 / kTiny;
  double d = 1 / b;
  double h = d;
  for (int n = 1; n < kMaxTerms; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = an * d + b;
    d = 1 / (std::abs(d) < kTiny ? kTiny : d);
    c = b + an / c;
    if (std::abs(c) < kTiny) c = kTiny;
    h *= d * c;
    if (std::abs(d * c - 1) < kPrecision) break;
  }
  return front * h;
}

// Returns the regularised incomplete beta function I_x(a, b), by its continued fraction (Abramowitz and Stegun 26.5.8).
double IncompleteBeta(double x, double a, double b) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  // The continued fraction converges fast only below the mean.
  if (x > (a + 1) / (a + b + 2)) return 1 - IncompleteBeta(1 - x, b, a);
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x)) / a;
  double c = 1;
  double d = 1 - (a + b) * x / (a + 1);
  d = 1 / (std::abs(d) < kTiny ? kTiny : d);
  double h = d;
  for (int m = 1; m < kMaxTerms; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 + even * d;
    d = 1 / (std::abs(d) < kTiny ? kTiny : d);
    c = 1 + even / c;
    if (std::abs(c) < kTiny) c = kTiny;
    h *= d * c;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 + odd * d;
    d = 1 / (std::abs(d) < kTiny ? kTiny : d);
    c = 1 + odd / c;
    if (std::abs(c) < kTiny) c = kTiny;
    h *= d * c;
    if (std::abs(d * c - 1) < kPrecision) break;
  }
  return front * h;
}

// Returns the value at which a decreasing tail function reaches `tail`, by bisection on a logarithmic scale.
template <class Tail>
double Quantile(const Tail& tail_at, double tail) {
  CHECK(tail > 0 && tail < 1) << tail;
  double low = 1e-12;
  double high = 1;
  while (tail_at(high) > tail && high < 1e12) high *= 2;
  for (int i = 0; i < 200 && high / low > 1 + 1e-13; ++i) {
    const double middle = std::sqrt(low * high);
    (tail_at(middle) > tail ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

}  // namespace

double ChiSquareTail(double value, double dof) { return UpperGamma(0.5 * dof, 0.5 * value); }

double ChiSquareQuantile(double tail, double dof) {
  return Quantile([&](double value) { return ChiSquareTail(value, dof); }, tail);
}

double FisherTail(double value, double dof1, double dof2) {
  // Beyond this number of degrees of freedom, F cannot be distinguished from its limit, chi-square divided by dof1.
  constexpr double kManyDof = 1e7;
  if (dof2 > kManyDof) return ChiSquareTail(value * dof1, dof1);
  return IncompleteBeta(dof2 / (dof2 + dof1 * value), 0.5 * dof2, 0.5 * dof1);
}

double FisherQuantile(double tail, double dof1, double dof2) {
  return Quantile([&](double value) { return FisherTail(value, dof1, dof2); }, tail);
}

double ConfidenceRadius(const Eigen::Matrix3d& covariance, double confidence, double dof) {
  const double trace = covariance.trace();
  if (!(trace > 0)) return 0;
  const double dof_of_squares = trace * trace / covariance.squaredNorm();
  return std::sqrt(trace * FisherQuantile(1 - confidence, dof_of_squares, dof));
}

}  // namespace heba
