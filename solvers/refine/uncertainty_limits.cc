#include "solvers/refine/uncertainty_limits.h"

#include <cmath>
#include <string>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/uncertainty/information.h"

namespace heba {
std::optional<Failure> CheckUncertainty(const Covariance& covariance, const Camera& camera) {
  constexpr double kMaxTranslationM = 0.1;
  constexpr double kMaxRotationRad = 0.1;
  constexpr double kMaxFocalRatio = 0.01;
  constexpr double kMaxCentreRatio = 0.02;  // Relative to the image width.
  constexpr double kMaxScale = 0.01;
  constexpr double kMaxBendM = 5e-3;
  for (size_t i = 0; i < covariance.names.size(); ++i) {
    const std::string& name = covariance.names[i];
    const double sigma = std::sqrt(covariance.matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)));
    const std::string part = name.substr(name.find('.') + 1);
    const bool is_pose = !name.starts_with("camera.") && !name.starts_with("target.");
    if (is_pose && part[0] == 't' && !(sigma < kMaxTranslationM)) {
      return Failure{PlainName(name) + " is known only to " + Significant(1000 * sigma, 2) +
                     " mm; more captures with larger rotations about different axes are needed"};
    }
    if (is_pose && part[0] == 'r' && !(sigma < kMaxRotationRad)) {
      return Failure{PlainName(name) + " is known only to " + Significant(RadToDeg(sigma), 2) +
                     " deg; more captures with larger rotations about different axes are needed"};
    }
    if (part == "fx" || part == "fy") {
      const int axis = part == "fx" ? 0 : 1;
      const double focal_px = AxialFocalLength(camera, axis);
      const Eigen::VectorXd by_unknowns = AxialFocalLengthByUnknowns(camera, axis, covariance.names);
      const double focal_sigma_px = std::sqrt(by_unknowns.dot(covariance.matrix * by_unknowns));
      if (!(focal_sigma_px < kMaxFocalRatio * focal_px)) {
        return Failure{PlainName(name) + " is known only to " + Significant(focal_sigma_px, 2) +
                       " px: the captures cannot distinguish focal length from distance; move the target through more "
                       "depth and tilt, or hold the focal length with a camera file and refine.intrinsics"};
      }
    }
    if (part.starts_with("scale_") && !(sigma < kMaxScale)) {
      return Failure{
          PlainName(name) + " is known only to " + Significant(100 * sigma, 2) +
          " %: the captures cannot distinguish it from distance; move the target through more depth, or measure "
          "the print and set refine.target_shape: none"};
    }
    if (part.starts_with("bend_") && !(sigma < kMaxBendM)) {
      return Failure{PlainName(name) + " is known only to " + Significant(1000 * sigma, 2) +
                     " mm; tilt the target more, or remove the bend from refine.target_shape"};
    }
    if ((part == "cx" || part == "cy") && !(sigma < kMaxCentreRatio * camera.width_px)) {
      return Failure{PlainName(name) + " is known only to " + Significant(sigma, 2) +
                     " px: the captures cannot distinguish it from the camera's orientation; tilt the target "
                     "more, or hold it with a camera file and refine.intrinsics"};
    }
  }
  return std::nullopt;
}

}  // namespace heba
