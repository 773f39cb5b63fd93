#include "solvers/influence.h"

#include <Eigen/Cholesky>

#include "solvers/noise_scale.h"
#include "solvers/robot_noise.h"

namespace heba {
std::vector<std::optional<Tangent6>> MoveWithoutEachView(const Problem& problem, const Solution& solution,
                                                         const FreeParameters& free) {
  std::vector<std::optional<Tangent6>> moves(problem.views.size());
  Problem weighted{solution.camera, problem.views, problem.setup, solution.shape};
  if (solution.excess_px) WeightByCovariance(*solution.excess_px, &weighted.views);
  const std::optional<std::vector<LinearView>> views = LineariseViews(weighted, solution.hand_eye, solution.corrections,
                                                                      free, solution.pixel_sigma_px, *FindLoss("none"));
  if (!views) return moves;
  const RobotNoise robot = solution.robot_noise.value_or(RobotNoise{});
  const std::vector<std::string> names = UnknownNames(solution.camera.Model(), free);
  const auto size = static_cast<Eigen::Index>(names.size());
  // Of each view: its part of the normal matrix, and of the right side.
  std::vector<Eigen::MatrixXd> matrices;
  std::vector<Eigen::VectorXd> sides;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd side = Eigen::VectorXd::Zero(size);
  for (const LinearView& view : *views) {
    const Eigen::MatrixXd whitened = MarginalCovariance(view, 1.0, robot.translation_m * robot.translation_m,
                                                        robot.rotation_rad * robot.rotation_rad)
                                         .ldlt()
                                         .solve(view.by_unknowns);
    matrices.emplace_back(view.by_unknowns.transpose() * whitened);
    sides.emplace_back(whitened.transpose() * view.offset);
    matrix += matrices.back();
    side += sides.back();
  }
  for (size_t i = 0; i < views->size(); ++i) {
    const Information without{names, matrix - matrices[i]};
    if (CheckObservable(without)) continue;
    // The step from the solution, less the step that is left with all views: its own last one.
    const Eigen::VectorXd step = InvertInformation(without, 1.0).matrix * (side - sides[i]) -
                                 InvertInformation({names, matrix}, 1.0).matrix * side;
    moves[i] = step.head<6>();
  }
  return moves;
}

}  // namespace heba
