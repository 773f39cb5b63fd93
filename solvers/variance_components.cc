#include "solvers/variance_components.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "heba/base/error.h"

namespace heba {
namespace {

constexpr Eigen::Index kMoved = 6;
using MovedRows = Eigen::Matrix<double, kMoved, Eigen::Dynamic>;

// Of a view's rows those that its correction moves, turned so that there are six; rows of zeros where it has fewer.
struct MovedView {
  MovedRows by_unknowns;
  Matrix6 by_correction = Matrix6::Zero();
  Tangent6 offset = Tangent6::Zero();
};

// The same measurements in fewer numbers: variances and unknowns have the same likelihood.
struct CondensedViews {
  std::vector<MovedView> moved;
  // Of all that no correction moves: the products of unknowns and offset, and of how many numbers they are.
  Eigen::MatrixXd still;
  double num_still = 0;
};

CondensedViews Condensed(const std::vector<LinearView>& views) {
  const Eigen::Index n = views.front().by_unknowns.cols();
  CondensedViews condensed;
  condensed.still.setZero(n + 1, n + 1);
  for (const LinearView& view : views) {
    const Eigen::Index rows = view.offset.size();
    condensed.still(n, n) += view.rest_squares;
    // Rows of zeros count for what they are: nothing.
    condensed.num_still += view.num_rest + static_cast<double>(rows - kMoved);
    Eigen::MatrixXd turned(rows, n + 1);
    turned << view.by_unknowns, view.offset;
    const Eigen::Index num_moved = std::min(rows, kMoved);
    MovedView moved;
    if (rows > kMoved) {
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(view.by_correction);
      turned.applyOnTheLeft(qr.householderQ().adjoint());
      moved.by_correction = qr.matrixQR().topRows<kMoved>().triangularView<Eigen::Upper>();
      const auto tail = turned.bottomRows(rows - kMoved);
      condensed.still.noalias() += tail.transpose() * tail;
    } else {
      moved.by_correction.topRows(rows) = view.by_correction;
    }
    moved.by_unknowns.setZero(kMoved, n);
    moved.by_unknowns.topRows(num_moved) = turned.topLeftCorner(num_moved, n);
    moved.offset.head(num_moved) = turned.col(n).head(num_moved);
    condensed.moved.push_back(std::move(moved));
  }
  return condensed;
}

// With S = p I + t A A^T + r B B^T, the covariance of a view's rows; by_correction is [A, B].
struct WhitenedView {
  double log_determinant = 0;
  Matrix6 inverse;        // S^-1
  MovedRows by_unknowns;  // S^-1 J
};
WhitenedView Whitened(const MovedView& view, const Eigen::Vector3d& variances) {
  Tangent6 corrections;
  corrections << Eigen::Vector3d::Constant(variances[1]), Eigen::Vector3d::Constant(variances[2]);
  const Matrix6 covariance = variances[0] * Matrix6::Identity() +
                             view.by_correction * corrections.asDiagonal() * view.by_correction.transpose();
  const Eigen::LLT<Matrix6> factor(covariance);
  if (factor.info() != Eigen::Success) return {std::numeric_limits<double>::quiet_NaN(), {}, {}};
  WhitenedView whitened;
  whitened.log_determinant = 2 * factor.matrixLLT().diagonal().array().log().sum();
  whitened.inverse = factor.solve(Matrix6::Identity());
  whitened.by_unknowns = whitened.inverse.lazyProduct(view.by_unknowns);
  return whitened;
}

// Sums of J^T S^-1 V_k S^-1 J, where V_k is what variance k multiplies.
class Falls {
 public:
  explicit Falls(Eigen::Index n) { sums_.fill(Eigen::MatrixXd::Zero(n, n)); }
  void Add(const MovedView& view, const WhitenedView& whitened) {
    const MovedRows moved = view.by_correction.transpose().lazyProduct(whitened.by_unknowns);
    const auto add = [](const auto& rows, Eigen::MatrixXd* sum) {
      sum->noalias() += rows.transpose().lazyProduct(rows);
    };
    add(whitened.by_unknowns, &sums_[0]);
    add(moved.topRows<3>(), &sums_[1]);
    add(moved.bottomRows<3>(), &sums_[2]);
  }
  Eigen::MatrixXd& operator[](int k) { return sums_[static_cast<size_t>(k)]; }

