#include "heba/evaluation/evaluation.h"

#include <algorithm>

namespace heba {

const Estimate* FindRefined(const PairResult& result) {
  const auto found = std::find_if(result.estimates.rbegin(), result.estimates.rend(), [](const Estimate& estimate) {
    return estimate.ok && estimate.solution && estimate.method != kChainMethod &&
           estimate.solution->covariance.matrix.rows() >= 6;
  });
  return found == result.estimates.rend() ? nullptr : &*found;
}

const Estimate* FindBestClosedForm(const PairResult& result, FigureOf figure) {
  const Estimate* best = nullptr;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.kind != EstimateKind::kClosedForm || !figure(estimate.errors)) continue;
    if (best == nullptr || *figure(estimate.errors) < *figure(best->errors)) best = &estimate;
  }
  return best;
}

}  // namespace heba
