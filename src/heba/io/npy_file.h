// Arrays as NumPy's numpy.save writes them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heba {

struct NumberArray {
  std::vector<size_t> shape;
  std::vector<double> numbers;  // Row by row: the last index runs first.
};

// Reads a .npy file (format 1, 2 or 3) of floats or integers of 1 to 8 bytes, lowest byte first. InputError for any
// other, for one that is cut off, and for a file over 64 MiB.
NumberArray ReadNpyFile(const std::filesystem::path& path);
// The same from its bytes; `name` is what messages call it.
NumberArray ParseNpy(const std::string& bytes, const std::filesystem::path& name);

}  // namespace heba
