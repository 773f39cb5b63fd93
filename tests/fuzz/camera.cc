// Fuzzes camera files.
#include <cmath>
#include "heba/io/camera_file.h"

#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  heba::Expect([&] {
    for (const double param : heba::ParseCameraFile(text, "camera.yaml").params) {
      heba::Require(std::isfinite(param), "a parameter is finite");
    }
  });
  return 0;
}
