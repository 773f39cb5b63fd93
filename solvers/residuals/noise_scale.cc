#include "solvers/residuals/noise_scale.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/median.h"

namespace heba {

double SigmaFromMedian(std::vector<double> squared_distances_px2) {
  if (squared_distances_px2.empty()) return kMinSigmaPx;
  return std::max(kMinSigmaPx, std::sqrt(Median(std::move(squared_distances_px2)) / (2.0 * std::log(2.0))));
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

std::optional<double> TypicalDetectorSigma(const std::vector<const Observations*>& all) {
  std::vector<double> variances_px2;  // One per point.
  for (const Observations* const observations : all) {
    for (const Eigen::MatrixXd& block : observations->covariances_px2) {
      for (Eigen::Index i = 0; i < block.rows(); i += 2) {
        variances_px2.push_back(0.5 * (block(i, i) + block(i + 1, i + 1)));
      }
    }
  }
  if (variances_px2.empty()) return std::nullopt;
  return std::sqrt(Median(std::move(variances_px2)));
}

std::optional<double> TypicalDetectorSigma(const std::vector<View>& views) {
  std::vector<const Observations*> all;
  for (const View& view : views) all.push_back(&view.observations);
  return TypicalDetectorSigma(all);
}

void WeightByCovariance(double unmodelled_sigma_px, const std::vector<Observations*>& all) {
  const std::optional<double> typical_px =
      TypicalDetectorSigma(std::vector<const Observations*>(all.begin(), all.end()));
  if (!typical_px) return;
  const double unit_px2 = *typical_px * *typical_px + unmodelled_sigma_px * unmodelled_sigma_px;
  for (Observations* const observations : all) {
    observations->whitening.clear();
    for (const Eigen::MatrixXd& block : observations->covariances_px2) {
      const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(block.rows(), block.cols());
      const auto factor = Cholesky((block + unmodelled_sigma_px * unmodelled_sigma_px * identity) / unit_px2);
      CHECK(factor.has_value()) << "a detector's covariance is not positive definite";
      observations->whitening.emplace_back(factor->SolveLower(identity));
    }
  }
}

}  // namespace heba
