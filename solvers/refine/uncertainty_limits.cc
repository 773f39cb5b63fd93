#include "solvers/refine/uncertainty_limits.h"

#include <cmath>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/units.h"

namespace heba {

std::optional<Failure> CheckDetermined(const Covariance& covariance, const std::vector<CameraReach>& cameras) {
  const double most_rad = DegToRad(30.0);
  for (const CameraReach& camera : cameras) {
    const UnknownBlock block = covariance.layout.Block(camera.block);
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const bool is_rotation = covariance.layout[i].group == UnknownGroup::kRotation;
      const double sigma = std::sqrt(covariance.matrix(i, i));
      if (sigma <= (is_rotation ? most_rad : camera.distance_m)) continue;
      return Failure{FailureCode("large_sigma"),
                     {is_rotation ? std::pair("sigma_deg", RadToDeg(sigma)) : std::pair("sigma_mm", 1000 * sigma)},
                     {{"unknown", covariance.layout.Name(i)}}};
    }
  }
  return std::nullopt;
}

}  // namespace heba
