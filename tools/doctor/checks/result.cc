// What the calibration itself has to say, of a data set in which the other checks found nothing wrong.
#include "solvers/calibration.h"
#include "tools/captures.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"

namespace heba {

std::vector<Symptom> Check_result(Examination* examination) {
  if (examination->found_wrong) return {};
  const CaptureDetection& picture = examination->detections.front();
  CalibrationOptions options = OptionsOf(examination->config, picture.width_px, picture.height_px);
  options.camera = examination->camera;
  std::vector<View> views;
  for (const ExaminedView& view : examination->views) views.push_back(view.view);
  const Outcome<Calibration> calibration = Calibrate(views, options);
  const std::string reason = !calibration ? calibration.reason() : calibration->refined.reason();
  if (!reason.empty()) return {{Severity::kWrong, "no_result", reason, ""}};
  std::vector<Symptom> symptoms;
  for (const std::string& sentence : Advise(*calibration, options)) {
    symptoms.push_back({Severity::kRemark, "advice", sentence, ""});
  }
  return symptoms;
}

}  // namespace heba
