#include "targets/numbered_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "heba/base/median.h"
#include "heba/geometry/homography.h"

namespace heba {
namespace {

// Returns the median distance, in cells, between the seen numbers and where the homography maps their cells.
double MisfitOf(const Eigen::Matrix3d& pixel_from_cell, const Eigen::Matrix2Xd& cells, const Eigen::Matrix2Xd& pixels) {
  std::vector<double> misfits;
  for (Eigen::Index i = 0; i < cells.cols(); ++i) {
    const Eigen::Vector2d cell = cells.col(i);
    const Eigen::Vector2d mapped = ApplyHomography(pixel_from_cell, cell);
    const double cell_px = (ApplyHomography(pixel_from_cell, cell + Eigen::Vector2d(1, 0)) - mapped).norm();
    const double misfit = (mapped - pixels.col(i)).norm() / cell_px;
    if (!std::isfinite(misfit)) return std::numeric_limits<double>::infinity();
    misfits.push_back(misfit);
  }
  return Median(misfits);
}

}  // namespace

double CellSizePx(const Eigen::Matrix3d& pixel_from_cell, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d cell = ApplyHomography(pixel_from_cell.inverse(), pixel);
  return std::sqrt(std::abs(AreaScale(pixel_from_cell, cell)));
}

std::optional<NumberedGrid> FindNumberedGrid(const std::vector<SeenNumber>& seen, int most_columns,
                                             const CellOfIndex& cell_of) {
  constexpr size_t kFewest = 4;
  constexpr double kMostMisfit = 0.2;
  if (seen.size() < kFewest) return std::nullopt;
  const int lowest = std::min_element(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
                       return a.number < b.number;
                     })->number;
  const auto num_seen = static_cast<Eigen::Index>(seen.size());
  Eigen::Matrix2Xd pixels(2, num_seen);
  for (Eigen::Index i = 0; i < num_seen; ++i) pixels.col(i) = seen[static_cast<size_t>(i)].pixel;
  std::optional<NumberedGrid> best;
  double best_misfit = kMostMisfit;
  std::vector<int> firsts = {0};
  if (lowest > 0) firsts.push_back(lowest);
  for (const int first : firsts) {
    for (int columns = 1; columns <= most_columns; ++columns) {
      Eigen::Matrix2Xd cells(2, num_seen);
      for (Eigen::Index i = 0; i < num_seen; ++i) {
        cells.col(i) = cell_of(seen[static_cast<size_t>(i)].number - first, columns);
      }
      const std::optional<Eigen::Matrix3d> homography = LinearHomography(cells, pixels);
      if (!homography) continue;
      const double misfit = MisfitOf(*homography, cells, pixels);
      if (misfit >= best_misfit) continue;
      best_misfit = misfit;
      best = NumberedGrid{columns, first, *homography};
    }
  }
  return best;
}

}  // namespace heba
