// Arrays in the format of NumPy's numpy.save.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heba {

struct NumberArray {
  std::vector<size_t> shape;
  std::vector<double> numbers;  // Row-major: the last index varies fastest.
};

// Reads a .npy file (format version 1, 2 or 3) of floats (4 or 8 bytes) or integers (1 to 8 bytes, unsigned up to 4),
// in little-endian byte order. Throws InputError for any other content, for a truncated file and for a file over 64
// MiB.
NumberArray ReadNpyFile(const std::filesystem::path& path);
// Parses the bytes of such a file; `name` is the name of the file in messages.
NumberArray ParseNpy(const std::string& bytes, const std::filesystem::path& name);

}  // namespace heba
