#include "solvers/calibration/time_offset.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <glog/logging.h>

#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

std::optional<TimeOffset> EstimateTimeOffset(std::vector<LinearisedView> views, const Eigen::VectorXd& variances,
                                             const Eigen::MatrixXd& covariance,
                                             const std::vector<Tangent6>& velocities) {
  CHECK_EQ(velocities.size(), views.size());
  const Eigen::Index num_unknowns = covariance.cols();
  Eigen::VectorXd coupling = Eigen::VectorXd::Zero(num_unknowns);  // A_x^T D.
  double square = 0;                                               // D^T D.
  double gradient = 0;                                             // D^T r.
  for (size_t v = 0; v < views.size(); ++v) {
    LinearisedView& view = views[v];
    if (view.by_effects.cols() < 6) return std::nullopt;
    view.by_unknowns.conservativeResize(Eigen::NoChange, num_unknowns + 1);
    view.by_unknowns.col(num_unknowns) = view.by_effects.leftCols<6>() * velocities[v];
    const Eigen::VectorXd of_effects =
        view.by_effects.cols() == variances.size() ? variances : Eigen::VectorXd::Zero(view.by_effects.cols());
    const RowMajorMatrix rows = WhitenedRows(view, 1, of_effects);
    const Eigen::VectorXd by_offset = rows.col(num_unknowns);
    coupling += rows.leftCols(num_unknowns).transpose() * by_offset;
    square += by_offset.squaredNorm();
    gradient += by_offset.dot(rows.col(num_unknowns + 1));
  }
  const Eigen::VectorXd of_estimate = covariance * coupling;
  const double information = square - coupling.dot(of_estimate);
  // The difference is rounding if the other unknowns take up the offset.
  constexpr double kRank = 1e-9;
  if (!(information > kRank * square)) return std::nullopt;
  const double sigma_s = 1 / std::sqrt(information);
  return TimeOffset{gradient / information, sigma_s, of_estimate * sigma_s};
}

std::optional<TimeOffset> EstimateTimeOffset(const Problem& problem, const Solution& solution,
                                             const std::vector<Tangent6>& velocities) {
  CHECK_EQ(velocities.size(), problem.captures.size());
  const Problem weighted = WeightedAs(solution, problem);
  const FitNoise noise = NoiseOf(solution);
  std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(weighted, StateOf(solution), noise, LossOf(LossKind::kNone));
  if (!views) return std::nullopt;
  std::vector<Tangent6> of_views;
  for (const size_t i : CapturesWithPoints(weighted)) of_views.push_back(velocities[i]);
  // The views after the captures, such as a prior of the camera, do not depend on the offset.
  views->resize(std::min(views->size(), of_views.size()));
  return EstimateTimeOffset(*std::move(views),
                            CorrectionVariances(noise, NoisyJointsOf(weighted, MovingRobots(weighted))),
                            solution.covariance.matrix, of_views);
}

}  // namespace heba