 private:
  std::array<Eigen::MatrixXd, 3> sums_;
};

// The restricted likelihood and its derivatives by the three variances.
struct Likelihood {
  double minus_log = std::numeric_limits<double>::infinity();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // Of the log.
  Eigen::Matrix3d fisher = Eigen::Matrix3d::Zero();
};

Likelihood Evaluate(const CondensedViews& views, const Eigen::Vector3d& variances) {
  const Eigen::Index n = views.still.cols() - 1;
  const double p = variances[0];
  const auto still = views.still.topLeftCorner(n, n);
  const Eigen::VectorXd still_right = views.still.col(n).head(n);
  Likelihood result;
  Eigen::MatrixXd information = still / p;
  Eigen::VectorXd right = still_right / p;
  double log_determinants = views.num_still * std::log(p);
  std::vector<WhitenedView> whitened_views;
  whitened_views.reserve(views.moved.size());
  for (const MovedView& view : views.moved) {
    const WhitenedView& whitened = whitened_views.emplace_back(Whitened(view, variances));
    if (std::isnan(whitened.log_determinant)) return result;
    log_determinants += whitened.log_determinant;
    information.noalias() += view.by_unknowns.transpose().lazyProduct(whitened.by_unknowns);
    right.noalias() += whitened.by_unknowns.transpose() * view.offset;
  }
  // Units of metres, radians and pixels side by side: scaled before it is factored.
  const Eigen::VectorXd scale =
      information.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * information * scale.asDiagonal());
  if (factor.info() != Eigen::Success) return result;
  log_determinants += 2 * factor.matrixLLT().diagonal().array().log().sum() - 2 * scale.array().log().sum();
  const Eigen::MatrixXd covariance =
      scale.asDiagonal() * factor.solve(Eigen::MatrixXd::Identity(n, n)) * scale.asDiagonal();
  const Eigen::VectorXd step = covariance * right;

  const double still_squares = views.still(n, n) - 2 * step.dot(still_right) + step.dot(still * step);
  const double still_seen = covariance.cwiseProduct(still).sum();
  double squares = still_squares / p;
  result.gradient[0] = 0.5 * ((still_squares + still_seen) / (p * p) - views.num_still / p);
  result.fisher(0, 0) = 0.5 * views.num_still / (p * p) - still_seen / (p * p * p);
  Falls falls(n);
  falls[0] = still / (p * p);
  // Of two variances, from S^-1 and S^-1 J C J^T S^-1 with what they multiply on either side.
  const auto fisher_of = [](const auto& inverse, const auto& seen) {
    return 0.5 * inverse.squaredNorm() - inverse.cwiseProduct(seen).sum();
  };
  for (size_t v = 0; v < views.moved.size(); ++v) {
    const MovedView& view = views.moved[v];
    const WhitenedView& whitened = whitened_views[v];
    const Tangent6 residual = view.offset - view.by_unknowns * step;
    const Tangent6 weighted = whitened.inverse * residual;
    squares += residual.dot(weighted);
    const MovedRows by_covariance = whitened.by_unknowns.lazyProduct(covariance);
    const Matrix6 seen = by_covariance.lazyProduct(whitened.by_unknowns.transpose());
    const Matrix6& g = view.by_correction;
    const Matrix6 inverse_g = whitened.inverse * g;
    const Matrix6 seen_g = seen * g;
    const Matrix6 g_inverse_g = g.transpose() * inverse_g;
    const Matrix6 g_seen_g = g.transpose() * seen_g;
    const Tangent6 g_weighted = g.transpose() * weighted;
    result.gradient[0] += 0.5 * (weighted.squaredNorm() - whitened.inverse.trace() + seen.trace());
    result.fisher(0, 0) += fisher_of(whitened.inverse, seen);
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
    falls.Add(view, whitened);
  }
  for (int k = 0; k < 3; ++k) falls[k] = (covariance * falls[k]).eval();
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l <= k; ++l) {
      result.fisher(k, l) += 0.5 * falls[k].cwiseProduct(falls[l].transpose()).sum();
      result.fisher(l, k) = result.fisher(k, l);
    }
  }
  result.minus_log = 0.5 * (log_determinants + squares);
  return result;
}

}  // namespace

