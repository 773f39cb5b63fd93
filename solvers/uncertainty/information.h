// The information about the unknowns: normal matrix of the joint reprojection problem, observability and covariance.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "heba/base/error.h"
#include "heba/data/pair_solution.h"
#include "heba/data/unknowns.h"

namespace heba {

struct Information {
  UnknownLayout layout;
  Eigen::MatrixXd matrix;  // sum w J^T J / sigma^2
};

// Returns the reason why the unknowns cannot all be determined, with those of the unobservable direction, or nothing if
// they can. The criterion is the smallest eigenvalue of the matrix scaled to a unit diagonal: below 1e-9,
// a direction contains nothing but round-off.
std::optional<Failure> CheckObservable(const Information& information);

// Returns factor * matrix^-1. `information` must have passed CheckObservable.
Covariance InvertInformation(const Information& information, double factor);

// Returns the derivatives of AxialFocalLength (heba/camera/camera.h) by the unknowns. Its variance is the uncertainty
// of the focal length that matters: some models can exchange fx and fy for coefficients of their distortion, so that
// these are not determined although the lens is. `camera` is the owner of `block`.
Eigen::VectorXd AxialFocalLengthByUnknowns(const Camera& camera, int axis, const UnknownLayout& layout,
                                           const UnknownBlock& block);

}  // namespace heba
