#include "heba/kernels/gram_matrix.h"

#include <algorithm>
#include <numeric>

#include "heba/base/error.h"
#include "heba/kernels/simd.h"

namespace heba {
namespace {

// The pairs of columns on and below the diagonal are processed in blocks of kBlock by two columns. The sums of one
// block fit into the registers.
constexpr int kBlock = 4;

// Calls `wide` or `narrow` for each block with its first column i on the one side, its first column j on the other
// side, and the index of its first sum.
template <class Wide, class Narrow>
HEBA_INLINE void ForEachBlock(int num_columns, const Wide& wide, const Narrow& narrow) {
  int sum = 0;
  int i = 0;
  for (; i + kBlock <= num_columns; i += kBlock) {
    for (int j = 0; j < i + kBlock; j += 2, sum += 2 * kBlock) wide(i, j, sum);
  }
  for (; i < num_columns; i += 2) {
    for (int j = 0; j < i + 2; j += 2, sum += 4) narrow(i, j, sum);
  }
}

template <int kLanes, int kRows, int kColumns = 2>
HEBA_INLINE void AddBlock(const double* a, const double* b, Eigen::Index stride, Eigen::Index num_rows, double* sums) {
  using V = Lanes<kLanes>;
  V s[kRows][kColumns];
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < kColumns; ++j) s[i][j] = LoadLanes<V>(sums + (kColumns * i + j) * kLanes);
  }
  for (Eigen::Index k = 0; k < num_rows; k += kLanes) {
    V of_b[kColumns];
    for (int j = 0; j < kColumns; ++j) of_b[j] = LoadLanes<V>(b + j * stride + k);
    for (int i = 0; i < kRows; ++i) {
      const V ai = LoadLanes<V>(a + i * stride + k);
      for (int j = 0; j < kColumns; ++j) s[i][j] += ai * of_b[j];
    }
  }
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < kColumns; ++j) StoreLanes(s[i][j], sums + (kColumns * i + j) * kLanes);
  }
}

// Products of many columns are computed in blocks of kBlock by this number of columns: the registers of AVX-512 hold
// more sums.
template <int kLanes>
constexpr int kWide = kLanes == kLanesOf<Simd::kAvx512> ? 4 : 2;

template <int kLanes>
HEBA_INLINE void AddRows(const double* columns, Eigen::Index stride, int num_columns, Eigen::Index num_rows,
                         double* sums) {
  ForEachBlock(
      num_columns,
      [&](int i, int j, int sum) __attribute__((always_inline)) {
        AddBlock<kLanes, kBlock>(columns + i * stride, columns + j * stride, stride, num_rows, sums + sum * kLanes);
      },
      [&](int i, int j, int sum) __attribute__((always_inline)) {
        AddBlock<kLanes, 2>(columns + i * stride, columns + j * stride, stride, num_rows, sums + sum * kLanes);
      });
}

void AddRowsBaseline(const double* columns, Eigen::Index stride, int num_columns, Eigen::Index num_rows, double* sums) {
  AddRows<kLanesOf<Simd::kBaseline>>(columns, stride, num_columns, num_rows, sums);
}
HEBA_TARGET_AVX2 void AddRowsAvx2(const double* columns, Eigen::Index stride, int num_columns, Eigen::Index num_rows,
                                  double* sums) {
  AddRows<kLanesOf<Simd::kAvx2>>(columns, stride, num_columns, num_rows, sums);
}
HEBA_TARGET_AVX512 void AddRowsAvx512(const double* columns, Eigen::Index stride, int num_columns,
                                      Eigen::Index num_rows, double* sums) {
  AddRows<kLanesOf<Simd::kAvx512>>(columns, stride, num_columns, num_rows, sums);
}

