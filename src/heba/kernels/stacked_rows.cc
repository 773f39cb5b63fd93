#include "heba/kernels/stacked_rows.h"

#include <algorithm>
#include <numeric>

#include "heba/base/error.h"
#include "heba/kernels/simd.h"

namespace heba {

static_assert(PaddedToLanes(StackedRows::kMaxRows) == StackedRows::kMaxRows);

StackedRows::StackedRows(int num_columns)
    : num_columns_(num_columns), products_(std::min(num_columns, kFewColumns), kMaxRows) {
  if (IsWide()) {
    const int padded = (num_columns + kManyColumnsUnit - 1) / kManyColumnsUnit * kManyColumnsUnit;
    wide_columns_.setZero(kMaxRows, padded);
    wide_products_.setZero(padded, padded);
  } else {
    std::fill_n(columns_[num_columns], kMaxRows, 0.0);
  }
}

double* StackedRows::NextColumns(Eigen::Index num_rows) {
  CHECK_LE(num_rows, kMaxRows);
  if (size_ + num_rows > kMaxRows) Multiply();
  double* const next = Columns() + size_;
  size_ += num_rows;
  return next;
}

void StackedRows::AddTo(Eigen::MatrixXd* matrix) {
  Multiply();
  if (IsWide()) {
    matrix->triangularView<Eigen::Lower>() += wide_products_.topLeftCorner(num_columns_, num_columns_);
    return;
  }
  int places[kFewColumns];
  std::iota(places, places + num_columns_, 0);
  products_.AddTo(places, 1.0, matrix);
}

Eigen::MatrixXd StackedRows::Products() {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(num_columns_, num_columns_);
  AddTo(&matrix);
  return matrix.selfadjointView<Eigen::Lower>();
}

void StackedRows::Multiply() {
  if (size_ == 0) return;
  const Eigen::Index padded = PaddedToLanes(size_);
  if (IsWide()) {
    wide_columns_.middleRows(size_, padded - size_).setZero();
    AddGramOfMany(wide_columns_.data(), kMaxRows, padded, &wide_products_);
    size_ = 0;
    return;
  }
  for (int c = 0; c < num_columns_; ++c) std::fill(columns_[c] + size_, columns_[c] + padded, 0.0);
  products_.Add(columns_[0], padded);
  size_ = 0;
}

}  // namespace heba
