#include "solvers/uncertainty/variance_components.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/kernels/small_matrix.h"
#include "heba/kernels/stacked_rows.h"

namespace heba {
namespace {

constexpr Eigen::Index kNumCorrectedRows = 6;
using CorrectedRows = Eigen::Matrix<double, kNumCorrectedRows, Eigen::Dynamic>;

// The rows of a view that depend on its correction, rotated such that there are six; padded with zeros if there are
// fewer.
struct CorrectedView {
  CorrectedRows rows;  // by_unknowns, and the offset as the last column.
  Matrix6 by_correction = Matrix6::Zero();
};

// The same measurements in fewer rows: the likelihood of variances and unknowns does not change.
struct CondensedViews {
  std::vector<CorrectedView> correction_dependent;
  // All rows that depend on no correction: the products of unknowns and offset, and the number of rows.
  Eigen::MatrixXd correction_independent;
  double num_independent = 0;
};

CondensedViews Condensed(const std::vector<LinearisedView>& views) {
  const Eigen::Index n = views.front().by_unknowns.cols();
  CondensedViews condensed;
  condensed.correction_independent.setZero(n + 1, n + 1);
  for (const LinearisedView& view : views) {
    const Eigen::Index rows = view.offset.size();
    condensed.correction_independent(n, n) += view.residual_sum_of_squares;
    // Padding with rows of zeros is not counted.
    condensed.num_independent += view.num_residual_dof + static_cast<double>(rows - kNumCorrectedRows);
    Eigen::MatrixXd rotated(rows, n + 1);
    rotated << view.by_unknowns, view.offset;
    CorrectedView& corrected = condensed.correction_dependent.emplace_back();
    corrected.rows.setZero(kNumCorrectedRows, n + 1);
    const Eigen::Index num_rows_with_correction = std::min(rows, kNumCorrectedRows);
    if (rows - view.num_rows_without_correction <= kNumCorrectedRows) {
      corrected.by_correction.topRows(num_rows_with_correction) = view.by_correction.topRows(num_rows_with_correction);
    } else {
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(view.by_correction);
      rotated.applyOnTheLeft(qr.householderQ().adjoint());
      corrected.by_correction = qr.matrixQR().topRows<kNumCorrectedRows>().triangularView<Eigen::Upper>();
    }
    corrected.rows.topRows(num_rows_with_correction) = rotated.topRows(num_rows_with_correction);
    const auto tail = rotated.bottomRows(rows - num_rows_with_correction);
    condensed.correction_independent.noalias() += tail.transpose() * tail;
  }
  return condensed;
}

// Whitens the views' rows with their covariance S = p I + t A A^T + r B B^T, where by_correction is [A, B].
class Whitening {
 public:
  Whitening(const CondensedViews& views, const Eigen::Vector3d& variances)
      : num_columns_(views.correction_independent.cols()) {
    StackedRows stacked(static_cast<int>(num_columns_));
    Tangent6 corrections;
    corrections << Eigen::Vector3d::Constant(variances[1]), Eigen::Vector3d::Constant(variances[2]);
    inverses_.reserve(views.correction_dependent.size());
    weighted_.resize(kNumCorrectedRows, num_columns_ * static_cast<Eigen::Index>(views.correction_dependent.size()));
    for (const CorrectedView& view : views.correction_dependent) {
      const Matrix6 by_sigma = view.by_correction * corrections.cwiseSqrt().asDiagonal();
      Matrix6 covariance = by_sigma * by_sigma.transpose();
      covariance.diagonal().array() += variances[0];
      const Eigen::LLT<Matrix6> root(covariance);
      is_regular_ &= root.info() == Eigen::Success;
      if (!is_regular_) return;
      log_determinants_ += 2 * root.matrixLLT().diagonal().array().log().sum();
      const Matrix6 inverse_root = InverseOfLower(root.matrixLLT());
      auto whitened = stacked.Next<kNumCorrectedRows>();
      whitened = inverse_root.lazyProduct(view.rows);
      const auto v = static_cast<Eigen::Index>(inverses_.size());
      weighted_.middleCols(v * num_columns_, num_columns_) = inverse_root.transpose().lazyProduct(whitened);
      inverses_.push_back(inverse_root.transpose() * inverse_root);
    }
    products_ = stacked.Products();
  }

