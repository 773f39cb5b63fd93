// Camera files of every form.
#include "heba/io/camera_file.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  heba::ExpectOneLine([&] { heba::ParseCameraFile(text, "camera.yaml"); });
  return 0;
}
