#include "solvers/uncertainty/restricted_likelihood.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <type_traits>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/inverse_root.h"
#include "heba/kernels/small_matrix.h"
#include "heba/kernels/stacked_rows.h"

namespace heba {
namespace {

using Kind = VarianceGroup::Kind;

// The effects in the order of their groups: one range of columns for each group of them.
struct EffectColumns {
  struct Range {
    Eigen::Index group = 0;
    Eigen::Index first = 0;
    Eigen::Index size = 0;
  };
  std::vector<Eigen::Index> order;  // Columns of LinearisedView::by_effects.
  std::vector<Range> ranges;

  explicit EffectColumns(const std::vector<VarianceGroup>& groups) {
    for (size_t k = 0; k < groups.size(); ++k) {
      if (groups[k].kind != Kind::kEffects) continue;
      ranges.push_back({static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(order.size()),
                        static_cast<Eigen::Index>(groups[k].columns.size())});
      order.insert(order.end(), groups[k].columns.begin(), groups[k].columns.end());
    }
  }
  Eigen::Index size() const { return static_cast<Eigen::Index>(order.size()); }
};

// Calls f with the size as a constant, which is quicker for the common one: three coordinates.
template <class F>
void WithSize(Eigen::Index size, const F& f) {
  constexpr int kAxes = 3;
  if (size == kAxes) {
    f(std::integral_constant<int, kAxes>());
  } else {
    f(std::integral_constant<int, Eigen::Dynamic>());
  }
}

// The unknowns with a variance, in the order of their groups.
struct SharedColumns {
  std::vector<Eigen::Index> columns;  // Columns of LinearisedView::by_unknowns.
  std::vector<Eigen::Index> groups;   // The group of each.

  explicit SharedColumns(const std::vector<VarianceGroup>& all) {
    for (size_t k = 0; k < all.size(); ++k) {
      if (all[k].kind != Kind::kUnknowns) continue;
      columns.insert(columns.end(), all[k].columns.begin(), all[k].columns.end());
      groups.insert(groups.end(), all[k].columns.size(), static_cast<Eigen::Index>(k));
    }
  }
};

// kRows: the number of rows of a capture that depend on its effects, which is the number of effects without
// combinations of others. kEffects: the number of effects. Both may be known at compile time.
template <int kRows, int kEffects>
class LikelihoodOfRows final : public RestrictedLikelihood {
 public:
  LikelihoodOfRows(const std::vector<LinearisedView>& views, const std::vector<VarianceGroup>& groups)
      : num_groups_(static_cast<Eigen::Index>(groups.size())),
        num_unknowns_(views.front().by_unknowns.cols()),
        effects_(groups),
        shared_(groups),
        num_rows_(std::min(effects_.size(), views.front().by_effects.cols() - views.front().num_combined_effects)) {
    independent_.setZero(num_unknowns_ + 1, num_unknowns_ + 1);
    for (const LinearisedView& view : views) Add(view);
    for (Eigen::Index k = 0; k < num_unknowns_; ++k) {
      if (independent_(k, k) > 0) num_independent_columns_ = k + 1;
    }
  }

  Likelihood At(const Eigen::VectorXd& variances, Curvature curvature) const override;
  std::optional<InformationAndDerivatives> InformationAt(const Eigen::VectorXd& variances) const override;

 private:
  using Square = Eigen::Matrix<double, kRows, kRows>;
  using ByEffects = Eigen::Matrix<double, kRows, kEffects>;
  using EffectSquare = Eigen::Matrix<double, kEffects, kEffects>;
  using EffectVector = Eigen::Matrix<double, kEffects, 1>;
  using Rows = Eigen::Matrix<double, kRows, Eigen::Dynamic>;

  // The rows of a capture that depend on its effects, rotated such that there are num_rows_; padded with zeros if there
  // are fewer.
  struct DependentRows {
    Rows rows;  // by_unknowns, and the offset as the last column.
    ByEffects by_effects;
  };

