#include "tools/text/difference_text.h"

#include <algorithm>

#include "heba/base/text.h"
#include "tools/text/result_text.h"

namespace heba {

std::string Agreement(const PoseDifference& difference) {
  return difference.p_value < kSignificantChance ? "differ" : "agree";
}

std::string AgreementFinding(const std::string& what, const std::vector<NamedDifference>& differences) {
  if (differences.empty()) return "";
  const auto num_different = std::count_if(differences.begin(), differences.end(), [](const NamedDifference& named) {
    return named.difference.p_value < kSignificantChance;
  });
  const auto least_likely = std::min_element(
      differences.begin(), differences.end(),
      [](const NamedDifference& a, const NamedDifference& b) { return a.difference.p_value < b.difference.p_value; });
  const PoseDifference& worst = least_likely->difference;
  const std::string extreme = least_likely->names + " are " + Significant(worst.distance_mm, 2) + " mm and " +
                              Significant(worst.angle_deg, 2) + " deg apart (one sigma " +
                              Significant(worst.sigma_mm, 2) + " mm, " + Significant(worst.sigma_deg, 2) +
                              " deg; chance " + ShownPValue(worst.p_value) + ")";
  if (num_different == 0) {
    return what + " agree within their uncertainties in all " + std::to_string(differences.size()) +
           " pairs; the least likely: " + extreme;
  }
  return what + " differ by more than their uncertainties in " + std::to_string(num_different) + " of " +
         std::to_string(differences.size()) + " pairs; the worst: " + extreme;
}

}  // namespace heba
