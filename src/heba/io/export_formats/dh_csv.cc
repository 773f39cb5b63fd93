// A table of the arm's parameters, one line per joint: theta, d, a, alpha in the standard convention of Denavit and
// Hartenberg, Hayati's angle beta, and the compliance (heba/robot/arm.h).
#include "heba/io/export_format.h"
#include "heba/robot/arm.h"

namespace heba {

Outcome<std::string> ExportFormat_dh_csv(const ExportRequest& request) {
  const Arm& arm = *request.arm;
  std::string text = CommentLines(ArmRemarks(request), "# ");
  text += "# base_from_first (x, y, z in m, qx, qy, qz, qw): " +
          JoinNumbers(TranslationAndQuaternion(arm.base_from_first), " ") + "\n";
  text += "# last_from_flange (x, y, z in m, qx, qy, qz, qw): " +
          JoinNumbers(TranslationAndQuaternion(arm.last_from_tip), " ") + "\n";
  text += "joint,theta_rad,d_m,a_m,alpha_rad,beta_rad,compliance_rad_per_nm\n";
  for (int j = 0; j < arm.num_joints(); ++j) {
    const ArmJoint& joint = arm.joints[static_cast<size_t>(j)];
    text +=
        std::to_string(j + 1) + "," +
        JoinNumbers({joint.theta_rad, joint.d_m, joint.a_m, joint.alpha_rad, joint.beta_rad, joint.compliance}, ",") +
        "\n";
  }
  return text;
}

}  // namespace heba
