// Fuzzes YAML configs: the reader with its limits, and the conversion of every value.
#include "heba/config/yaml_reader.h"
#include "tests/fuzz/target.h"

namespace {

void Walk(const heba::ConfigValue& value, int depth) {
  if (depth > 20) return;
  if (value.IsList()) {
    for (const heba::ConfigValue& item : value.AsList()) Walk(item, depth + 1);
  } else if (value.IsMap()) {
    heba::MapReader reader(value);
    for (const auto& entry : value.node()) {
      if (entry.first.IsScalar()) Walk(reader.Get(entry.first.Scalar()), depth + 1);
    }
  } else {
    heba::Expect([&] { value.AsQuantity(heba::Quantity::kLength); });
    heba::Expect([&] { value.AsNumber(); });
    heba::Expect([&] { value.AsChoice({"chessboard", "charuco"}); });
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  heba::Expect([&] { Walk(heba::ParseYaml(text, "config.yaml"), 0); });
  return 0;
}