// Adds up the lanes of the sum of each pair of columns.
template <int kLanes>
HEBA_INLINE void SumLanes(const double* lanes, int num_sums, double* sums) {
  using V = Lanes<kLanes>;
  int i = 0;
  for (; i + kLanes <= num_sums; i += kLanes) {
    V some[kLanes];
    for (int k = 0; k < kLanes; ++k) some[k] = LoadLanes<V>(lanes + (i + k) * kLanes);
    StoreLanes(SumsOfLanes(some), sums + i);
  }
  for (; i < num_sums; ++i) sums[i] = SumOfLanes(LoadLanes<V>(lanes + i * kLanes));
}
void SumLanesBaseline(const double* lanes, int num_sums, double* sums) {
  SumLanes<kLanesOf<Simd::kBaseline>>(lanes, num_sums, sums);
}
HEBA_TARGET_AVX2 void SumLanesAvx2(const double* lanes, int num_sums, double* sums) {
  SumLanes<kLanesOf<Simd::kAvx2>>(lanes, num_sums, sums);
}
HEBA_TARGET_AVX512 void SumLanesAvx512(const double* lanes, int num_sums, double* sums) {
  SumLanes<kLanesOf<Simd::kAvx512>>(lanes, num_sums, sums);
}

// Returns the inner products of kBlock columns of `a` and kWide columns of `b`.
template <int kLanes>
HEBA_INLINE void SumBlock(const double* a, const double* b, Eigen::Index stride, Eigen::Index num_rows, double* sums) {
  alignas(64) double lanes[kWide<kLanes> * kBlock * kLanes] = {};
  AddBlock<kLanes, kBlock, kWide<kLanes>>(a, b, stride, num_rows, lanes);
  SumLanes<kLanes>(lanes, kWide<kLanes> * kBlock, sums);
}

template <int kLanes>
HEBA_INLINE void AddProducts(const double* columns, Eigen::Index stride, Eigen::Index num_columns,
                             Eigen::Index num_rows, double* products) {
  for (Eigen::Index i = 0; i < num_columns; i += kBlock) {
    for (Eigen::Index j = 0; j < i + kBlock; j += kWide<kLanes>) {
      double sums[kWide<kLanes> * kBlock];
      SumBlock<kLanes>(columns + i * stride, columns + j * stride, stride, num_rows, sums);
      for (Eigen::Index row = 0; row < kBlock; ++row) {
        for (Eigen::Index column = 0; column < kWide<kLanes>; ++column) {
          products[(j + column) * num_columns + i + row] += sums[kWide<kLanes> * row + column];
        }
      }
    }
  }
}
void AddProductsBaseline(const double* columns, Eigen::Index stride, Eigen::Index num_columns, Eigen::Index num_rows,
                         double* products) {
  AddProducts<kLanesOf<Simd::kBaseline>>(columns, stride, num_columns, num_rows, products);
}
HEBA_TARGET_AVX2 void AddProductsAvx2(const double* columns, Eigen::Index stride, Eigen::Index num_columns,
                                      Eigen::Index num_rows, double* products) {
  AddProducts<kLanesOf<Simd::kAvx2>>(columns, stride, num_columns, num_rows, products);
}
HEBA_TARGET_AVX512 void AddProductsAvx512(const double* columns, Eigen::Index stride, Eigen::Index num_columns,
                                          Eigen::Index num_rows, double* products) {
  AddProducts<kLanesOf<Simd::kAvx512>>(columns, stride, num_columns, num_rows, products);
}

// A few columns of b at a time stay near, and those of a pass by.
template <int kLanes>
HEBA_INLINE void Multiply(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd* products) {
  for (Eigen::Index j = 0; j < b.cols(); j += kWide<kLanes>) {
    for (Eigen::Index i = 0; i < a.cols(); i += kBlock) {
      double sums[kWide<kLanes> * kBlock];
      SumBlock<kLanes>(a.data() + i * a.rows(), b.data() + j * b.rows(), a.rows(), a.rows(), sums);
      double* const to = products->data() + j * products->rows() + i;
      for (Eigen::Index row = 0; row < kBlock; ++row) {
        for (Eigen::Index column = 0; column < kWide<kLanes>; ++column) {
          to[column * products->rows() + row] = sums[kWide<kLanes> * row + column];
        }
      }
    }
  }
}
void MultiplyBaseline(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd* products) {
  Multiply<kLanesOf<Simd::kBaseline>>(a, b, products);
}
HEBA_TARGET_AVX2 void MultiplyAvx2(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd* products) {
  Multiply<kLanesOf<Simd::kAvx2>>(a, b, products);
}
HEBA_TARGET_AVX512 void MultiplyAvx512(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd* products) {
  Multiply<kLanesOf<Simd::kAvx512>>(a, b, products);
}