  // Whitens the captures' rows with their covariance S = p I + sum of v_k A_k A_k^T, where A_k are the columns of
  // by_effects of group k.
  class Whitening {
   public:
    Whitening(const LikelihoodOfRows& of, const Eigen::VectorXd& variances) : num_columns_(of.num_unknowns_ + 1) {
      StackedRows stacked(static_cast<int>(num_columns_));
      EffectVector sigmas(of.effects_.size());
      for (const EffectColumns::Range& range : of.effects_.ranges) {
        sigmas.segment(range.first, range.size).setConstant(std::sqrt(variances[range.group]));
      }
      inverses_.reserve(of.dependent_.size());
      weighted_.resize(of.num_rows_, num_columns_ * static_cast<Eigen::Index>(of.dependent_.size()));
      for (const DependentRows& capture : of.dependent_) {
        const ByEffects by_sigma = capture.by_effects * sigmas.asDiagonal();
        Square covariance = by_sigma * by_sigma.transpose();
        covariance.diagonal().array() += variances[0];
        const auto root = Cholesky(covariance);
        is_regular_ &= root.has_value();
        if (!is_regular_) return;
        log_determinants_ += root->LogDeterminant();
        const Square inverse_root = InverseOfLower(root->lower());
        auto whitened = stacked.Next<kRows>(of.num_rows_);
        whitened = inverse_root.lazyProduct(capture.rows);
        const auto v = static_cast<Eigen::Index>(inverses_.size());
        weighted_.middleCols(v * num_columns_, num_columns_) = inverse_root.transpose().lazyProduct(whitened);
        inverses_.push_back(inverse_root.transpose() * inverse_root);
      }
      products_ = stacked.Products();
    }

    // Returns whether all covariances are invertible; if not, the other functions must not be called.
    bool is_regular() const { return is_regular_; }
    double log_determinants() const { return log_determinants_; }
    // Returns [J, y]^T S^-1 [J, y], summed over the captures.
    const Eigen::MatrixXd& products() const { return products_; }
    const Square& Inverse(size_t capture) const { return inverses_[capture]; }  // S^-1 of one capture.
    // S^-1 [J, y] of one capture.
    auto Weighted(size_t capture) const {
      return weighted_.middleCols(static_cast<Eigen::Index>(capture) * num_columns_, num_columns_);
    }

    // Returns J^T S^-1: num_rows_ columns for each capture.
    Eigen::MatrixXd ByUnknowns() const {
      const Eigen::Index n = num_columns_ - 1;
      const Eigen::Index num_rows = weighted_.rows();
      Eigen::MatrixXd transposed(n, num_rows * static_cast<Eigen::Index>(inverses_.size()));
      for (size_t v = 0; v < inverses_.size(); ++v) {
        transposed.middleCols(static_cast<Eigen::Index>(v) * num_rows, num_rows) = Weighted(v).leftCols(n).transpose();
      }
      return transposed;
    }

   private:
    Eigen::Index num_columns_;
    bool is_regular_ = true;
    double log_determinants_ = 0;
    std::vector<Square> inverses_;
    Rows weighted_;
    Eigen::MatrixXd products_;
  };

  // Adds the same measurements in fewer rows: the likelihood of variances and unknowns does not change.
  void Add(const LinearisedView& view) {
    const Eigen::Index n = num_unknowns_;
    const Eigen::Index num_rows = view.offset.size();
    independent_(n, n) += view.residual_sum_of_squares;
    // Padding with rows of zeros is not counted.
    num_independent_ += view.num_residual_dof + static_cast<double>(num_rows - num_rows_);
    Eigen::MatrixXd rotated(num_rows, n + 1);
    rotated << view.by_unknowns, view.offset;
    const Eigen::Index num_dependent = std::min(num_rows, num_rows_);
    if (num_rows_ > 0) {
      const Eigen::MatrixXd by_effects = view.by_effects(Eigen::all, effects_.order);
      DependentRows& capture = dependent_.emplace_back();
      capture.rows.setZero(num_rows_, n + 1);
      capture.by_effects.setZero(num_rows_, effects_.size());
      if (num_rows - view.num_rows_without_effects <= num_rows_) {
        capture.by_effects.topRows(num_dependent) = by_effects.topRows(num_dependent);
      } else {
        // Columns that combine others span nothing more than those, and no rows of their own.
        const Eigen::Index num_independent = view.by_effects.cols() - view.num_combined_effects;
        const HouseholderFactor factor(effects_.size() < num_independent ? by_effects
                                                                         : view.by_effects.leftCols(num_independent));
        rotated = factor.Rotated(rotated);
        capture.by_effects = factor.Rotated(by_effects).topRows(num_rows_);
      }
      capture.rows.topRows(num_dependent) = rotated.topRows(num_dependent);
    }
    const auto tail = rotated.bottomRows(num_rows - num_dependent);
    independent_.noalias() += tail.transpose() * tail;
  }

