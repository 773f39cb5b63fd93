// Checks whether the target looks the same after a rotation by 180 deg. All captures together determine its
// orientation, one image does not.
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/text/target_symmetry.h"

namespace heba {

Checked Check_symmetry(const Examination& examination) {
  const Target& target = *examination.config.data.targets.front();
  if (target.Symmetries().size() == 1) return {};
  return {{{Severity::kRemark, "symmetric_target", SymmetryRemark(target), SymmetryCure(target)}}};
}

}  // namespace heba