VarianceComponents EstimateVariances(const std::vector<LinearView>& all_views, const VarianceComponents& start,
                                     bool pixel_is_free, bool robot_is_free) {
  CHECK(!all_views.empty());
  const CondensedViews views = Condensed(all_views);
  Eigen::Vector3d variances(start.pixel, start.translation_m2, start.rotation_rad2);
  const std::array<bool, 3> may_move = {pixel_is_free, robot_is_free, robot_is_free};
  Likelihood here = Evaluate(views, variances);
  constexpr int kMaxIterations = 100;
  constexpr double kMinPixelVariance = 1e-12;
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(here.minus_log); ++iteration) {
    // A variance at zero that wants to be less stays.
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
    double length = 1;
    bool has_moved = false;
    double change = 0;
    for (int halving = 0; halving < 30 && !has_moved; ++halving, length *= 0.5) {
      Eigen::Vector3d next = variances;
      for (Eigen::Index a = 0; a < size; ++a) {
        const int k = free[static_cast<size_t>(a)];
        next[k] = std::max(k == 0 ? kMinPixelVariance : 0.0, variances[k] + length * direction[a]);
      }
      const Likelihood there = Evaluate(views, next);
      if (!(there.minus_log <= here.minus_log)) continue;
      has_moved = true;
      for (Eigen::Index a = 0; a < size; ++a) {
        const int k = free[static_cast<size_t>(a)];
        // In units of what the data can tell.
        change = std::max(change, std::abs(next[k] - variances[k]) * std::sqrt(std::max(0.0, here.fisher(k, k))));
      }
      variances = next;
      here = there;
    }
    constexpr double kSmallChange = 1e-4;
    if (!has_moved || change < kSmallChange) break;
  }
  VarianceComponents result;
  result.pixel = variances[0];
  result.translation_m2 = variances[1];
  result.rotation_rad2 = variances[2];
  std::vector<int> uncertain;
  for (int k = 0; k < 3; ++k) {
    if (!may_move[static_cast<size_t>(k)] || !(here.fisher(k, k) > 0)) continue;
    result.stddev[k] = 1 / std::sqrt(here.fisher(k, k));
    // One that the data have put to zero is taken as such, and so is one that they cannot tell from it: it is more
    // likely too large than too small, so that the covariance is wide enough by itself.
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

double DegreesOfFreedom(const std::vector<LinearView>& all_views, const VarianceComponents& variances) {
  CHECK(!all_views.empty());
  constexpr double kCertain = std::numeric_limits<double>::infinity();
  constexpr double kLeast = 4;
  if (variances.covariance.isZero(0)) return kCertain;
  const CondensedViews views = Condensed(all_views);
  const Eigen::Index n = views.still.cols() - 1;
  const auto still = views.still.topLeftCorner(n, n);
  Eigen::MatrixXd information = still / variances.pixel;
  // How the information falls with each variance: J^T S^-1 V_k S^-1 J.
  Falls falls(n);
  falls[0] = still / (variances.pixel * variances.pixel);
  const Eigen::Vector3d components(variances.pixel, variances.translation_m2, variances.rotation_rad2);
  for (const MovedView& view : views.moved) {
    const WhitenedView whitened = Whitened(view, components);
    if (std::isnan(whitened.log_determinant)) return kLeast;
    information.noalias() += view.by_unknowns.transpose().lazyProduct(whitened.by_unknowns);
    falls.Add(view, whitened);
  }
  // In coordinates in which the covariance is the identity, and the variances' effects apart as far as they can be.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> root(scale.asDiagonal() * information * scale.asDiagonal());
  if (root.info() != Eigen::Success) return kLeast;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < 3; ++k) {
    Eigen::MatrixXd& fall = falls[k];
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
      slope[k] = eigen.eigenvectors().col(m).dot(falls[k] * eigen.eigenvectors().col(m));
    }
    const double dof = 2 / slope.dot(variances.covariance * slope);
    if (dof <= 2) return kLeast;
    sum += dof / (dof - 2);
  }
  return sum > static_cast<double>(n) ? std::max(kLeast, 2 * sum / (sum - static_cast<double>(n))) : kCertain;
}

}  // namespace heba
