// The points of a target that were detected in one image.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"

namespace heba {

// Points of the target that were detected in one image. Column i of both matrices and ids[i] belong together.
struct Observations {
  std::vector<int> ids;      // Ids of the target's points.
  Points3 points_in_target;  // Metres.
  Points2 pixels;            // px; (0, 0) is the centre of the first pixel.
  // Radii of the discs around the points (TargetPoint::radius_m), in metres; empty if all of them are points.
  Eigen::VectorXd radii_m;
  // Covariances of the detected pixels (Detection::covariances_px2); empty if the detector does not provide them.
  std::vector<Eigen::MatrixXd> covariances_px2;
  // Lower triangular whitening matrices, one for each covariance: residuals multiplied by them are uncorrelated and
  // have one common sigma (solvers/residuals/noise_scale.h). If empty, all coordinates have the same weight.
  std::vector<Eigen::MatrixXd> whitening;

  double RadiusM(Eigen::Index i) const { return radii_m.size() > 0 ? radii_m[i] : 0; }
  int size() const { return static_cast<int>(ids.size()); }
};

}  // namespace heba
