// Functions shared by the fuzz targets. A fuzz target is a file with LLVMFuzzerTestOneInput: for any bytes, the
// parser under test either reads them or throws an InputError.
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

// Runs `parse`; an exception other than InputError ends the program.
template <class Parse>
void Expect(const Parse& parse) {
  try {
    parse();
  } catch (const InputError&) {
    // The parser refused its input with a message.
  }
}

// Ends the program unless a property of the parsed data holds.
inline void Require(bool condition, const char* what) {
  if (condition) return;
  std::cerr << "violated: " << what << std::endl;
  std::abort();
}

// Writes the input to a file for parsers that read files. Each process has its own file, in memory if the machine
// supports it.
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
