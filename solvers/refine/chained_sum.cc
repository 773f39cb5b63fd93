#include "solvers/refine/chained_sum.h"

#include <algorithm>

#include "heba/base/factorisation.h"
#include "heba/kernels/simd.h"

namespace heba {
namespace {

static_assert(PaddedToLanes(2 * ChainedSum::kFewPoints) <= StackedRows::kMaxRows);

// Returns whether a derivative of the chain rule is -I, as for the hand-eye pose, whose tangent is in the camera frame.
bool IsMirror(const Matrix6& chain) { return chain == -Matrix6::Identity(); }

// Applies the chain rule to one column of all rows.
void ChainColumn(const ViewRows& rows, const Tangent6& chain, double* to) {
  const Eigen::Index stride = rows.columns.outerStride();
  for (Eigen::Index first = 0; first < rows.columns.rows(); first += kMaxLanes) {
    double sums[kMaxLanes] = {};
    for (int k = 0; k < 6; ++k) {
      const double* const by_left = rows.columns.data() + k * stride + first;
      for (int i = 0; i < kMaxLanes; ++i) sums[i] += by_left[i] * chain[k];
    }
    std::copy_n(sums, kMaxLanes, to + first);
  }
}

}  // namespace

void ColumnPlaces::Append(Eigen::Index to, Eigen::Index size) {
  if (size == 0) return;
  const Eigen::Index from = segments.empty() ? 0 : segments.back().from + segments.back().size;
  if (!segments.empty() && segments.back().to + segments.back().size == to) {
    segments.back().size += size;
  } else {
    segments.push_back({from, to, size});
  }
}

ChainedSum::ChainedSum(const std::vector<UnknownBlock>& poses, const std::vector<UnknownBlock>& effects,
                       Eigen::Index num_columns)
    : poses_(poses), effects_(effects), num_columns_(num_columns), rows_of_effects_(effects.size()) {
  matrix_.setZero(num_columns, num_columns);
}

void ChainedSum::AddRows(const ViewRows& rows, const KinematicLoop& loop, const LoopDerivatives& derivatives,
                         const ColumnPlaces& places) {
  if (!stacked_) stacked_.emplace(static_cast<int>(num_columns_));
  const Eigen::Index num_rows = rows.columns.rows();
  double* const columns = stacked_->NextColumns(num_rows);
  const auto from = [&](Eigen::Index c) { return rows.columns.data() + c * rows.columns.outerStride(); };
  const auto to = [&](Eigen::Index c) { return columns + c * StackedRows::kMaxRows; };
  Eigen::Index num_written = 0;
  for (size_t k = 0; k < loop.shared().size(); ++k) {
    const Matrix6& chain = derivatives.shared[k];
    const Eigen::Index first = PoseColumn(loop.shared()[k]);
    const bool is_mirror = IsMirror(chain);
    for (int c = 0; c < 6; ++c) {
      if (is_mirror) {
        for (Eigen::Index i = 0; i < num_rows; ++i) to(first + c)[i] = -from(c)[i];
      } else {
        ChainColumn(rows, chain.col(c), to(first + c));
      }
    }
    num_written += 6;
  }
  for (size_t e = 0; e < loop.effects().size(); ++e) {
    const Matrix6X& chain = derivatives.effects[e];
    for (Eigen::Index c = 0; c < chain.cols(); ++c) {
      ChainColumn(rows, chain.col(c), to(EffectColumn(loop.effects()[e]) + c));
    }
    num_written += chain.cols();
  }
  for (const ColumnPlaces::Segment& segment : places.segments) {
    for (Eigen::Index c = 0; c < segment.size; ++c) {
      std::copy_n(from(6 + segment.from + c), num_rows, to(segment.to + c));
    }
    num_written += segment.size;
  }
  // Other cameras, targets and poses have no part in this view.
  if (num_written == num_columns_) return;
  std::vector<char> is_written(static_cast<size_t>(num_columns_), 0);
  const auto mark = [&](Eigen::Index first, Eigen::Index size) { std::fill_n(is_written.begin() + first, size, 1); };
  for (const int pose : loop.shared()) mark(PoseColumn(pose), 6);
  for (const int effect : loop.effects()) mark(EffectColumn(effect), effects_[static_cast<size_t>(effect)].size);
  for (const ColumnPlaces::Segment& segment : places.segments) mark(segment.to, segment.size);
  for (Eigen::Index c = 0; c < num_columns_; ++c) {
    if (!is_written[static_cast<size_t>(c)]) std::fill_n(to(c), num_rows, 0.0);
  }
}

void ChainedSum::AddProducts(const Eigen::MatrixXd& products, const KinematicLoop& loop,
                             const LoopDerivatives& derivatives, const ColumnPlaces& places) {
  const Matrix6 by_pose = products.topLeftCorner<6, 6>();
  const Eigen::Index num_others = products.cols() - 6;
  const Eigen::Ref<const Eigen::MatrixXd> others_by_pose = products.block(6, 0, num_others, 6);
  for (size_t k = 0; k < loop.shared().size(); ++k) {
    const Matrix6& chain = derivatives.shared[k];
    const Eigen::Index first = PoseColumn(loop.shared()[k]);
    const bool is_mirror = IsMirror(chain);
    const Matrix6 half = is_mirror ? Matrix6(-by_pose) : Matrix6(chain.transpose() * by_pose);
    for (size_t l = 0; l < k; ++l) {
      matrix_.block<6, 6>(first, PoseColumn(loop.shared()[l])).noalias() += half * derivatives.shared[l];
    }
    if (is_mirror) {
      matrix_.block<6, 6>(first, first) += by_pose;
    } else {
      matrix_.block<6, 6>(first, first).noalias() += half * chain;
    }
    for (const ColumnPlaces::Segment& segment : places.segments) {
      const auto others = others_by_pose.middleRows(segment.from, segment.size);
      auto sum = matrix_.block(segment.to, first, segment.size, 6);
      if (is_mirror) {
        sum -= others;
      } else {
        sum.noalias() += others.lazyProduct(chain);
      }
    }
  }
  for (size_t e = 0; e < loop.effects().size(); ++e) {
    const Matrix6X& chain = derivatives.effects[e];
    const Eigen::Index first = EffectColumn(loop.effects()[e]);
    const Eigen::MatrixXd half = chain.transpose().lazyProduct(by_pose);
    for (size_t l = 0; l < loop.shared().size(); ++l) {
      matrix_.block(first, PoseColumn(loop.shared()[l]), chain.cols(), 6) += half.lazyProduct(derivatives.shared[l]);
    }
    for (size_t l = 0; l < e; ++l) {
      const Matrix6X& other = derivatives.effects[l];
      matrix_.block(first, EffectColumn(loop.effects()[l]), chain.cols(), other.cols()) += half.lazyProduct(other);
    }
    // The products of many effects with each other are most of the work, and equal those of six rows.
    if (const auto root = Cholesky(by_pose)) {
      std::optional<StackedRows>& rows = rows_of_effects_[static_cast<size_t>(loop.effects()[e])];
      if (!rows) rows.emplace(static_cast<int>(chain.cols()));
      rows->Next<6>() = root->lower().triangularView<Eigen::Lower>().transpose() * chain;
    } else {
      matrix_.block(first, first, chain.cols(), chain.cols()) += half.lazyProduct(chain);
    }
    for (const ColumnPlaces::Segment& segment : places.segments) {
      matrix_.block(segment.to, first, segment.size, chain.cols()) +=
          others_by_pose.middleRows(segment.from, segment.size).lazyProduct(chain);
    }
  }
  for (const ColumnPlaces::Segment& right : places.segments) {
    for (const ColumnPlaces::Segment& left : places.segments) {
      if (left.to > right.to) continue;
      matrix_.block(right.to, left.to, right.size, left.size) +=
          products.block(6 + right.from, 6 + left.from, right.size, left.size);
    }
  }
}

void ChainedSum::AddOwnRows(const Eigen::MatrixXd& products, const KinematicLoop& loop,
                            const LoopDerivatives& derivatives, const ColumnPlaces& places,
                            Eigen::MatrixXd* own_rows) const {
  const Matrix6 by_pose = products.topLeftCorner<6, 6>();
  const Eigen::Ref<const Matrix6X> others_by_pose = products.topRightCorner(6, products.cols() - 6);
  for (size_t j = 0; j < loop.own().size(); ++j) {
    const Eigen::Index row = 6 * loop.own()[j];
    const Matrix6 left = derivatives.own[j].transpose();
    const Matrix6 half = left * by_pose;
    for (size_t k = 0; k < loop.shared().size(); ++k) {
      const Matrix6& chain = derivatives.shared[k];
      auto sum = own_rows->block<6, 6>(row, PoseColumn(loop.shared()[k]));
      if (IsMirror(chain)) {
        sum -= half;
      } else {
        sum.noalias() += half * chain;
      }
    }
    for (size_t e = 0; e < loop.effects().size(); ++e) {
      const Matrix6X& chain = derivatives.effects[e];
      own_rows->block(row, EffectColumn(loop.effects()[e]), 6, chain.cols()) += half.lazyProduct(chain);
    }
    for (const ColumnPlaces::Segment& segment : places.segments) {
      own_rows->block(row, segment.to, 6, segment.size).noalias() +=
          left.lazyProduct(others_by_pose.middleCols(segment.from, segment.size));
    }
  }
}

template <int kRows>
Eigen::MatrixXd ChainedSum::EliminateRows(const NuisanceMatrix& normal, const Eigen::MatrixXd& own_rows) {
  using Square = Eigen::Matrix<double, kRows, kRows>;
  using Rows = Eigen::Matrix<double, kRows, Eigen::Dynamic>;
  const auto root = Cholesky(Square(normal));
  if (!root) {
    // The views do not determine a pose, and there is no prior.
    Eigen::MatrixXd step = SolveSymmetric(normal, own_rows);
    matrix_.noalias() -= own_rows.transpose() * step;
    return step;
  }
  const Square inverse_root = InverseOfLower(root->lower());
  if (!eliminated_) eliminated_.emplace(static_cast<int>(num_columns_));
  auto whitened = eliminated_->Next<kRows>(own_rows.rows());
  whitened = inverse_root.lazyProduct(Eigen::Map<const Rows>(own_rows.data(), own_rows.rows(), own_rows.cols()));
  return inverse_root.transpose().lazyProduct(whitened);
}

Eigen::MatrixXd ChainedSum::Eliminate(const NuisanceMatrix& normal, const Eigen::MatrixXd& own_rows) {
  constexpr int kOnePose = 6;
  return normal.rows() == kOnePose ? EliminateRows<kOnePose>(normal, own_rows)
                                   : EliminateRows<Eigen::Dynamic>(normal, own_rows);
}

ChainedSum::Result ChainedSum::Finish() {
  for (size_t e = 0; e < effects_.size(); ++e) {
    if (!rows_of_effects_[e]) continue;
    matrix_.block(effects_[e].first, effects_[e].first, effects_[e].size, effects_[e].size) +=
        rows_of_effects_[e]->Products();
  }
  if (stacked_) stacked_->AddTo(&matrix_);
  if (eliminated_) matrix_ -= eliminated_->Products();
  return {std::move(matrix_), loss_remainder_};
}

}  // namespace heba
