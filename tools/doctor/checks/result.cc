// Reports the findings of `heba run`, with their codes, for a data set in which the other checks found nothing wrong.
#include <utility>

#include "heba/pair_run.h"
#include "tools/doctor/doctor.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/text/failure_text.h"

namespace heba {

std::vector<Symptom> Check_result(Examination* examination) {
  if (examination->found_wrong) return {};
  PairDataset data = examination->config.data;
  if (data.camera) data.camera = examination->camera;
  // The images have been searched.
  const std::vector<CaptureDetection>& detections = examination->detections;
  if (!data.given_detections.empty()) data.given_detections = detections;
  PairRunOptions options = examination->config.options;
  options.num_threads = examination->num_threads;
  options.detect = [&](const std::filesystem::path& image, const std::optional<ImageSize>& /*expected*/) {
    size_t i = 0;
    while (data.captures[i].image != image) ++i;
    return detections[i];
  };
  const Outcome<RunOutput> run = Run(data, options);
  if (!run) return {{Severity::kWrong, "no_result", FailureText(run.failure()), ""}};
  std::vector<Symptom> symptoms;
  for (const Finding& finding : run->result.verdict.findings) {
    if (finding.grade == Grade::kGood) continue;
    symptoms.push_back(SymptomOf(finding));
  }
  return symptoms;
}

}  // namespace heba
