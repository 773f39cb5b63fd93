// The parts of a refinement's model that follow from its options.
#pragma once

#include "heba/adjustment_options.h"
#include "solvers/residuals/loss.h"

namespace heba {

// Returns the loss that applies to the inliers: `none` for `truncated`, because its outliers are removed.
const Loss& InlierLoss(const BundleOptions& options);

}  // namespace heba
