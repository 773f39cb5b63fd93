#include "targets/corners/pattern_map.h"

#include <numeric>

namespace heba {

std::vector<int> SoughtTerms(MapForm form) {
  std::vector<int> terms(form == MapForm::kLens ? PatternMap::kPolynomial : PatternMap::kNumAffine);
  std::iota(terms.begin(), terms.end(), 0);
  const int num_of_polynomial = form == MapForm::kQuadratic    ? PatternMap::kNumSquares
                                : form == MapForm::kPolynomial ? PatternMap::kNumPolynomial
                                                               : 0;
  for (int axis = 0; axis < 2; ++axis) {
    for (int k = 0; k < num_of_polynomial; ++k) {
      terms.push_back(PatternMap::kPolynomial + axis * PatternMap::kNumPolynomial + k);
    }
  }
  return terms;
}

}  // namespace heba
