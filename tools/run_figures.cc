#include "tools/run_figures.h"

#include <algorithm>
#include <cmath>

#include "heba/base/units.h"

namespace heba {
namespace {

std::optional<double> SigmaOf(const Estimate& estimate, Eigen::Index first) {
  if (!estimate.solution || estimate.solution->covariance.matrix.rows() < 6) return std::nullopt;
  return std::sqrt(estimate.solution->covariance.matrix.diagonal().segment<3>(first).sum());
}

}  // namespace

const Estimate* FindRefined(const RunResult& result) {
  const auto found = std::find_if(result.estimates.rbegin(), result.estimates.rend(), [](const Estimate& estimate) {
    return estimate.ok && estimate.kind == "refined" && TranslationSigmaMm(estimate).has_value();
  });
  return found == result.estimates.rend() ? nullptr : &*found;
}

const Estimate* FindBestClosedForm(const RunResult& result) {
  const Estimate* best = nullptr;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.kind != "closed_form" || !estimate.errors.holdout_rms_px) continue;
    if (best == nullptr || *estimate.errors.holdout_rms_px < *best->errors.holdout_rms_px) best = &estimate;
  }
  return best;
}

std::optional<double> TranslationSigmaMm(const Estimate& estimate) {
  const std::optional<double> sigma_m = SigmaOf(estimate, 0);
  return sigma_m ? std::optional<double>(1000 * *sigma_m) : std::nullopt;
}

std::optional<double> RotationSigmaDeg(const Estimate& estimate) {
  const std::optional<double> sigma_rad = SigmaOf(estimate, 3);
  return sigma_rad ? std::optional<double>(RadToDeg(*sigma_rad)) : std::nullopt;
}

int NumUsedCaptures(const RunResult& result) {
  return static_cast<int>(std::count_if(result.captures.begin(), result.captures.end(),
                                        [](const CaptureResult& capture) { return capture.used; }));
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace heba
