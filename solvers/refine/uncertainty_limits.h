// The sigmas beyond which a result is refused.
#pragma once

#include <optional>

#include "heba/base/error.h"
#include "heba/data/solution.h"

namespace heba {

// Returns a Failure if the sigma of an unknown is too large for the result to be useful.
std::optional<Failure> CheckUncertainty(const Covariance& covariance, const Camera& camera);

}  // namespace heba
