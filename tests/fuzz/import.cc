// Other projects' data sets of one file; the first byte says which form it is taken for.
#include "heba/io/import.h"
#include "tests/fuzz/target.h"

namespace {

void Check(const heba::ImportedSet& set) {
  for (const heba::ImportedCapture& capture : set.captures) {
    for (const std::optional<heba::Rigid3d>& pose : {capture.base_from_gripper, capture.camera_from_target}) {
      heba::Require(!pose || pose->Matrix().allFinite(), "a pose is finite");
    }
    for (const Eigen::Vector2d& pixel : capture.pixels) heba::Require(pixel.allFinite(), "a pixel is finite");
    heba::Require(capture.ids.size() == capture.pixels.size(), "an id a pixel");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const auto& formats = heba::ImportFormats();
  const std::string_view format = formats[data[0] % formats.size()].name;
  const std::filesystem::path file = heba::AsFile({reinterpret_cast<const char*>(data) + 1, size - 1}, ".txt");
  heba::Expect([&] { Check(heba::ImportDataSet(file, format)); });
  heba::Expect([&] { Check(heba::ImportDataSet(file, "")); });
  return 0;
}
