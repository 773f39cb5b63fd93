#include "tools/text/target_symmetry.h"

#include <vector>

#include "heba/base/text.h"

namespace heba {

std::string SymmetryText(const Target& target) { return SymmetryText(target.Symmetries().size()); }

std::string SymmetryText(size_t num_symmetries) {
  if (num_symmetries == 1) return "";
  return std::string("the target looks the same after ") +
         (num_symmetries == 2 ? "a rotation by 180 deg" : "a rotation by 90 deg");
}

std::string SymmetryRemark(const Target& target) { return SymmetryRemark(target.Symmetries().size()); }

std::string SymmetryRemark(size_t num_symmetries) {
  if (num_symmetries == 1) return "";
  return SymmetryText(num_symmetries) + ", so 'heba locate' finds " + std::to_string(num_symmetries) +
         " possible poses in an image unless --near decides; the calibration itself is not affected";
}

std::string SymmetryCure(const Target& target) {
  std::vector<std::string> settings;
  for (const auto& [key, value] : target.WithoutSymmetry()) settings.push_back(key + ": " + value);
  if (settings.empty()) return "";
  return "a " + std::string(target.type()) + " with " + Join(settings, ", ") + ", or a charuco, has one pose only";
}

}  // namespace heba
