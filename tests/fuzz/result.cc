// Fuzzes result.json and truth.json.
#include "heba/io/result_file.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::filesystem::path file = heba::AsFile({reinterpret_cast<const char*>(data), size}, ".json");
  heba::Expect([&] { heba::ResultToJson(heba::ReadRunResult(file)); });
  heba::Expect([&] { heba::ReadWholeResult(file); });
  heba::Expect([&] { heba::ReadTruth(file, heba::Setup::kEyeInHand); });
  return 0;
}
