#include "solvers/refine/bundle_model.h"

namespace heba {

const Loss& InlierLoss(const BundleOptions& options) {
  return LossOf(options.loss == LossKind::kTruncated ? LossKind::kNone : options.loss);
}

}  // namespace heba
