// Fuzzes target files, heba's and Kalibr's.
#include "heba/target.h"
#include "heba/config/yaml_reader.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  heba::Expect([&] {
    heba::MapReader reader(heba::ParseYaml(text, "target.yaml"));
    heba::CreateTarget(reader);
  });
  return 0;
}