  // Returns the negated derivatives of the information with respect to each variance: J^T S^-1 V_k S^-1 J, where V_k is
  // the matrix that variance k multiplies in S. Those of groups of unknowns are empty.
  std::vector<Eigen::MatrixXd> DerivativesOf(const Whitening& whitening, double pixel_variance) const {
    const Eigen::Index n = num_unknowns_;
    StackedRows pixels(static_cast<int>(n));
    std::vector<StackedRows> of_effects;
    of_effects.reserve(effects_.ranges.size());
    for (size_t k = 0; k < effects_.ranges.size(); ++k) of_effects.emplace_back(static_cast<int>(n));
    for (size_t v = 0; v < dependent_.size(); ++v) {
      const auto weighted = whitening.Weighted(v).leftCols(n);
      pixels.Next<kRows>(num_rows_) = weighted;
      for (size_t k = 0; k < of_effects.size(); ++k) {
        const EffectColumns::Range& range = effects_.ranges[k];
        WithSize(range.size, [&](auto size) {
          of_effects[k].template Next<size()>(range.size) =
              dependent_[v]
                  .by_effects.template middleCols<size()>(range.first, range.size)
                  .transpose()
                  .lazyProduct(weighted);
        });
      }
    }
    std::vector<Eigen::MatrixXd> derivatives(static_cast<size_t>(num_groups_));
    derivatives[0] = independent_.topLeftCorner(n, n) / (pixel_variance * pixel_variance) + pixels.Products();
    for (size_t k = 0; k < of_effects.size(); ++k) {
      derivatives[static_cast<size_t>(effects_.ranges[k].group)] = of_effects[k].Products();
    }
    return derivatives;
  }

  // C, the unknowns C J^T S^-1 y and the log-determinant of the inverse of C in units of the priors' sigmas.
  struct EstimatedUnknowns {
    Eigen::MatrixXd covariance;
    Eigen::VectorXd step;
    double log_determinant = 0;
  };
  // Returns nothing if the captures and the priors do not determine the unknowns. `products` are [J, y]^T S^-1 [J, y].
  std::optional<EstimatedUnknowns> EstimateUnknowns(const Eigen::MatrixXd& products,
                                                    const Eigen::VectorXd& variances) const;

  // The unknowns at some variances, and what they are estimated from.
  struct Estimated {
    Whitening whitening;
    Eigen::MatrixXd products;  // [J, y]^T S^-1 [J, y] of all rows.
    EstimatedUnknowns unknowns;
  };
  // Returns nothing if the variances make a covariance singular, or do not determine the unknowns.
  std::optional<Estimated> EstimateAt(const Eigen::VectorXd& variances) const {
    Whitening whitening(*this, variances);
    if (!whitening.is_regular()) return std::nullopt;
    Eigen::MatrixXd products = independent_ / variances[0] + whitening.products();
    std::optional<EstimatedUnknowns> unknowns = EstimateUnknowns(products, variances);
    if (!unknowns) return std::nullopt;
    return Estimated{std::move(whitening), std::move(products), std::move(*unknowns)};
  }

  // Returns the sum of the squares of the unknowns that have a prior, in units of their sigmas.
  double SquaresOfPriors(const Eigen::VectorXd& step, const Eigen::VectorXd& variances) const {
    double squares = 0;
    for (size_t i = 0; i < shared_.columns.size(); ++i) {
      const double variance = variances[shared_.groups[i]];
      if (variance > 0) squares += step[shared_.columns[i]] * step[shared_.columns[i]] / variance;
    }
    return squares;
  }

  // A Spread has J^T S^-1 and C J^T S^-1, num_rows_ columns for each capture, and the captures' S^-1 J C J^T S^-1.
  struct Spread {
    Eigen::MatrixXd by_unknowns;
    Eigen::MatrixXd of_unknowns;
    std::vector<Square> seen;
  };

  // Adds the scores of the variances of unknowns and their average information. `pulls` are J^T S^-1 V_k P y of the
  // other variances, which belong to the groups `sources`.
  void AddAverageOfUnknowns(const Estimated& at, const Eigen::VectorXd& variances, const Eigen::MatrixXd& pulls,
                            const std::vector<Eigen::Index>& sources, Likelihood* likelihood) const;

  // Returns the expected information about all variances.
  Eigen::MatrixXd ExpectedInformation(const Estimated& at, const Spread& spread,
                                      const Eigen::VectorXd& variances) const;
  // Return the lower triangle of that about the variances of pixels and effects: from the projection P of the rows,
  // whose blocks are those of pairs of captures, or from the derivatives of the information about the unknowns.
  Eigen::MatrixXd ExpectedByRows(const Estimated& at, const Spread& spread, double pixel_variance) const;
  Eigen::MatrixXd ExpectedByUnknowns(const Estimated& at, const Spread& spread, double pixel_variance) const;

