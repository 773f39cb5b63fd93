// What the data say about the unknowns: the normal matrix of the joint reprojection problem, which direction it sees
// worst, and its inverse.
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
  std::vector<std::string> names;  // As Covariance::names.
  Eigen::MatrixXd matrix;          // sum w J^T J / sigma^2
};

// Information::names of a camera model and what of it is free.
std::vector<std::string> UnknownNames(const CameraModel& model, const FreeParameters& free);

// Why the unknowns cannot all be determined, with the direction that the data do not see in plain words; nothing if
// they can. The criterion is the smallest eigenvalue of the matrix with its diagonal scaled to 1: below 1e-9 nothing is
// left of a direction but round-off.
std::optional<Failure> CheckObservable(const Information& information);

// factor * matrix^-1. `information` must have passed CheckObservable.
Covariance InvertInformation(const Information& information, double factor);

// "the hand-eye translation along the camera's z", for a name of Covariance::names.
std::string PlainName(const std::string& name);

}  // namespace heba
