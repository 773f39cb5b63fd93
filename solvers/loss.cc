#include "solvers/loss.h"

#include <algorithm>
#include <cmath>

namespace heba {
namespace {

constexpr double kHuber = 1.345;
constexpr double kCauchy = 2.385;

// -2 ln of the false-alarm rate: chi-square with 2 degrees of freedom exceeds it with that probability.
const double kTruncated2 = -2.0 * std::log(kTruncatedFalseAlarm);

double RhoNone(double s) { return s; }
double WeightNone(double /*s*/) { return 1; }
double RhoHuber(double s) { return s <= kHuber * kHuber ? s : 2 * kHuber * std::sqrt(s) - kHuber * kHuber; }
double WeightHuber(double s) { return s <= kHuber * kHuber ? 1.0 : kHuber / std::sqrt(s); }
double RhoCauchy(double s) { return kCauchy * kCauchy * std::log1p(s / (kCauchy * kCauchy)); }
double WeightCauchy(double s) { return 1.0 / (1.0 + s / (kCauchy * kCauchy)); }

double RhoTruncated(double s) { return std::min(s, kTruncated2); }
double WeightTruncated(double s) { return s < kTruncated2 ? 1.0 : 0.0; }

// The mean of f(s) over chi-square with 2 degrees of freedom, whose density is exp(-s / 2) / 2: Simpson's rule in
// q = sqrt(s), in which the integrand is smooth but for Huber's kink.
template <class F>
double Mean(const F& f) {
  constexpr int kSteps = 20000;
  constexpr double kEnd = 12.0;  // exp(-72): nothing beyond.
  const double h = kEnd / kSteps;
  double sum = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double q = i * h;
    const double simpson = (i == 0 || i == kSteps) ? 1.0 : (i % 2 == 1 ? 4.0 : 2.0);
    sum += simpson * f(q * q) * q * std::exp(-0.5 * q * q);
  }
  return sum * h / 3.0;
}

Loss MakeLoss(std::string_view name, double (*rho)(double), double (*weight)(double)) {
  return {name,
          rho,
          weight,
          Mean([&](double s) { return weight(s); }),
          0.5 * Mean([&](double s) { return weight(s) * s; }),
          0.5 * Mean([&](double s) { return weight(s) * weight(s) * s; })};
}

const std::vector<Loss>& Losses() {
  static const std::vector<Loss> losses = {
      MakeLoss("none", &RhoNone, &WeightNone),
      MakeLoss("huber", &RhoHuber, &WeightHuber),
      MakeLoss("cauchy", &RhoCauchy, &WeightCauchy),
      MakeLoss("truncated", &RhoTruncated, &WeightTruncated),
  };
  return losses;
}

}  // namespace

const Loss* FindLoss(std::string_view name) {
  for (const Loss& loss : Losses()) {
    if (loss.name == name) return &loss;
  }
  return nullptr;
}

std::vector<std::string> LossNames() {
  std::vector<std::string> names;
  for (const Loss& loss : Losses()) names.emplace_back(loss.name);
  return names;
}

}  // namespace heba
