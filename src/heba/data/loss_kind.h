// The robust losses of a refinement.
#pragma once

namespace heba {

// `none` gives least squares; `huber` and `cauchy` weight points by their distance; `truncated` gives least squares
// over the points that pass a test, and no weight to the others (solvers/residuals/loss.h).
enum class LossKind { kNone, kHuber, kCauchy, kTruncated };

}  // namespace heba
