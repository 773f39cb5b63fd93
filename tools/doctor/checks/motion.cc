// Checks whether the motion determines the hand-eye pose.
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/closed_form/motion_analysis.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/text/failure_text.h"

namespace heba {

Checked Check_motion(const Examination& examination) {
  std::vector<Rigid3d> poses;
  for (const ExaminedView& view : examination.views) poses.push_back(view.view.camera_mount_from_target_mount);
  const MotionAnalysis motion = AnalyseMotion(poses);
  const std::optional<Failure> why = WhyNotObservable(motion);
  // A previous check has already reported why too few captures show the target.
  if (poses.size() < 3 && examination.found_wrong) return {};
  if (why) {
    return {{{Severity::kWrong, poses.size() < 3 ? SymptomCode("few_captures") : SymptomCode("motion"),
              FailureText(*why), "take 15 to 25 captures, with rotations of at least 20 deg about two or three axes"}}};
  }
  std::vector<Symptom> symptoms;
  constexpr size_t kFew = 8;
  if (poses.size() < kFew) {
    symptoms.push_back({Severity::kRemark, "few_captures",
                        "only " + std::to_string(poses.size()) + " captures can be used", "take 15 to 25"});
  }
  const double second_deg = RadToDeg(motion.rotation_rms_rad[1]);
  constexpr double kLittleDeg = 6;
  if (second_deg < kLittleDeg) {
    symptoms.push_back({Severity::kRemark, "little_rotation",
                        "the gripper rotated by " + Significant(RadToDeg(motion.rotation_rms_rad[0]), 2) +
                            " deg rms about one axis and by " + Significant(second_deg, 2) +
                            " deg about a second one: small rotations determine parts of the result poorly",
                        "rotate it by at least 20 deg about two or three axes"});
  }
  return {std::move(symptoms)};
}

}  // namespace heba
