// Pose files in every form; the first byte says which.
#include "heba/io/pose_file.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const auto& formats = heba::PoseFormats();
  const heba::PoseFormat& format = formats[data[0] % formats.size()];
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  heba::Expect([&] {
    const std::vector<heba::PoseRow> rows = heba::ParsePoses(text, "poses.csv", format);
    // What was read can be written and read again.
    heba::ParsePoses(heba::PoseFileText(rows, format), "poses.csv", format);
  });
  return 0;
}
