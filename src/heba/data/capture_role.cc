#include "heba/data/capture_role.h"

#include "heba/base/registry.h"

namespace heba {

std::optional<CaptureRole> FindCaptureRole(std::string_view name) {
  return FindValue<CaptureRole>(kCaptureRoleNames, name);
}

}  // namespace heba
