#include "solvers/noise_scale.h"

#include <algorithm>
#include <cmath>

namespace heba {

double SigmaFromMedian(std::vector<double> squared_distances_px2) {
  if (squared_distances_px2.empty()) return kMinSigmaPx;
  const auto middle = squared_distances_px2.begin() + static_cast<std::ptrdiff_t>(squared_distances_px2.size() / 2);
  std::nth_element(squared_distances_px2.begin(), middle, squared_distances_px2.end());
  return std::max(kMinSigmaPx, std::sqrt(*middle / (2.0 * std::log(2.0))));
}

double SigmaOfFit(const std::vector<double>& squared_distances_px2, int num_unknowns, const Loss& loss,
                  double start_px) {
  const double dof = std::max(1.0, 2.0 * static_cast<double>(squared_distances_px2.size()) - num_unknowns);
  double sigma = std::max(start_px, kMinSigmaPx);
  for (int iteration = 0; iteration < 100; ++iteration) {
    double sum = 0;
    for (const double d2 : squared_distances_px2) sum += loss.weight(d2 / (sigma * sigma)) * d2;
    const double next = std::max(kMinSigmaPx, std::sqrt(sum / (dof * loss.consistency)));
    const bool done = std::abs(next - sigma) <= 1e-9 * sigma;
    sigma = next;
    if (done) break;
  }
  return sigma;
}

}  // namespace heba
