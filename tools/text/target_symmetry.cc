#include "tools/text/target_symmetry.h"

#include <vector>

#include "heba/base/text.h"

namespace heba {

std::string SymmetryText(const Target& target) {
  const size_t num_symmetries = target.Symmetries().size();
  if (num_symmetries == 1) return "";
  return std::string("the target looks the same after ") +
         (num_symmetries == 2 ? "a rotation by 180 deg" : "a rotation by 90 deg");
}

std::string SymmetryRemark(const Target& target) {
  if (target.Symmetries().size() == 1) return "";
  return SymmetryText(target) + ", so 'heba locate' finds " + std::to_string(target.Symmetries().size()) +
         " possible poses in an image unless --near decides; the calibration itself is not affected";
}

std::string SymmetryCure(const Target& target) {
  std::vector<std::string> settings;
  for (const auto& [key, value] : target.WithoutSymmetry()) settings.push_back(key + ": " + value);
  if (settings.empty()) return "";
  return "a " + std::string(target.type()) + " with " + Join(settings, ", ") + ", or a charuco, has one pose only";
}

}  // namespace heba
