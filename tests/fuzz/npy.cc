// Fuzzes NumPy arrays.
#include "heba/io/npy_file.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  heba::Expect([&] {
    const heba::NumberArray array = heba::ParseNpy(bytes, "array.npy");
    size_t count = 1;
    for (const size_t length : array.shape) count *= length;
    CHECK_EQ(count, array.numbers.size());
  });
  return 0;
}