// Returns the matrix with rows of zeros up to a multiple of kMaxLanes, and columns up to one of `unit`.
Eigen::MatrixXd Padded(const Eigen::Ref<const Eigen::MatrixXd>& matrix, Eigen::Index unit) {
  Eigen::MatrixXd padded =
      Eigen::MatrixXd::Zero(PaddedToLanes(matrix.rows()), (matrix.cols() + unit - 1) / unit * unit);
  padded.topLeftCorner(matrix.rows(), matrix.cols()) = matrix;
  return padded;
}

int Even(int number) { return number + number % 2; }

int NumSums(int num_columns) {
  int num_sums = 0;
  ForEachBlock(
      num_columns, [&](int, int, int sum) { num_sums = sum + 2 * kBlock; },
      [&](int, int, int sum) { num_sums = sum + 4; });
  return num_sums;
}

}  // namespace

GramMatrix::GramMatrix(int num_columns, Eigen::Index stride, Eigen::Index most_rows)
    : num_columns_(num_columns), stride_(stride), set_(ActiveSimd()) {
  CHECK(num_columns <= kMaxColumns) << num_columns;
  // For very few rows, the horizontal sums of wide lanes cost more than the wide lanes save.
  if (set_ == Simd::kAvx512 && most_rows <= kLanesOf<Simd::kAvx2>) set_ = Simd::kAvx2;
  std::fill_n(lanes_, NumSums(Even(num_columns)) * NumLanes(set_), 0.0);
}

void GramMatrix::Add(const double* columns, Eigen::Index num_rows) {
  SelectForIsa(set_, &AddRowsBaseline, &AddRowsAvx2, &AddRowsAvx512)(columns, stride_, Even(num_columns_), num_rows,
                                                                     lanes_);
}

void GramMatrix::AddTo(const int* places, double scale, Eigen::MatrixXd* matrix) const {
  const int even = Even(num_columns_);
  double sums[kMaxSums];
  SelectForIsa(set_, &SumLanesBaseline, &SumLanesAvx2, &SumLanesAvx512)(lanes_, NumSums(even), sums);
  double* const to = matrix->data();
  const Eigen::Index stride = matrix->outerStride();
  const auto add_block = [&](int rows, int i, int j, int sum) {
    double* const first = to + places[j] * stride;
    for (int row = i; row < std::min(i + rows, num_columns_); ++row, sum += 2) {
      // Blocks on the diagonal contain some pairs twice.
      if (j <= row) first[places[row]] += scale * sums[sum];
      if (j < row) to[places[j + 1] * stride + places[row]] += scale * sums[sum + 1];
    }
  };
  ForEachBlock(
      even, [&](int i, int j, int sum) { add_block(kBlock, i, j, sum); },
      [&](int i, int j, int sum) { add_block(2, i, j, sum); });
}

Eigen::MatrixXd GramMatrix::Matrix() const {
  int places[kMaxColumns];
  std::iota(places, places + num_columns_, 0);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(num_columns_, num_columns_);
  AddTo(places, 1.0, &matrix);
  return matrix.selfadjointView<Eigen::Lower>();
}

Eigen::MatrixXd InnerProducts(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::Ref<const Eigen::MatrixXd>& b) {
  CHECK_EQ(a.rows(), b.rows());
  const Eigen::MatrixXd left = Padded(a, kBlock);
  const Eigen::MatrixXd right = Padded(b, kBlock);
  Eigen::MatrixXd products(left.cols(), right.cols());
  SelectForIsa(ActiveSimd(), &MultiplyBaseline, &MultiplyAvx2, &MultiplyAvx512)(left, right, &products);
  return products.topLeftCorner(a.cols(), b.cols());
}

void AddGramOfMany(const double* columns, Eigen::Index stride, Eigen::Index num_rows, Eigen::MatrixXd* products) {
  CHECK_EQ(products->cols() % kManyColumnsUnit, 0);
  SelectForIsa(ActiveSimd(), &AddProductsBaseline, &AddProductsAvx2, &AddProductsAvx512)(
      columns, stride, products->cols(), num_rows, products->data());
}

}  // namespace heba
