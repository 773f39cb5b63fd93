// Fuzzes pose files in every format; the first byte selects it. The last formats are user-defined; their files need
// no header.
#include "heba/io/pose_file.h"
#include "tests/fuzz/target.h"

namespace {

std::vector<heba::PoseFormat> Formats() {
  std::vector<heba::PoseFormat> formats = heba::PoseFormats();
  for (const char* const own : {"{columns: [x, y, z, a, b, c], translation: mm, rotation: euler_zyx, angle: deg}",
                                "{columns: [image, '-', x, y, z, qw, qx, qy, qz, role], translation: m, rotation: "
                                "quaternion_wxyz}"}) {
    formats.push_back(heba::ReadPoseFormat(heba::ParseYaml(own, "own.yaml")));
  }
  return formats;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  static const std::vector<heba::PoseFormat> formats = Formats();
  const heba::PoseFormat& format = formats[data[0] % formats.size()];
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  heba::Expect([&] {
    const std::vector<heba::PoseRow> rows = heba::ParsePoses(text, "poses.csv", format);
    // Poses that were read can be written and read again.
    heba::ParsePoses(heba::PoseFileText(rows, format), "poses.csv", format);
  });
  return 0;
}
