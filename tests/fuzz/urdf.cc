// Fuzzes URDF files.
#include "heba/robot/urdf_arm.h"
#include "tests/fuzz/target.h"

// liburdfdom does not free a model that it refuses if its joints form a loop: links own their children.
extern "C" const char* __lsan_default_suppressions();   // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:liburdfdom_model";
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = heba::AsFile({reinterpret_cast<const char*>(data), size}, ".urdf");
  heba::Expect([&] {
    const heba::Arm arm = heba::ReadUrdfArm(file).arm;
    const heba::Rigid3d tip = heba::BaseFromTip(arm, Eigen::VectorXd::Constant(arm.num_joints(), 0.5));
    heba::Require(tip.Matrix().allFinite(), "the pose of the tip is finite");
  });
  return 0;
}
