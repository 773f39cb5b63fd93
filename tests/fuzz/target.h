// What the fuzz targets share. A target is a file with LLVMFuzzerTestOneInput: whatever bytes it is given, the parser
// that it feeds either reads them or throws an InputError of one line.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

#include "heba/base/error.h"

namespace heba {

// Runs `parse`; anything but success or an InputError of one line ends the program.
template <class Parse>
void ExpectOneLine(const Parse& parse) {
  try {
    parse();
  } catch (const InputError& error) {
    const std::string message = error.what();
    if (message.empty() || message.find('\n') != std::string::npos) {
      std::cerr << "not one line: " << message << std::endl;
      std::abort();
    }
  }
}

// The input as a file, for parsers that read files. Each process has its own, in memory where the machine has that.
inline std::filesystem::path AsFile(const std::string& text, const std::string& suffix) {
  static const std::filesystem::path folder = [] {
    const std::filesystem::path shared = "/dev/shm";
    std::error_code error;
    const std::filesystem::path root =
        std::filesystem::is_directory(shared, error) ? shared : std::filesystem::temp_directory_path();
    const std::filesystem::path own = root / ("heba_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(own);
    return own;
  }();
  const std::filesystem::path path = folder / ("input" + suffix);
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
  return path;
}

}  // namespace heba

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);
