#include "solvers/residuals/inliers.h"

#include <algorithm>

#include "heba/base/error.h"
#include "solvers/residuals/loss.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {
namespace {

// Returns the number of points in each block: the blocks of the covariances or, without covariances, one point per
// block.
std::vector<int> BlockSizes(const Observations& observations) {
  if (observations.covariances_px2.empty()) return std::vector<int>(static_cast<size_t>(observations.size()), 1);
  std::vector<int> sizes;
  for (const Eigen::MatrixXd& block : observations.covariances_px2) sizes.push_back(static_cast<int>(block.rows() / 2));
  return sizes;
}

}  // namespace

std::vector<bool> FindInliers(const Camera& camera, const Rigid3d& camera_from_target, const Observations& observations,
                              double pixel_sigma_px) {
  const size_t n = static_cast<size_t>(observations.size());
  std::vector<bool> passes(n, false);
  const std::optional<std::vector<double>> squares =
      WhitenedSquares(camera.Model(), camera.params.data(), camera_from_target, observations, nullptr);
  if (!squares) return passes;
  const Loss& truncated = LossOf(LossKind::kTruncated);
  for (size_t i = 0; i < n; ++i) {
    passes[i] = truncated.weight((*squares)[i] / (pixel_sigma_px * pixel_sigma_px)) > 0;
  }
  auto first = passes.begin();
  for (const int size : BlockSizes(observations)) {
    const bool all = std::all_of(first, first + size, [](bool one) { return one; });
    std::fill(first, first + size, all);
    first += size;
  }
  return passes;
}

Observations KeepPoints(const Observations& observations, const std::vector<bool>& keep) {
  CHECK_EQ(keep.size(), static_cast<size_t>(observations.size()));
  std::vector<Eigen::Index> kept;
  for (size_t i = 0; i < keep.size(); ++i) {
    if (keep[i]) kept.push_back(static_cast<Eigen::Index>(i));
  }
  Observations result;
  for (const Eigen::Index i : kept) result.ids.push_back(observations.ids[static_cast<size_t>(i)]);
  result.points_in_target = observations.points_in_target(Eigen::all, kept);
  result.pixels = observations.pixels(Eigen::all, kept);
  if (observations.radii_m.size() > 0) result.radii_m = observations.radii_m(kept);
  size_t first = 0;
  const std::vector<int> sizes = BlockSizes(observations);
  for (size_t b = 0; b < sizes.size(); ++b) {
    if (keep[first] && !observations.covariances_px2.empty()) {
      result.covariances_px2.push_back(observations.covariances_px2[b]);
    }
    if (keep[first] && !observations.whitening.empty()) result.whitening.push_back(observations.whitening[b]);
    first += static_cast<size_t>(sizes[b]);
  }
  return result;
}

Observations WithoutPoints(const Observations& observations, const std::vector<int>& ids) {
  std::vector<bool> keep;
  for (const int id : observations.ids) keep.push_back(std::find(ids.begin(), ids.end(), id) == ids.end());
  return KeepPoints(observations, keep);
}

PairProblem WithoutRejected(const PairProblem& problem, const PairSolution& solution) {
  CHECK_EQ(solution.views.size(), problem.views.size());
  PairProblem kept = problem;
  for (size_t i = 0; i < kept.views.size(); ++i) {
    Observations& observations = kept.views[i].observations;
    observations = WithoutPoints(observations, solution.views[i].rejected_ids);
  }
  return kept;
}

Problem WithoutRejected(Problem problem, const Solution& solution) {
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
      Observations& observations = problem.captures[i].images[k].observations;
      observations = WithoutPoints(observations, solution.captures[i].rejected_ids[k]);
    }
  }
  return problem;
}

Solution WithRejectedBefore(Solution solution, const Solution& before) {
  for (size_t i = 0; i < solution.captures.size(); ++i) {
    for (size_t k = 0; k < solution.captures[i].rejected_ids.size(); ++k) {
      std::vector<int>& ids = solution.captures[i].rejected_ids[k];
      const std::vector<int>& others = before.captures[i].rejected_ids[k];
      ids.insert(ids.end(), others.begin(), others.end());
      std::sort(ids.begin(), ids.end());
    }
  }
  return solution;
}

}  // namespace heba