  // Returns whether all covariances are invertible; if not, the other functions must not be called.
  bool is_regular() const { return is_regular_; }
  double log_determinants() const { return log_determinants_; }
  // Returns [J, y]^T S^-1 [J, y], summed over the views.
  const Eigen::MatrixXd& products() const { return products_; }
  const Matrix6& Inverse(size_t view) const { return inverses_[view]; }  // S^-1 of one view.
  // S^-1 [J, y] of one view.
  auto Weighted(size_t view) const {
    return weighted_.middleCols(static_cast<Eigen::Index>(view) * num_columns_, num_columns_);
  }

 private:
  Eigen::Index num_columns_;
  bool is_regular_ = true;
  double log_determinants_ = 0;
  std::vector<Matrix6> inverses_;
  CorrectedRows weighted_;
  Eigen::MatrixXd products_;
};

// Returns the negated derivatives of the information with respect to each variance: J^T S^-1 V_k S^-1 J, where V_k is
// the matrix that variance k multiplies in S.
std::array<Eigen::MatrixXd, 3> InformationDerivatives(const CondensedViews& views, const Whitening& whitening,
                                                      double pixel_variance) {
  const Eigen::Index n = views.correction_independent.cols() - 1;
  StackedRows pixels(static_cast<int>(n));
  StackedRows translations(static_cast<int>(n));
  StackedRows rotations(static_cast<int>(n));
  for (size_t v = 0; v < views.correction_dependent.size(); ++v) {
    const auto weighted = whitening.Weighted(v).leftCols(n);
    const Matrix6& by_correction = views.correction_dependent[v].by_correction;
    pixels.Next<kNumCorrectedRows>() = weighted;
    translations.Next<3>() = by_correction.leftCols<3>().transpose().lazyProduct(weighted);
    rotations.Next<3>() = by_correction.rightCols<3>().transpose().lazyProduct(weighted);
  }
  return {views.correction_independent.topLeftCorner(n, n) / (pixel_variance * pixel_variance) + pixels.Products(),
          translations.Products(), rotations.Products()};
}

// The restricted likelihood and its derivatives with respect to the three variances.
struct Likelihood {
  double minus_log = std::numeric_limits<double>::infinity();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // Gradient of the log-likelihood.
  Eigen::Matrix3d fisher = Eigen::Matrix3d::Zero();
};

Likelihood Evaluate(const CondensedViews& views, const Eigen::Vector3d& variances) {
  const Eigen::Index n = views.correction_independent.cols() - 1;
  const double p = variances[0];
  const auto correction_independent = views.correction_independent.topLeftCorner(n, n);
  const auto independent_right = views.correction_independent.col(n).head(n);
  Likelihood result;
  const Whitening whitening(views, variances);
  if (!whitening.is_regular()) return result;
  double log_determinants = views.num_independent * std::log(p) + whitening.log_determinants();
  const Eigen::MatrixXd products = views.correction_independent / p + whitening.products();
  const auto information = products.topLeftCorner(n, n);
  // Scaled before factorisation because metres, radians and pixels are mixed.
  const Eigen::VectorXd scale =
      information.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * information * scale.asDiagonal());
  if (factor.info() != Eigen::Success) return result;
  log_determinants += 2 * factor.matrixLLT().diagonal().array().log().sum() - 2 * scale.array().log().sum();
  const Eigen::MatrixXd covariance =
      scale.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(n, n)) * scale.asDiagonal();
  const Eigen::VectorXd step = covariance * products.col(n).head(n);

