#include "solvers/refine/uncertainty_limits.h"

#include <cmath>
#include <string>

#include "heba/base/text.h"
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
      return Failure{"the captures do not determine " + covariance.layout.PlainName(i) + " (one sigma " +
                     Significant(is_rotation ? RadToDeg(sigma) : 1000 * sigma, 2) + (is_rotation ? " deg" : " mm") +
                     "); more captures with larger rotations about different axes are needed"};
    }
  }
  return std::nullopt;
}

}  // namespace heba
