// Reports the findings of `heba run`, with their codes, for a data set in which the other checks found nothing wrong.
#include "heba/evaluation/verdict.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/run/assessment.h"
#include "tools/run/captures.h"
#include "tools/run/duplicate_images.h"

namespace heba {

std::vector<Symptom> Check_result(Examination* examination) {
  if (examination->found_wrong) return {};
  // Copies of a capture are left out, as in a run.
  RunConfig config = examination->config;
  std::vector<CaptureDetection> detections = examination->detections;
  LeaveOutSharedImages(&config, &detections);
  if (detections.empty()) return {};
  const CaptureDetection& image = detections.front();
  CalibrationOptions options = OptionsOf(config, image.width_px, image.height_px);
  if (options.camera) options.camera = examination->camera;
  options.bundle.num_threads = examination->num_threads;
  const Outcome<Calibration> calibration = Calibrate(ViewsOf(config, detections), options);
  const std::string reason = !calibration ? calibration.reason() : calibration->refined.reason();
  if (!reason.empty()) return {{Severity::kWrong, "no_result", reason, ""}};
  Console console(Verbosity::kQuiet);
  const RunResult result =
      Assess(config, detections, *calibration, options, std::nullopt, examination->num_threads, &console);
  std::vector<Symptom> symptoms;
  for (const Finding& finding : JudgeRun(result).findings) {
    if (finding.grade == Grade::kGood) continue;
    const Severity severity = finding.grade == Grade::kBad ? Severity::kWrong : Severity::kRemark;
    symptoms.push_back({severity, finding.code, finding.text, finding.action});
  }
  return symptoms;
}

}  // namespace heba
