// Reports the findings of `heba run`, with their codes, for a data set in which the other checks found nothing wrong.
#include <algorithm>
#include <utility>

#include "heba/base/error.h"
#include "heba/run.h"
#include "tools/doctor/doctor.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/text/failure_text.h"

namespace heba {

Checked Check_result(const Examination& examination) {
  if (examination.found_wrong) return {};
  Dataset data = examination.config.data;
  if (data.has_camera.front() && examination.camera) data.rig.cameras.front().camera = *examination.camera;
  // The images have been searched.
  const std::vector<TargetDetection>& detections = examination.detections;
  if (!data.given_detections.empty()) data.given_detections = detections;
  RunOptions options = examination.config.options;
  options.num_threads = examination.num_threads;
  options.detect = {[&](const std::filesystem::path& image, const std::optional<ImageSize>& /*expected*/) {
    const auto found = std::find_if(detections.begin(), detections.end(), [&](const TargetDetection& seen) {
      return data.captures[seen.capture].images.front() == image;
    });
    CHECK(found != detections.end());
    return found->detection;
  }};
  const Outcome<RunOutput> run = Run(data, options);
  if (!run) return {{{Severity::kWrong, "no_result", FailureText(run.failure()), ""}}};
  std::vector<Symptom> symptoms;
  for (const Finding& finding : run->result.verdict.findings) {
    if (finding.grade == Grade::kGood) continue;
    symptoms.push_back(SymptomOf(finding));
  }
  return {std::move(symptoms)};
}

}  // namespace heba
