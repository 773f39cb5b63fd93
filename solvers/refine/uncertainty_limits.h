// The sigmas beyond which a result is refused.
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"

namespace heba {

// Returns a Failure if the sigma of an unknown is too large for the result to be useful. `cameras` are the owners of
// the layout's camera blocks, in their order.
std::optional<Failure> CheckUncertainty(const Covariance& covariance, const std::vector<Camera>& cameras);

}  // namespace heba