  const double independent_squares =
      views.correction_independent(n, n) - 2 * step.dot(independent_right) + step.dot(correction_independent * step);
  const double independent_seen = covariance.cwiseProduct(correction_independent).sum();
  double squares = independent_squares / p;
  result.gradient[0] = 0.5 * ((independent_squares + independent_seen) / (p * p) - views.num_independent / p);
  result.fisher(0, 0) = 0.5 * views.num_independent / (p * p) - independent_seen / (p * p * p);
  // Returns the element of the Fisher information for two variances, given S^-1 and S^-1 J C J^T S^-1, both
  // multiplied by the factors of V_k and V_l.
  const auto fisher_of = [](const auto& inverse, const auto& seen) {
    return 0.5 * inverse.squaredNorm() - inverse.cwiseProduct(seen).sum();
  };
  CorrectedRows by_covariance(kNumCorrectedRows, n);
  for (size_t v = 0; v < views.correction_dependent.size(); ++v) {
    const CorrectedView& view = views.correction_dependent[v];
    const Matrix6& inverse = whitening.Inverse(v);
    const auto by_unknowns = whitening.Weighted(v).leftCols(n);
    const Tangent6 residual = view.rows.col(n) - view.rows.leftCols(n).lazyProduct(step);
    const Tangent6 weighted = inverse * residual;
    squares += residual.dot(weighted);
    by_covariance = by_unknowns.lazyProduct(covariance);
    const Matrix6 seen = by_covariance.lazyProduct(by_unknowns.transpose());
    const Matrix6& g = view.by_correction;
    const Matrix6 inverse_g = inverse * g;
    const Matrix6 seen_g = seen * g;
    const Matrix6 g_inverse_g = g.transpose() * inverse_g;
    const Matrix6 g_seen_g = g.transpose() * seen_g;
    const Tangent6 g_weighted = g.transpose() * weighted;
    result.gradient[0] += 0.5 * (weighted.squaredNorm() - inverse.trace() + seen.trace());
    result.fisher(0, 0) += fisher_of(inverse, seen);
    for (int k = 1; k < 3; ++k) {
      const Eigen::Index at = 3 * (k - 1);
      result.gradient[k] +=
          0.5 * (g_weighted.segment<3>(at).squaredNorm() - g_inverse_g.diagonal().segment<3>(at).sum() +
                 g_seen_g.diagonal().segment<3>(at).sum());
      result.fisher(k, 0) += fisher_of(inverse_g.middleCols<3>(at), seen_g.middleCols<3>(at));
      for (int l = 1; l <= k; ++l) {
        result.fisher(k, l) +=
            fisher_of(g_inverse_g.block<3, 3>(at, 3 * (l - 1)), g_seen_g.block<3, 3>(at, 3 * (l - 1)));
      }
    }
  }
  std::array<Eigen::MatrixXd, 3> derivatives = InformationDerivatives(views, whitening, p);
  for (Eigen::MatrixXd& fall : derivatives) fall = (covariance * fall).eval();
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l <= k; ++l) {
      result.fisher(k, l) +=
          0.5 * derivatives[static_cast<size_t>(k)].cwiseProduct(derivatives[static_cast<size_t>(l)].transpose()).sum();
      result.fisher(l, k) = result.fisher(k, l);
    }
  }
  result.minus_log = 0.5 * (log_determinants + squares);
  return result;
}

// Adds a log-normal density of sigma_k = sqrt(variances[k]), k = 1, 2, expressed in the logarithm of the variance.
void AddPrior(const RobotNoisePrior& prior, const Eigen::Vector3d& variances, Likelihood* likelihood) {
  const double medians[] = {0, prior.median.translation_m, prior.median.rotation_rad};
  const double log_variance_sigma = 2 * prior.log_sigma;
  for (int k = 1; k < 3; ++k) {
    const double v = variances[k];
    if (!(v > 0)) {
      likelihood->minus_log = std::numeric_limits<double>::infinity();
      return;
    }
    const double distance = (std::log(v) - 2 * std::log(medians[k])) / log_variance_sigma;
    likelihood->minus_log += 0.5 * distance * distance;
    likelihood->gradient[k] -= distance / (log_variance_sigma * v);
    likelihood->fisher(k, k) += 1 / std::pow(log_variance_sigma * v, 2);
  }
}

