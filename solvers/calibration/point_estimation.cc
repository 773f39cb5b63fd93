#include "solvers/calibration/point_estimation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns the designed places of the points of a target that are in use, by their ids.
std::map<int, Eigen::Vector3d> DesignedPlaces(const Problem& problem, size_t target, const PointOffsets& known) {
  std::map<int, Eigen::Vector3d> places;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.target != target) continue;
      for (Eigen::Index i = 0; i < image.observations.size(); ++i) {
        const int id = image.observations.ids[static_cast<size_t>(i)];
        const auto offset = known.find(id);
        const Eigen::Vector3d at = image.observations.points_in_target.col(i);
        places[id] = offset == known.end() ? at : Eigen::Vector3d(at - offset->second);
      }
    }
  }
  return places;
}

// Returns points that are far from each other: each is the one that is farthest from those before it.
std::vector<size_t> SpreadPoints(const Points3& places, size_t num) {
  std::vector<size_t> chosen = {0};
  Eigen::VectorXd nearest_m = (places.colwise() - places.col(0)).colwise().norm().transpose();
  while (chosen.size() < num) {
    Eigen::Index farthest = 0;
    nearest_m.maxCoeff(&farthest);
    chosen.push_back(static_cast<size_t>(farthest));
    nearest_m = nearest_m.cwiseMin((places.colwise() - places.col(farthest)).colwise().norm().transpose());
  }
  return chosen;
}

// Returns the weights of the coefficients in the offset of each point, of unit length for each point.
Eigen::MatrixXd WeightsOf(const Points3& places) {
  const Eigen::Index n = places.cols();
  if (n <= static_cast<Eigen::Index>(kMostFreePoints)) return Eigen::MatrixXd::Identity(n, n);
  const std::vector<size_t> centres = SpreadPoints(places, kMostFreePoints);
  const Eigen::Vector3d extent = places.rowwise().maxCoeff() - places.rowwise().minCoeff();
  // The distance between neighbours of so many centres in a plane of this extent.
  const double spacing_m = extent.norm() / std::sqrt(2.0 * static_cast<double>(centres.size()));
  Eigen::MatrixXd weights(n, static_cast<Eigen::Index>(centres.size()));
  for (Eigen::Index i = 0; i < n; ++i) {
    for (size_t k = 0; k < centres.size(); ++k) {
      const double apart = (places.col(i) - places.col(static_cast<Eigen::Index>(centres[k]))).norm() / spacing_m;
      weights(i, static_cast<Eigen::Index>(k)) = std::exp(-0.5 * apart * apart);
    }
    weights.row(i).normalize();
  }
  return weights;
}

// Returns the offsets (three for each point) by the coefficients (three for each weight), without motions of the
// target.
Eigen::MatrixXd BasisOf(const Points3& places) {
  const Eigen::MatrixXd weights = WeightsOf(places);
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(3 * weights.rows(), 3 * weights.cols());
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    for (Eigen::Index k = 0; k < weights.cols(); ++k)
      basis.block<3, 3>(3 * i, 3 * k).diagonal().setConstant(weights(i, k));
  }
  const Eigen::Vector3d middle = places.rowwise().mean();
  Eigen::MatrixXd motions(basis.rows(), 6);
  for (Eigen::Index i = 0; i < places.cols(); ++i) {
    motions.block<3, 3>(3 * i, 0).setIdentity();
    motions.block<3, 3>(3 * i, 3) = -Skew(places.col(i) - middle);
  }
  const Eigen::MatrixXd orthonormal = HouseholderFactor(std::move(motions)).Basis();
  return basis - orthonormal * (orthonormal.transpose() * basis);
}

// The coefficients of all targets, joined.
struct Coefficients {
  std::vector<PointUnknowns> of_targets;  // One per target of the problem; empty for those that are as designed.
  std::vector<Eigen::MatrixXd> bases;     // Likewise.
  Eigen::VectorXd known;                  // The coefficients of the known offsets.
  Eigen::Index size = 0;
};

