#include "solvers/calibration/influence.h"

#include "heba/base/factorisation.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns the probability that a move is at least as large. Directions about which the capture carries no information
// are ignored.
double PValueOfMove(const Tangent6& move, const Matrix6& covariance_without, const Matrix6& covariance_with,
                    double dof) {
  const Tangent6 scale = covariance_with.diagonal().cwiseSqrt().cwiseInverse();
  constexpr double kNothing = 1e-6;  // Relative to the variance of the pose.
  return PValueOf(scale.cwiseProduct(move),
                  scale.asDiagonal() * (covariance_without - covariance_with) * scale.asDiagonal(), kNothing, dof);
}

}  // namespace

std::vector<std::optional<CaptureMove>> MoveWithoutEachCapture(const Problem& problem, const Solution& solution,
                                                               size_t camera, const Loss& loss) {
  std::vector<std::optional<CaptureMove>> moves(problem.captures.size());
  const Problem weighted = WeightedAs(solution, problem);
  const std::vector<size_t> captures = CapturesWithPoints(weighted);
  const std::optional<std::vector<LinearisedView>> views =
      LineariseEachCapture(weighted, StateOf(solution), NoiseOf(solution), loss);
  if (!views) return moves;
  const Eigen::VectorXd variances =
      CorrectionVariances(NoiseOf(solution), NoisyJointsOf(weighted, MovingRobots(weighted)));
  const UnknownLayout& layout = solution.covariance.layout;
  const Eigen::Index pose = layout.Block(CameraPoseBlock(problem.cameras[camera])).first;
  // The information of all data: at the minimum, the right-hand sides of the views and of everything else cancel.
  const Eigen::MatrixXd& covariance = solution.covariance.matrix;
  const Eigen::MatrixXd information = InvertInformation({layout, covariance}, 1.0).matrix;
  // Ratio of the weighted normal matrix to the mean of the second derivatives of rho, which are smaller.
  const double newton = loss.mean_weight / loss.consistency;
  for (size_t v = 0; v < views->size(); ++v) {
    const LinearisedView& view = (*views)[v];
    const Eigen::MatrixXd whitened =
        SolveSymmetric(MarginalCovariance(view, loss.covariance_factor(), variances), view.by_unknowns);
    const Information without{layout, information - view.by_unknowns.transpose() * whitened};
    if (CheckObservable(without)) continue;
    const Eigen::MatrixXd covariance_without = InvertInformation(without, 1.0).matrix;
    const Tangent6 move = (-newton * covariance_without * (whitened.transpose() * view.offset)).segment<6>(pose);
    moves[captures[v]] = CaptureMove{move, PValueOfMove(move, covariance_without.block<6, 6>(pose, pose),
                                                        covariance.block<6, 6>(pose, pose), solution.covariance_dof)};
  }
  return moves;
}

}  // namespace heba
