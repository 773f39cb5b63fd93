// Fuzzes the calibration files of Universal Robots' controllers.
#include "heba/io/ur_calibration_file.h"

#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  heba::Expect([&] {
    const heba::Arm arm = heba::ParseUrCalibration(text, "calibration.conf", "ur5e");
    const heba::Rigid3d pose = heba::BaseFromTip(arm, Eigen::VectorXd::Zero(arm.num_joints()));
    heba::Require(pose.translation.allFinite(), "the pose is finite");
  });
  return 0;
}
