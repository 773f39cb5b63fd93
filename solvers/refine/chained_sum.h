// The sum of the normal equations of views, chained to the unknowns that captures share, and the elimination of the
// poses of a capture's own. Equations (8) and (9) of docs/estimation.md.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/data/unknowns.h"
#include "heba/kernels/small_matrix.h"
#include "heba/kernels/stacked_rows.h"
#include "solvers/residuals/kinematic_loop.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {

// The numbers that belong to one capture's nuisance poses; their memory needs no allocation.
inline constexpr int kMaxNuisancePoses = 4;
using NuisanceMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6 * kMaxNuisancePoses, 6 * kMaxNuisancePoses>;
using NuisanceVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6 * kMaxNuisancePoses, 1>;

// The place of each column of a view's reduction, from the seventh on, among the columns of the sum.
struct ColumnPlaces {
  struct Segment {
    Eigen::Index from = 0;  // Counted from the seventh column of the reduction.
    Eigen::Index to = 0;
    Eigen::Index size = 0;
  };
  std::vector<Segment> segments;

  // Places the next `size` columns of the reduction at `to`. Consecutive segments are joined.
  void Append(Eigen::Index to, Eigen::Index size);
};

// The columns of the sum are the unknowns of a layout and the residual. Only lower triangles are used.
class ChainedSum {
 public:
  // Rows of views with at most this many points are chained individually, which is cheaper than chaining their
  // products.
  static constexpr int kFewPoints = 16;

  // `poses` and `effects` are the blocks of the layout, and must outlive this object.
  ChainedSum(const std::vector<UnknownBlock>& poses, const std::vector<UnknownBlock>& effects,
             Eigen::Index num_columns);

  // Adds the rows of a view with at most kFewPoints points.
  void AddRows(const ViewRows& rows, const KinematicLoop& loop, const LoopDerivatives& derivatives,
               const ColumnPlaces& places);
  // Adds the products of a view (ViewNormalEquations::matrix).
  void AddProducts(const Eigen::MatrixXd& products, const KinematicLoop& loop, const LoopDerivatives& derivatives,
                   const ColumnPlaces& places);
  // Adds J_own^T J of a view to `own_rows`: one row for each tangent of the capture's nuisance poses.
  void AddOwnRows(const Eigen::MatrixXd& products, const KinematicLoop& loop, const LoopDerivatives& derivatives,
                  const ColumnPlaces& places, Eigen::MatrixXd* own_rows) const;
  // Eliminates a capture's nuisance poses: subtracts own_rows^T normal^-1 own_rows, and returns normal^-1 own_rows.
  Eigen::MatrixXd Eliminate(const NuisanceMatrix& normal, const Eigen::MatrixXd& own_rows);
  // Adds the squared residuals of priors.
  void AddSquares(double squares) { matrix_(num_columns_ - 1, num_columns_ - 1) += squares; }
  // Adds to ViewNormalEquations::loss_remainder.
  void AddLossRemainder(double loss_remainder) { loss_remainder_ += loss_remainder; }

  struct Result {
    Eigen::MatrixXd matrix;
    double loss_remainder = 0;
  };
  // Returns the sums. This object must not be used afterwards.
  Result Finish();

 private:
  template <int kRows>
  Eigen::MatrixXd EliminateRows(const NuisanceMatrix& normal, const Eigen::MatrixXd& own_rows);
  Eigen::Index PoseColumn(int pose) const { return poses_[static_cast<size_t>(pose)].first; }
  Eigen::Index EffectColumn(int effect) const { return effects_[static_cast<size_t>(effect)].first; }

  const std::vector<UnknownBlock>& poses_;
  const std::vector<UnknownBlock>& effects_;
  Eigen::Index num_columns_;
  Eigen::MatrixXd matrix_;
  double loss_remainder_ = 0;
  std::optional<StackedRows> stacked_;
  std::optional<StackedRows> eliminated_;
  std::vector<std::optional<StackedRows>> rows_of_effects_;  // One per block of effects.
};

}  // namespace heba
