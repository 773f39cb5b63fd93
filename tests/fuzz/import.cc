// Fuzzes imported data sets that consist of one file; the first byte selects the format.
#include "heba/io/import.h"
#include "tests/fuzz/imported.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const auto& formats = heba::ImportFormats();
  const std::string_view format = formats[data[0] % formats.size()].name;
  const std::filesystem::path file = heba::AsFile({reinterpret_cast<const char*>(data) + 1, size - 1}, ".txt");
  heba::Expect([&] { heba::CheckImported(heba::ImportDataSet(file, format)); });
  heba::Expect([&] { heba::CheckImported(heba::ImportDataSet(file, "")); });
  heba::Expect([&] { heba::CheckImported(heba::ImportCell(file, format)); });
  return 0;
}