Coefficients CoefficientsOf(const Problem& problem, const std::vector<size_t>& targets,
                            const std::vector<PointOffsets>& known) {
  Coefficients all;
  all.of_targets.resize(problem.targets.size());
  all.bases.resize(problem.targets.size());
  std::vector<Eigen::VectorXd> of_known;
  for (const size_t t : targets) {
    const std::map<int, Eigen::Vector3d> designed = DesignedPlaces(problem, t, known[t]);
    constexpr size_t kFewestPoints = 3;
    if (designed.size() < kFewestPoints) continue;
    Points3 places(3, static_cast<Eigen::Index>(designed.size()));
    Eigen::VectorXd offsets = Eigen::VectorXd::Zero(3 * places.cols());
    PointUnknowns& unknowns = all.of_targets[t];
    Eigen::Index i = 0;
    for (const auto& [id, place] : designed) {
      places.col(i) = place;
      const auto offset = known[t].find(id);
      if (offset != known[t].end()) offsets.segment<3>(3 * i) = offset->second;
      ++i;
    }
    all.bases[t] = BasisOf(places);
    unknowns.first = all.size;
    unknowns.size = all.bases[t].cols();
    i = 0;
    for (const auto& entry : designed) unknowns.by_id[entry.first] = all.bases[t].middleRows(3 * i++, 3);
    all.size += unknowns.size;
    // The shortest coefficients of these offsets.
    const Eigen::MatrixXd& basis = all.bases[t];
    constexpr double kRounding = 1e-9;
    Eigen::MatrixXd square = basis.transpose() * basis;
    square.diagonal().array() += kRounding;
    of_known.emplace_back(SolveSymmetric(square, Eigen::VectorXd(basis.transpose() * offsets)));
  }
  all.known.resize(all.size);
  Eigen::Index first = 0;
  for (const Eigen::VectorXd& of_target : of_known) {
    all.known.segment(first, of_target.size()) = of_target;
    first += of_target.size();
  }
  return all;
}

// A PointEquations has what the images say about the coefficients, beside all other unknowns.
struct PointEquations {
  Eigen::MatrixXd information;  // S.
  Eigen::VectorXd right;        // g.
  Eigen::MatrixXd changes;      // C A^T D.
  double squares = 0;           // The squares of the residuals that no offsets explain, and their number.
  double dof = 0;
};

std::optional<PointEquations> EquationsOf(const Problem& problem, const Solution& solution,
                                          const Coefficients& coefficients) {
  const Problem weighted = WeightedAs(solution, problem);
  const FitNoise noise = NoiseOf(solution);
  const FitState state = StateOf(solution);
  const CaptureGroups groups = GroupByRobotPoses(weighted);
  const std::optional<std::vector<LinearisedView>> views =
      LineariseWithPoints(CaptureLoops(weighted, groups, state, noise, true), ValuesOf(state), coefficients.of_targets);
  if (!views) return std::nullopt;
  const UnknownLayout& layout = solution.covariance.layout;
  const Eigen::Index p = layout.size();
  const Eigen::Index n = coefficients.size;
  // The offsets of views are those without the shared effects.
  Eigen::VectorXd effects = Eigen::VectorXd::Zero(p);
  for (size_t r = 0; r < state.effects.size(); ++r) {
    const UnknownBlock block = layout.Block(ErrorsBlock(weighted.robots[r]));
    if (block.size == state.effects[r].size()) effects.segment(block.first, block.size) = state.effects[r];
  }
  const Eigen::VectorXd variances = CorrectionVariances(noise, NoisyJointsOf(weighted, MovingRobots(weighted)));
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(p + n + 1, p + n + 1);
  double squares = 0;
  double num_rows = 0;
  for (const LinearisedView& view : *views) {
    RowMajorMatrix rows = WhitenedRows(view, 1, variances);
    rows.col(p + n) -= rows.leftCols(p) * effects;
    products += rows.transpose() * rows;
    squares += view.residual_sum_of_squares;
    num_rows += static_cast<double>(rows.rows() + view.num_residual_dof);
  }
  squares += products(p + n, p + n);
  const Eigen::MatrixXd coupling = products.block(0, p, p, n);
  PointEquations equations;
  equations.changes = solution.covariance.matrix * coupling;
  equations.information = products.block(p, p, n, n) - coupling.transpose() * equations.changes;
  equations.information = (0.5 * (equations.information + equations.information.transpose())).eval();
  const Eigen::VectorXd gradient = products.block(p, p + n, n, 1);
  equations.right = gradient + equations.information * coefficients.known;
  // The squares at the offsets that explain most, in the directions that the images show.
  const auto eigen = EigenOfSymmetric(equations.information);
  const double least = 1e-9 * eigen.values.maxCoeff();
  equations.squares = squares;
  equations.dof = num_rows - static_cast<double>(p);
  for (Eigen::Index k = 0; k < n; ++k) {
    if (eigen.values[k] <= least) continue;
    const double along = eigen.vectors.col(k).dot(gradient);
    equations.squares -= along * along / eigen.values[k];
    equations.dof -= 1;
  }
  return equations;
}

