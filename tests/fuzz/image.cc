// Fuzzes image files.
#include "targets/images/image.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = heba::AsFile({reinterpret_cast<const char*>(data), size}, ".png");
  heba::Expect([&] { heba::ReadGreyImage(file); });
  return 0;
}
