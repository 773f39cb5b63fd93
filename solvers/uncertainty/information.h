// The information about the unknowns: normal matrix of the joint reprojection problem, observability and covariance.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"
#include "solvers/residuals/free_parameters.h"
#include "solvers/residuals/loss.h"

namespace heba {

struct Information {
  std::vector<std::string> names;  // See Covariance::names.
  Eigen::MatrixXd matrix;          // sum w J^T J / sigma^2
};

// Returns the names (Information::names) of the unknowns for a camera model and its free parameters.
std::vector<std::string> UnknownNames(const CameraModel& model, const FreeParameters& free);

// Returns the reason why the unknowns cannot all be determined, with the unobservable direction in plain words, or
// nothing if they can. The criterion is the smallest eigenvalue of the matrix scaled to a unit diagonal: below 1e-9,
// a direction contains nothing but round-off.
std::optional<Failure> CheckObservable(const Information& information);

// Returns factor * matrix^-1. `information` must have passed CheckObservable.
Covariance InvertInformation(const Information& information, double factor);

// Returns the derivatives of AxialFocalLength (heba/camera/camera.h) by the unknowns with these names. Its variance is
// the uncertainty of the focal length that matters: some models can exchange fx and fy for coefficients of their
// distortion, so that these are not determined although the lens is.
Eigen::VectorXd AxialFocalLengthByUnknowns(const Camera& camera, int axis, const std::vector<std::string>& names);

// Returns the plain name of an entry of Covariance::names, e.g. "the hand-eye translation along the camera's z".
std::string PlainName(const std::string& name);

}  // namespace heba
