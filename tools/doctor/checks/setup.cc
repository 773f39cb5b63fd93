// Reports the setup in the config and the other one that fits equally well, because no data can distinguish them.
#include "solvers/initial/pose_consistency.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"
#include "tools/run/captures.h"

namespace heba {

Checked Check_setup(const Examination& examination) {
  if (examination.found_wrong) return {};
  const Setup setup = SetupOf(examination.config.data);
  const std::optional<PoseConsistency> consistency =
      FindPoseConsistency(CandidatesOf(examination.views), RobotScale::kOne);
  if (!consistency) return {};
  const Rigid3d& hand_eye = consistency->hand_eye.camera_mount_from_camera;
  const bool is_carried = setup == Setup::kEyeInHand;
  const Setup other = is_carried ? Setup::kEyeToHand : Setup::kEyeInHand;
  return {{{Severity::kRemark, "either_set_up",
            std::string("according to the config, the camera is ") +
                (is_carried ? "carried by the robot" : "fixed beside the robot") + ", roughly " +
                HandEyeText(setup, hand_eye) + "; the same numbers fit a camera that is " +
                (is_carried ? "fixed beside the robot" : "carried by the robot") +
                ", with inverted poses, equally well: " + HandEyeText(other, hand_eye),
            "no data can distinguish the two: check which one applies"}}};
}

}  // namespace heba