// The variance of the coefficients that maximises the restricted likelihood, and the gain of the likelihood over none.
struct PointVariance {
  double variance_m2 = 0;
  double gain = 0;
};

PointVariance VarianceOf(const PointEquations& equations) {
  const auto eigen = EigenOfSymmetric(equations.information);
  const double least = 1e-9 * eigen.values.maxCoeff();
  std::vector<std::pair<double, double>> directions;  // Each has its information and the square of its part of g.
  for (Eigen::Index k = 0; k < eigen.values.size(); ++k) {
    if (eigen.values[k] <= least) continue;
    const double part = eigen.vectors.col(k).dot(equations.right);
    directions.emplace_back(eigen.values[k], part * part);
  }
  const double dof = equations.dof + static_cast<double>(directions.size());
  if (directions.empty() || equations.dof < 1) return {};
  // Minus twice the logarithm, at the scale of the noise that is best.
  const auto minus_twice_log = [&](double ratio) {
    double squares = std::max(equations.squares, 0.0);
    double logarithms = 0;
    for (const auto& [information, square] : directions) {
      const double factor = 1 + ratio * information;
      squares += square / (information * factor);
      logarithms += std::log(factor);
    }
    return dof * std::log(squares / dof) + logarithms;
  };
  constexpr double kLeastM = 1e-7;
  constexpr double kMostM = 1e-2;
  constexpr int kNumSteps = 100;
  const double at_zero = minus_twice_log(0);
  double best = at_zero;
  double best_ratio = 0;
  for (int step = 0; step <= kNumSteps; ++step) {
    const double sigma_m = kLeastM * std::pow(kMostM / kLeastM, static_cast<double>(step) / kNumSteps);
    const double value = minus_twice_log(sigma_m * sigma_m);
    if (value >= best) continue;
    best = value;
    best_ratio = sigma_m * sigma_m;
  }
  return {best_ratio, 0.5 * (at_zero - best)};
}

}  // namespace

std::optional<EstimatedPoints> EstimatePoints(const Problem& problem, const Solution& solution,
                                              const std::vector<size_t>& targets,
                                              const std::vector<PointOffsets>& known) {
  const Coefficients coefficients = CoefficientsOf(problem, targets, known);
  EstimatedPoints estimated;
  estimated.offsets.resize(problem.targets.size());
  if (coefficients.size == 0) return estimated;
  const std::optional<PointEquations> equations = EquationsOf(problem, solution, coefficients);
  if (!equations) return std::nullopt;
  const PointVariance variance = VarianceOf(*equations);
  estimated.sigma_m = std::sqrt(variance.variance_m2);
  // A variance of zero is at the limit of its range.
  estimated.p_value = variance.gain > 0 ? 0.5 * ChiSquareTail(2 * variance.gain, 1) : 1;
  if (variance.variance_m2 <= 0) return estimated;
  Eigen::MatrixXd information = equations->information;
  information.diagonal().array() += 1 / variance.variance_m2;
  const auto factor = Cholesky(information);
  if (!factor) return std::nullopt;
  const Eigen::VectorXd found = factor->Solve(equations->right);
  for (size_t t = 0; t < coefficients.of_targets.size(); ++t) {
    const PointUnknowns& unknowns = coefficients.of_targets[t];
    for (const auto& [id, by_coefficients] : unknowns.by_id) {
      estimated.offsets[t][id] = by_coefficients * found.segment(unknowns.first, unknowns.size);
    }
  }
  // With the covariance L^-T L^-1 of the coefficients, the columns of C A^T D L^-T, in no more of them than unknowns.
  const Eigen::MatrixXd columns = factor->SolveLower(Eigen::MatrixXd(equations->changes.transpose()));
  const Eigen::MatrixXd root = HouseholderFactor(columns).R();
  for (Eigen::Index i = 0; i < root.rows(); ++i) estimated.changes.emplace_back(root.row(i).transpose());
  return estimated;
}

}  // namespace heba
