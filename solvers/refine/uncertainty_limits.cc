#include "solvers/refine/uncertainty_limits.h"

#include <cmath>
#include <utility>
#include <vector>

#include "heba/base/failure_code.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"

namespace heba {

std::optional<Failure> CheckDetermined(const Problem& problem, const FitState& state, const Covariance& covariance) {
  const double most_rad = DegToRad(30.0);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const std::vector<Rigid3d> poses = TargetPosesOf(problem, state.poses, state.effects, c);
    if (poses.empty()) continue;
    const double distance_m = WorkingDistance(poses);
    const UnknownBlock block = covariance.layout.Block(CameraPoseBlock(problem.cameras[c]));
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const bool is_rotation = covariance.layout[i].group == UnknownGroup::kRotation;
      const double sigma = std::sqrt(covariance.matrix(i, i));
      if (sigma <= (is_rotation ? most_rad : distance_m)) continue;
      return Failure{FailureCode("large_sigma"),
                     {is_rotation ? std::pair("sigma_deg", RadToDeg(sigma)) : std::pair("sigma_mm", 1000 * sigma)},
                     {{"unknown", covariance.layout.Name(i)}}};
    }
  }
  return std::nullopt;
}

}  // namespace heba