Likelihood EvaluateWithPrior(const CondensedViews& views, const Eigen::Vector3d& variances,
                             const RobotNoisePrior* prior) {
  Likelihood likelihood = Evaluate(views, variances);
  if (prior != nullptr) AddPrior(*prior, variances, &likelihood);
  return likelihood;
}

}  // namespace

RobotNoisePrior IndustrialArmPrior() {
  // The 95 % interval of the logarithm is 2 x 1.96 sigmas wide, and its bounds differ by a factor of 20.
  const double log_sigma = std::log(20.0) / (2 * 1.96);
  return {{std::sqrt(0.05e-3 * 1e-3), DegToRad(std::sqrt(0.005 * 0.1))}, log_sigma};
}

double RestrictedLogLikelihood(const std::vector<LinearisedView>& all_views, double unit_px,
                               const VarianceComponents& variances, Eigen::Index num_common,
                               const RobotNoisePrior* prior) {
  CHECK(!all_views.empty());
  std::vector<LinearisedView> views = all_views;
  double num_rows = 0;
  for (LinearisedView& view : views) {
    view.by_unknowns.conservativeResize(Eigen::NoChange, num_common);
    num_rows += static_cast<double>(view.offset.size() + view.num_residual_dof);
  }
  const Eigen::Vector3d at(variances.pixel, variances.translation_m2, variances.rotation_rad2);
  return -EvaluateWithPrior(Condensed(views), at, prior).minus_log - num_rows * std::log(unit_px);
}

VarianceComponents EstimateVariances(const std::vector<LinearisedView>& all_views, const VarianceComponents& start,
                                     bool pixel_is_free, bool robot_is_free, double small_change,
                                     const RobotNoisePrior* prior) {
  CHECK(!all_views.empty());
  const CondensedViews views = Condensed(all_views);
  Eigen::Vector3d variances(start.pixel, start.translation_m2, start.rotation_rad2);
  const std::array<bool, 3> may_move = {pixel_is_free, robot_is_free, robot_is_free};
  Likelihood here = EvaluateWithPrior(views, variances, prior);
  constexpr int kMaxIterations = 100;
  constexpr double kMinPixelVariance = 1e-12;
  constexpr double kMostFall = 0.1;  // Largest decrease per step, towards a zero that a prior excludes.
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(here.minus_log); ++iteration) {
    // A variance at zero stays there unless its gradient is positive.
    std::vector<int> free;
    for (int k = 0; k < 3; ++k) {
      if (may_move[static_cast<size_t>(k)] && (variances[k] > 0 || here.gradient[k] > 0)) free.push_back(k);
    }
    if (free.empty()) break;
    const Eigen::Index size = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd fisher(size, size);
    Eigen::VectorXd gradient(size);
    for (Eigen::Index a = 0; a < size; ++a) {
      gradient[a] = here.gradient[free[static_cast<size_t>(a)]];
      for (Eigen::Index b = 0; b < size; ++b) {
        fisher(a, b) = here.fisher(free[static_cast<size_t>(a)], free[static_cast<size_t>(b)]);
      }
    }
    const Eigen::VectorXd scale = fisher.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
    const Eigen::MatrixXd scaled = scale.asDiagonal() * fisher * scale.asDiagonal();
    const Eigen::VectorXd direction =
        scale.asDiagonal() *
        (scaled + 1e-9 * Eigen::MatrixXd::Identity(size, size)).ldlt().solve(scale.cwiseProduct(gradient));
    if (!direction.allFinite()) break;
    const auto moved_by = [&](double length) {
      Eigen::Vector3d next = variances;
      for (Eigen::Index a = 0; a < size; ++a) {
        const int k = free[static_cast<size_t>(a)];
        const double least = k == 0 ? kMinPixelVariance : prior != nullptr ? kMostFall * variances[k] : 0.0;
        next[k] = std::max(least, variances[k] + length * direction[a]);
      }
      return next;
    };
    // The change is measured in units of the variances' standard deviations.
    const Eigen::Vector3d unit = here.fisher.diagonal().cwiseMax(0).cwiseSqrt();
    const Eigen::Vector3d last = moved_by(1);
    if ((last - variances).cwiseAbs().cwiseProduct(unit).maxCoeff() < small_change) {
      // The curvature at the previous point is used for the uncertainties.
      variances = last;
      break;
    }
    bool has_moved = false;
    double length = 1;
    for (int halving = 0; halving < 30 && !has_moved; ++halving, length *= 0.5) {
      const Eigen::Vector3d next = moved_by(length);
      Likelihood there = EvaluateWithPrior(views, next, prior);
      if (!(there.minus_log <= here.minus_log)) continue;
      has_moved = true;
      variances = next;
      here = there;
    }
    if (!has_moved) break;
  }
  VarianceComponents result;
  result.pixel = variances[0];
  result.translation_m2 = variances[1];
  result.rotation_rad2 = variances[2];
  std::vector<int> uncertain;
  for (int k = 0; k < 3; ++k) {
    if (!may_move[static_cast<size_t>(k)] || !(here.fisher(k, k) > 0)) continue;
    result.stddev[k] = 1 / std::sqrt(here.fisher(k, k));
    // A variance that is zero is taken as certain, and so is one that cannot be told from zero: it is more likely too
    // large than too small, so the covariance is wide enough without further degrees of freedom.
    constexpr double kToldFromZero = 0.75;
    if (result.stddev[k] < kToldFromZero * variances[k]) uncertain.push_back(k);
  }
  const Eigen::Index size = static_cast<Eigen::Index>(uncertain.size());
  if (size > 0) {
    Eigen::MatrixXd fisher = here.fisher(uncertain, uncertain);
    const Eigen::VectorXd scale = fisher.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd inverse =
        (scale.asDiagonal() * fisher * scale.asDiagonal()).ldlt().solve(Eigen::MatrixXd::Identity(size, size));
    result.covariance(uncertain, uncertain) = scale.asDiagonal() * inverse * scale.asDiagonal();
  }
  return result;
}

