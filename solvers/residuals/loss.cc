#include "solvers/residuals/loss.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/registry.h"

namespace heba {
namespace {

constexpr double kHuber = 1.345;
constexpr double kCauchy = 2.385;

// -2 ln of the false-alarm rate: a chi-square variable with 2 degrees of freedom exceeds this value with that
// probability.
const double kTruncated2 = -2.0 * std::log(kTruncatedFalseAlarm);

double RhoNone(double s) { return s; }
double WeightNone(double /*s*/) { return 1; }
double RhoHuber(double s) { return s <= kHuber * kHuber ? s : 2 * kHuber * std::sqrt(s) - kHuber * kHuber; }
double WeightHuber(double s) { return s <= kHuber * kHuber ? 1.0 : kHuber / std::sqrt(s); }
double RhoCauchy(double s) { return kCauchy * kCauchy * std::log1p(s / (kCauchy * kCauchy)); }
double WeightCauchy(double s) { return 1.0 / (1.0 + s / (kCauchy * kCauchy)); }

double RhoTruncated(double s) { return std::min(s, kTruncated2); }
double WeightTruncated(double s) { return s < kTruncated2 ? 1.0 : 0.0; }

template <double (*kRho)(double), double (*kWeight)(double)>
void Evaluate(const double* s, int size, double* rho, double* weight) {
  for (int i = 0; i < size; ++i) {
    rho[i] = kRho(s[i]);
    weight[i] = kWeight(s[i]);
  }
}

// Returns the mean of f(s) for s chi-square with 2 degrees of freedom, whose density is exp(-s / 2) / 2, by
// Gauss-Legendre quadrature in q = sqrt(s) on panels that end at `knee`; f is smooth on either side of it.
template <class F>
double Mean(const F& f, double knee) {
  constexpr int kPanels = 40;
  constexpr double kEnd = 12.0;  // exp(-72): the rest is negligible.
  // The five-point rule on [-1, 1].
  const double inner = std::sqrt(5 - 2 * std::sqrt(10.0 / 7)) / 3;
  const double outer = std::sqrt(5 + 2 * std::sqrt(10.0 / 7)) / 3;
  const double inner_weight = (322 + 13 * std::sqrt(70.0)) / 900;
  const double outer_weight = (322 - 13 * std::sqrt(70.0)) / 900;
  const double nodes[] = {-outer, -inner, 0, inner, outer};
  const double weights[] = {outer_weight, inner_weight, 128.0 / 225, inner_weight, outer_weight};
  double sum = 0;
  for (const auto& [from, to] : {std::pair(0.0, knee), std::pair(knee, kEnd)}) {
    const double half = 0.5 * (to - from) / kPanels;
    for (int panel = 0; panel < kPanels; ++panel) {
      for (int i = 0; i < 5; ++i) {
        const double q = from + half * (2 * panel + 1 + nodes[i]);
        sum += half * weights[i] * f(q * q) * q * std::exp(-0.5 * q * q);
      }
    }
  }
  return sum;
}

// `knee`: the distance, in sigma, at which the weight is not smooth.
template <double (*kRho)(double), double (*kWeight)(double)>
Loss MakeLoss(LossKind kind, std::string_view name, double knee) {
  const auto mean = [&](const auto& f) { return Mean(f, knee); };
  return {kind,
          name,
          kRho,
          kWeight,
          &Evaluate<kRho, kWeight>,
          mean([](double s) { return kWeight(s); }),
          0.5 * mean([](double s) { return kWeight(s) * s; }),
          0.5 * mean([](double s) { return kWeight(s) * kWeight(s) * s; })};
}

// The losses in the order of LossKind.
const std::vector<Loss>& Losses() {
  static const std::vector<Loss> losses = {
      MakeLoss<&RhoNone, &WeightNone>(LossKind::kNone, "none", 1.0),
      MakeLoss<&RhoHuber, &WeightHuber>(LossKind::kHuber, "huber", kHuber),
      MakeLoss<&RhoCauchy, &WeightCauchy>(LossKind::kCauchy, "cauchy", 1.0),
      MakeLoss<&RhoTruncated, &WeightTruncated>(LossKind::kTruncated, "truncated", std::sqrt(kTruncated2)),
  };
  return losses;
}

}  // namespace

const Loss& LossOf(LossKind kind) { return Losses()[static_cast<size_t>(kind)]; }

std::vector<std::string> LossNames() { return NamesOf(Losses()); }

std::optional<LossKind> FindLossKind(std::string_view name) {
  const Loss* loss = FindEntry(Losses(), name);
  return loss == nullptr ? std::nullopt : std::optional<LossKind>(loss->kind);
}

}  // namespace heba