  Eigen::Index num_groups_;
  Eigen::Index num_unknowns_;
  EffectColumns effects_;
  SharedColumns shared_;
  Eigen::Index num_rows_;
  std::vector<DependentRows> dependent_;
  // All rows that depend on no effect: the products of unknowns and offset, and the number of rows.
  Eigen::MatrixXd independent_;
  double num_independent_ = 0;
  Eigen::Index num_independent_columns_ = 0;  // The unknowns after these have no such rows.
};

// Returns the element of the Fisher information for two variances, given S^-1 and S^-1 J C J^T S^-1, both multiplied by
// the factors of V_k and V_l.
template <class Inverse, class Seen>
double FisherOf(const Inverse& inverse, const Seen& seen) {
  return 0.5 * inverse.squaredNorm() - inverse.cwiseProduct(seen).sum();
}

// Returns 1/2 tr(C F_k C F_l) for each pair of F, the derivatives that are not empty, in the lower triangle.
Eigen::MatrixXd FisherOfUnknowns(const Eigen::MatrixXd& covariance, const std::vector<Eigen::MatrixXd>& derivatives) {
  const auto size = static_cast<Eigen::Index>(derivatives.size());
  Eigen::MatrixXd fisher = Eigen::MatrixXd::Zero(size, size);
  std::vector<Eigen::MatrixXd> falls(derivatives.size());
  for (size_t k = 0; k < derivatives.size(); ++k) {
    if (derivatives[k].size() > 0) falls[k] = InnerProducts(covariance, derivatives[k]);  // Both are symmetric.
  }
  for (size_t k = 0; k < falls.size(); ++k) {
    for (size_t l = 0; l <= k; ++l) {
      if (falls[k].size() == 0 || falls[l].size() == 0) continue;
      fisher(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(l)) =
          0.5 * falls[k].cwiseProduct(falls[l].transpose()).sum();
    }
  }
  return fisher;
}

template <int kRows, int kEffects>
auto LikelihoodOfRows<kRows, kEffects>::EstimateUnknowns(const Eigen::MatrixXd& products,
                                                         const Eigen::VectorXd& variances) const
    -> std::optional<EstimatedUnknowns> {
  const Eigen::Index n = num_unknowns_;
  // The unknowns in units of their prior's sigma, so that a sigma of zero is allowed.
  Eigen::VectorXd units = Eigen::VectorXd::Ones(n);
  for (size_t i = 0; i < shared_.columns.size(); ++i) {
    units[shared_.columns[i]] = std::sqrt(variances[shared_.groups[i]]);
  }
  Eigen::MatrixXd information = units.asDiagonal() * products.topLeftCorner(n, n) * units.asDiagonal();
  for (const Eigen::Index column : shared_.columns) information(column, column) += 1;
  // Scaled before factorisation because metres, radians and pixels are mixed.
  const Eigen::VectorXd scale =
      information.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const std::optional<Eigen::MatrixXd> root = InverseRootOf(scaled);
  if (!root) return std::nullopt;
  const Eigen::VectorXd all_units = units.cwiseProduct(scale);
  EstimatedUnknowns unknowns;
  unknowns.covariance = all_units.asDiagonal() * InnerProducts(*root, *root) * all_units.asDiagonal();
  unknowns.step = unknowns.covariance * products.col(n).head(n);
  unknowns.log_determinant = -2 * (root->diagonal().array().log().sum() + scale.array().log().sum());
  return unknowns;
}

// With the unknowns' columns J, the covariance S of the captures' rows and D, the prior variances of unknowns that have
// one, the covariance of all rows is S + J D J^T. Its projection P = S^-1 - S^-1 J C J^T S^-1, where C is the inverse
// of J^T S^-1 J + D^-1 (no row for a prior that does not exist, and the limit for a variance of zero), gives
// likelihood, scores and information of every variance (Harville 1977, equations 3.3 to 3.6). P y is S^-1 (y - J step),
// the weighted residual, so that V_k P y is one vector for each variance: the residual itself for the pixels, A_k A_k^T
// of it for a group of effects, and J_g pulls_g for a group of unknowns.
template <int kRows, int kEffects>
Likelihood LikelihoodOfRows<kRows, kEffects>::At(const Eigen::VectorXd& variances, Curvature curvature) const {
  const Eigen::Index n = num_unknowns_;
  const double p = variances[0];
  const auto independent = independent_.topLeftCorner(n, n);
  Likelihood result;
  result.gradient.setZero(num_groups_);
  result.average.setZero(num_groups_, num_groups_);
  if (curvature == Curvature::kAverageAndExpected) result.fisher = result.average;
  const std::optional<Estimated> at = EstimateAt(variances);
  if (!at) return result;
  const auto& [whitening, products, unknowns] = *at;
  const auto& [covariance, step, log_determinant] = unknowns;
  Spread spread{whitening.ByUnknowns(), {}, {}};
  spread.of_unknowns = InnerProducts(covariance, spread.by_unknowns);
  spread.seen.reserve(dependent_.size());
  std::vector<Eigen::Index> sources = {0};
  for (const EffectColumns::Range& range : effects_.ranges) sources.push_back(range.group);
  const auto num_sources = static_cast<Eigen::Index>(sources.size());
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(num_sources, num_sources);  // (V_k P y)^T S^-1 V_l P y
  Eigen::MatrixXd pulls = Eigen::MatrixXd::Zero(n, num_sources);

  const Eigen::VectorXd by_independent = independent_.col(n).head(n) - independent * step;
  const double independent_squares =
      independent_(n, n) - step.dot(independent_.col(n).head(n)) - step.dot(by_independent);
  double squares = independent_squares / p + SquaresOfPriors(step, variances);
  whole(0, 0) = independent_squares / (p * p * p);
  pulls.col(0) = by_independent / (p * p);
  Eigen::VectorXd twice = Eigen::VectorXd::Zero(num_sources);  // Twice the gradients.
  twice[0] = (independent_squares + covariance.cwiseProduct(independent).sum()) / (p * p) - num_independent_ / p;
  Rows vectors(num_rows_, num_sources);
  for (size_t v = 0; v < dependent_.size(); ++v) {
    const DependentRows& capture = dependent_[v];
    const Square& inverse = whitening.Inverse(v);
    const auto weighted = whitening.Weighted(v);
    vectors.col(0) = weighted.col(n) - weighted.leftCols(n).lazyProduct(step);
    squares += vectors.col(0).dot(capture.rows.col(n) - capture.rows.leftCols(n).lazyProduct(step));
    spread.seen.push_back(weighted.leftCols(n).lazyProduct(
        spread.of_unknowns.middleCols(static_cast<Eigen::Index>(v) * num_rows_, num_rows_)));
    const Square open = inverse - spread.seen.back();  // The block of P.
    twice[0] += vectors.col(0).squaredNorm() - open.trace();
    const ByEffects open_a = open * capture.by_effects;
    for (size_t k = 0; k < effects_.ranges.size(); ++k) {
      const EffectColumns::Range& range = effects_.ranges[k];
      WithSize(range.size, [&](auto size) {
        const auto a = capture.by_effects.template middleCols<size()>(range.first, range.size);
        const auto source = static_cast<Eigen::Index>(k) + 1;
        const Eigen::Matrix<double, size(), 1> along = a.transpose() * vectors.col(0);
        vectors.col(source).noalias() = a * along;
        twice[source] +=
            along.squaredNorm() - open_a.template middleCols<size()>(range.first, range.size).cwiseProduct(a).sum();
      });
    }
    whole.noalias() += vectors.transpose() * (inverse * vectors);
    pulls.noalias() += weighted.leftCols(n).transpose() * vectors;
  }
  const Eigen::MatrixXd average = 0.5 * (whole - pulls.transpose() * (covariance * pulls));
  result.gradient(sources) = 0.5 * twice;
  result.average(sources, sources) = average;
  if (!shared_.columns.empty()) AddAverageOfUnknowns(*at, variances, pulls, sources, &result);
  if (curvature == Curvature::kAverageAndExpected) result.fisher = ExpectedInformation(*at, spread, variances);
  const double log_determinants = num_independent_ * std::log(p) + whitening.log_determinants() + log_determinant;
  result.minus_log = 0.5 * (log_determinants + squares);
  return result;
}

template <int kRows, int kEffects>
Eigen::MatrixXd LikelihoodOfRows<kRows, kEffects>::ExpectedByUnknowns(const Estimated& at, const Spread& spread,
                                                                      double pixel_variance) const {
  const Eigen::Index n = num_unknowns_;
  const double p = pixel_variance;
  const Eigen::MatrixXd& covariance = at.unknowns.covariance;
  const double independent_seen = covariance.cwiseProduct(independent_.topLeftCorner(n, n)).sum();
  Eigen::MatrixXd fisher = FisherOfUnknowns(covariance, DerivativesOf(at.whitening, p));
  fisher(0, 0) += 0.5 * num_independent_ / (p * p) - independent_seen / (p * p * p);
  for (size_t v = 0; v < dependent_.size(); ++v) {
    const ByEffects& a = dependent_[v].by_effects;
    const Square& inverse = at.whitening.Inverse(v);
    const Square& seen = spread.seen[v];
    const ByEffects inverse_a = inverse * a;
    const ByEffects seen_a = seen * a;
    const EffectSquare a_inverse_a = a.transpose() * inverse_a;
    const EffectSquare a_seen_a = a.transpose() * seen_a;
    fisher(0, 0) += FisherOf(inverse, seen);
    for (const EffectColumns::Range& k : effects_.ranges) {
      fisher(k.group, 0) += FisherOf(inverse_a.middleCols(k.first, k.size), seen_a.middleCols(k.first, k.size));
      for (const EffectColumns::Range& l : effects_.ranges) {
        if (l.group > k.group) break;
        fisher(k.group, l.group) += FisherOf(a_inverse_a.block(k.first, l.first, k.size, l.size),
                                             a_seen_a.block(k.first, l.first, k.size, l.size));
      }
    }
  }
  return fisher;
}

template <int kRows, int kEffects>
Eigen::MatrixXd LikelihoodOfRows<kRows, kEffects>::ExpectedByRows(const Estimated& at, const Spread& spread,
                                                                  double pixel_variance) const {
  const double p = pixel_variance;
  const auto independent = independent_.topLeftCorner(num_independent_columns_, num_independent_columns_);
  const auto of_unknowns = spread.of_unknowns.topRows(num_independent_columns_);
  const Eigen::MatrixXd by_independent =
      independent * at.unknowns.covariance.topLeftCorner(num_independent_columns_, num_independent_columns_);
  const Eigen::MatrixXd seen = InnerProducts(spread.by_unknowns, spread.of_unknowns);
  const Eigen::MatrixXd of_independent = InnerProducts(independent, of_unknowns);
  Eigen::MatrixXd fisher = Eigen::MatrixXd::Zero(num_groups_, num_groups_);
  fisher(0, 0) = 0.5 / (p * p) *
                 (num_independent_ - 2 / p * by_independent.trace() +
                  by_independent.cwiseProduct(by_independent.transpose()).sum() / (p * p));
  for (size_t v = 0; v < dependent_.size(); ++v) {
    const auto first = static_cast<Eigen::Index>(v) * num_rows_;
    const ByEffects& a = dependent_[v].by_effects;
    // The pixels of the other rows, which no effect moves, against the variances of this capture.
    const Square pixels =
        of_unknowns.middleCols(first, num_rows_).transpose().lazyProduct(of_independent.middleCols(first, num_rows_));
    const ByEffects pixels_a = pixels * a;
    fisher(0, 0) += pixels.trace() / (p * p);
    for (const EffectColumns::Range& k : effects_.ranges) {
      fisher(k.group, 0) +=
          0.5 / (p * p) * pixels_a.middleCols(k.first, k.size).cwiseProduct(a.middleCols(k.first, k.size)).sum();
    }
    for (size_t w = 0; w < dependent_.size(); ++w) {
      Square open = -seen.block(first, static_cast<Eigen::Index>(w) * num_rows_, num_rows_, num_rows_);
      if (v == w) open += at.whitening.Inverse(v);
      const Eigen::Matrix<double, kEffects, kRows> a_open = a.transpose() * open;
      const EffectSquare a_open_a = a_open * dependent_[w].by_effects;
      fisher(0, 0) += 0.5 * open.squaredNorm();
      for (const EffectColumns::Range& k : effects_.ranges) {
        fisher(k.group, 0) += 0.5 * a_open.middleRows(k.first, k.size).squaredNorm();
        for (const EffectColumns::Range& l : effects_.ranges) {
          if (l.group > k.group) break;
          fisher(k.group, l.group) += 0.5 * a_open_a.block(k.first, l.first, k.size, l.size).squaredNorm();
        }
      }
    }
  }
  return fisher;
}

template <int kRows, int kEffects>
Eigen::MatrixXd LikelihoodOfRows<kRows, kEffects>::ExpectedInformation(const Estimated& at, const Spread& spread,
                                                                       const Eigen::VectorXd& variances) const {
  const Eigen::Index n = num_unknowns_;
  const double p = variances[0];
  const Eigen::MatrixXd& products = at.products;
  const Eigen::MatrixXd& covariance = at.unknowns.covariance;
  // From three rows per unknown on, the products of rows cost more than those of unknowns.
  const bool has_few_rows = spread.by_unknowns.cols() < 3 * n;
  Eigen::MatrixXd fisher = has_few_rows ? ExpectedByRows(at, spread, p) : ExpectedByUnknowns(at, spread, p);
  if (shared_.columns.empty()) return fisher.selfadjointView<Eigen::Lower>();

  const auto num_shared = static_cast<Eigen::Index>(shared_.columns.size());
  const auto place_of = [&](Eigen::Index a) { return shared_.columns[static_cast<size_t>(a)]; };
  const auto group_of = [&](Eigen::Index a) { return shared_.groups[static_cast<size_t>(a)]; };
  // The columns g of I - C J^T S^-1 J, for the unknowns g with a variance. If the variance is above zero, they follow
  // from C (J^T S^-1 J + D^-1) = I without a difference, which would lose all digits where the captures tell far more
  // than the prior.
  Eigen::MatrixXd left(n, num_shared);
  for (Eigen::Index a = 0; a < num_shared; ++a) {
    const Eigen::Index g = place_of(a);
    const double variance = variances[group_of(a)];
    if (variance > 0) {
      left.col(a) = covariance.col(g) / variance;
    } else {
      left.col(a).noalias() = -covariance * products.col(g).head(n);
      left(g, a) += 1;
    }
  }
  for (Eigen::Index a = 0; a < num_shared; ++a) {
    const Eigen::Index group = group_of(a);
    for (Eigen::Index b = 0; b < num_shared; ++b) {
      const Eigen::Index other = group_of(b);
      if (other > group) continue;
      // J_g^T P J_h, in the same way. On the diagonal, this is a difference itself, which is small where the captures
      // tell less than the prior.
      const double share_of_prior = left(place_of(a), b);
      const bool is_from_prior = variances[group] > 0 && variances[other] > 0 && (a != b || share_of_prior < 0.5);
      const double seen = is_from_prior ? ((a == b ? 1 : 0) - share_of_prior) / variances[group]
                                        : products.col(place_of(a)).head(n).dot(left.col(b));
      fisher(group, other) += 0.5 * seen * seen;
    }
  }
  // J_g^T P V_k P J_g for the variances of the other groups, from the rows S^-1 J `left`.
  Eigen::MatrixXd rows(spread.by_unknowns.cols(), num_shared);
  for (Eigen::Index a = 0; a < num_shared; ++a) {
    const double variance = variances[group_of(a)];
    if (variance > 0) {
      rows.col(a) = spread.of_unknowns.row(place_of(a)).transpose() / variance;
    } else {
      rows.col(a).noalias() = spread.by_unknowns.transpose() * left.col(a);
    }
  }
  const auto add = [&](Eigen::Index other, Eigen::Index a, double seen) {
    fisher(std::max(group_of(a), other), std::min(group_of(a), other)) += 0.5 * seen;
  };
  const auto of_independent = left.topRows(num_independent_columns_);
  const Eigen::MatrixXd by_independent =
      independent_.topLeftCorner(num_independent_columns_, num_independent_columns_) * of_independent;
  for (Eigen::Index a = 0; a < num_shared; ++a) {
    add(0, a, rows.col(a).squaredNorm() + of_independent.col(a).dot(by_independent.col(a)) / (p * p));
  }
  for (size_t v = 0; v < dependent_.size(); ++v) {
    const Eigen::Matrix<double, kEffects, Eigen::Dynamic> a_rows =
        dependent_[v].by_effects.transpose() * rows.middleRows(static_cast<Eigen::Index>(v) * num_rows_, num_rows_);
    for (const EffectColumns::Range& k : effects_.ranges) {
      for (Eigen::Index a = 0; a < num_shared; ++a) {
        add(k.group, a, a_rows.col(a).segment(k.first, k.size).squaredNorm());
      }
    }
  }
  return fisher.selfadjointView<Eigen::Lower>();
}

template <int kRows, int kEffects>
void LikelihoodOfRows<kRows, kEffects>::AddAverageOfUnknowns(const Estimated& at, const Eigen::VectorXd& variances,
                                                             const Eigen::MatrixXd& pulls,
                                                             const std::vector<Eigen::Index>& sources,
                                                             Likelihood* likelihood) const {
  const Eigen::Index n = num_unknowns_;
  const auto& [whitening, products, unknowns] = at;
  const Eigen::MatrixXd& covariance = unknowns.covariance;
  const auto information = products.topLeftCorner(n, n);
  // J_g^T P y of each group, zero elsewhere, and the matrix (I - C J^T S^-1 J) times it, as in ExpectedInformation.
  Eigen::MatrixXd along = Eigen::MatrixXd::Zero(n, num_groups_);
  for (size_t i = 0; i < shared_.columns.size(); ++i) {
    const Eigen::Index g = shared_.columns[i];
    const Eigen::Index group = shared_.groups[i];
    const double variance = variances[group];
    const bool has_variance = variance > 0;
    const double pull =
        has_variance ? unknowns.step[g] / variance : products(g, n) - information.col(g).dot(unknowns.step);
    along(g, group) = pull;
    // J_g^T P J_g: a difference that is small where the captures tell less than the prior.
    const double share_of_prior = has_variance ? covariance(g, g) / variance : 0;
    double seen = 0;
    if (!has_variance) {
      seen = information(g, g) - information.col(g).dot(covariance * information.col(g));
    } else if (share_of_prior < 0.5) {
      seen = (1 - share_of_prior) / variance;
    } else {
      seen = information.col(g).dot(covariance.col(g)) / variance;
    }
    likelihood->gradient[group] += 0.5 * (pull * pull - seen);
  }
  std::vector<Eigen::Index> groups = shared_.groups;
  groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  for (const Eigen::Index group : groups) {
    const double variance = variances[group];
    const Eigen::VectorXd left = variance > 0 ? Eigen::VectorXd(covariance * along.col(group) / variance)
                                              : along.col(group) - covariance * (information * along.col(group));
    for (size_t k = 0; k < sources.size(); ++k) {
      const double average = 0.5 * pulls.col(static_cast<Eigen::Index>(k)).dot(left);
      likelihood->average(group, sources[k]) = average;
      likelihood->average(sources[k], group) = average;
    }
    const Eigen::VectorXd seen = information * left;
    for (const Eigen::Index other : groups) {
      if (other > group) break;
      likelihood->average(group, other) = 0.5 * along.col(other).dot(seen);
      likelihood->average(other, group) = likelihood->average(group, other);
    }
  }
}

template <int kRows, int kEffects>
std::optional<InformationAndDerivatives> LikelihoodOfRows<kRows, kEffects>::InformationAt(
    const Eigen::VectorXd& variances) const {
  const Eigen::Index n = num_unknowns_;
  const Whitening whitening(*this, variances);
  if (!whitening.is_regular()) return std::nullopt;
  InformationAndDerivatives result;
  result.information = (independent_ / variances[0] + whitening.products()).topLeftCorner(n, n);
  result.derivatives = DerivativesOf(whitening, variances[0]);
  for (Eigen::MatrixXd& derivative : result.derivatives) {
    if (derivative.size() == 0) derivative.setZero(n, n);
  }
  std::vector<bool> is_zero(static_cast<size_t>(n), false);
  for (size_t i = 0; i < shared_.columns.size(); ++i) {
    const Eigen::Index column = shared_.columns[i];
    const double variance = variances[shared_.groups[i]];
    is_zero[static_cast<size_t>(column)] = !(variance > 0);
    if (!(variance > 0)) continue;
    result.information(column, column) += 1 / variance;
    result.derivatives[static_cast<size_t>(shared_.groups[i])](column, column) = 1 / (variance * variance);
  }
  std::vector<Eigen::Index> active;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!is_zero[static_cast<size_t>(i)]) active.push_back(i);
  }
  if (static_cast<Eigen::Index>(active.size()) < n) {
    result.information = Eigen::MatrixXd(result.information(active, active));
    for (Eigen::MatrixXd& derivative : result.derivatives) derivative = Eigen::MatrixXd(derivative(active, active));
  }
  return result;
}

}  // namespace

std::unique_ptr<RestrictedLikelihood> MakeLikelihood(const std::vector<LinearisedView>& views,
                                                     const std::vector<VarianceGroup>& groups) {
  CHECK(!views.empty());
  CHECK(!groups.empty() && groups.front().kind == Kind::kPixels);
  constexpr int kOnePose = 6;
  const Eigen::Index num_effects = EffectColumns(groups).size();
  const bool has_one_pose =
      views.front().by_effects.cols() - views.front().num_combined_effects == kOnePose && num_effects >= kOnePose;
  if (has_one_pose && num_effects == kOnePose) {
    return std::make_unique<LikelihoodOfRows<kOnePose, kOnePose>>(views, groups);
  }
  if (has_one_pose) return std::make_unique<LikelihoodOfRows<kOnePose, Eigen::Dynamic>>(views, groups);
  return std::make_unique<LikelihoodOfRows<Eigen::Dynamic, Eigen::Dynamic>>(views, groups);
}

}  // namespace heba