double DegreesOfFreedom(const std::vector<LinearisedView>& all_views, const VarianceComponents& variances) {
  CHECK(!all_views.empty());
  constexpr double kCertain = std::numeric_limits<double>::infinity();
  constexpr double kLeast = 4;
  if (variances.covariance.isZero(0)) return kCertain;
  const CondensedViews views = Condensed(all_views);
  const Eigen::Index n = views.correction_independent.cols() - 1;
  const Whitening whitening(views, {variances.pixel, variances.translation_m2, variances.rotation_rad2});
  if (!whitening.is_regular()) return kLeast;
  const Eigen::MatrixXd information =
      (views.correction_independent / variances.pixel + whitening.products()).topLeftCorner(n, n);
  std::array<Eigen::MatrixXd, 3> derivatives = InformationDerivatives(views, whitening, variances.pixel);
  // Coordinates in which the covariance is the identity, and in which the effects of the variances are decoupled as
  // far as possible.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> root(scale.asDiagonal() * information * scale.asDiagonal());
  if (root.info() != Eigen::Success) return kLeast;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < 3; ++k) {
    Eigen::MatrixXd& fall = derivatives[static_cast<size_t>(k)];
    fall = (scale.asDiagonal() * fall * scale.asDiagonal()).eval();
    fall = root.matrixL().solve(fall).eval();
    fall = root.matrixL().solve(fall.transpose()).eval();
    total += std::sqrt(variances.covariance(k, k)) * fall;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(total);
  double sum = 0;
  for (Eigen::Index m = 0; m < n; ++m) {
    Eigen::Vector3d slope;
    for (int k = 0; k < 3; ++k) {
      slope[k] = eigen.eigenvectors().col(m).dot(derivatives[static_cast<size_t>(k)] * eigen.eigenvectors().col(m));
    }
    const double dof = 2 / slope.dot(variances.covariance * slope);
    if (dof <= 2) return kLeast;
    sum += dof / (dof - 2);
  }
  return sum > static_cast<double>(n) ? std::max(kLeast, 2 * sum / (sum - static_cast<double>(n))) : kCertain;
}

}  // namespace heba
