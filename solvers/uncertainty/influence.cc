#include "solvers/uncertainty/influence.h"

#include "heba/base/factorisation.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns the probability that a move is at least as large. Directions about which the capture carries no information
// are ignored.
double ChanceOfMove(const Tangent6& move, const Matrix6& covariance_without, const Matrix6& covariance_with,
                    double dof) {
  const Tangent6 scale = covariance_with.diagonal().cwiseSqrt().cwiseInverse();
  constexpr double kNothing = 1e-6;  // Relative to the variance of the pose.
  return ChanceOf(scale.cwiseProduct(move),
                  scale.asDiagonal() * (covariance_without - covariance_with) * scale.asDiagonal(), kNothing, dof);
}

}  // namespace

std::vector<std::optional<CaptureMove>> MoveWithoutEachView(const Problem& problem, const Solution& solution,
                                                            const FreeUnknowns& free, const Loss& loss) {
  std::vector<std::optional<CaptureMove>> moves(problem.views.size());
  const std::optional<std::vector<LinearisedView>> views =
      LineariseViewsAt(problem, solution, CorrectionsOf(solution), free, loss);
  if (!views) return moves;
  const RobotNoise robot = solution.robot_noise.value_or(RobotNoise{});
  const UnknownLayout& layout = solution.covariance.layout;
  const Eigen::Index pose = layout.Block(kHandEyeBlock).first;
  // The information of all data: at the minimum, the right-hand sides of the views and of everything else cancel.
  const Eigen::MatrixXd& covariance = solution.covariance.matrix;
  const Eigen::MatrixXd information = InvertInformation({layout, covariance}, 1.0).matrix;
  // Ratio of the weighted normal matrix to the mean of the second derivatives of rho, which are smaller.
  const double newton = loss.mean_weight / loss.consistency;
  for (size_t i = 0; i < views->size(); ++i) {
    const LinearisedView& view = (*views)[i];
    const Eigen::MatrixXd whitened = SolveSymmetric(
        MarginalCovariance(view, loss.covariance_factor(), CorrectionVariances(robot, view.by_effects.cols())),
        view.by_unknowns);
    const Information without{layout, information - view.by_unknowns.transpose() * whitened};
    if (CheckObservable(without)) continue;
    const Eigen::MatrixXd covariance_without = InvertInformation(without, 1.0).matrix;
    const Tangent6 move = (-newton * covariance_without * (whitened.transpose() * view.offset)).segment<6>(pose);
    moves[i] = CaptureMove{move, ChanceOfMove(move, covariance_without.block<6, 6>(pose, pose),
                                              covariance.block<6, 6>(pose, pose), solution.covariance_dof)};
  }
  return moves;
}

}  // namespace heba
