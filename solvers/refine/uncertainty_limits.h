// The sigmas beyond which the data say nothing about a camera's pose.
#pragma once

#include <optional>

#include "heba/base/error.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/residuals/capture_loops.h"

namespace heba {

// Returns a Failure if the sigma of a camera's position at an estimate exceeds its working distance, or if that of its
// orientation exceeds 30 deg. A smaller sigma is a result, however large: whoever reads it judges it.
std::optional<Failure> CheckDetermined(const Problem& problem, const FitState& state, const Covariance& covariance);

}  // namespace heba
