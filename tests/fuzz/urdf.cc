// URDFs.
#include "heba/robot/urdf_arm.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = heba::AsFile({reinterpret_cast<const char*>(data), size}, ".urdf");
  heba::ExpectOneLine([&] {
    const auto arm = heba::UrdfArm::Read(file);
    arm->BaseFromTip(std::vector<double>(arm->joint_names().size(), 0.5));
  });
  return 0;
}
