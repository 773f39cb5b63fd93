#include "tools/files/program_digest.h"

#include <filesystem>
#include <fstream>
#include <set>
#include <system_error>

#include "tools/run/digest.h"

namespace heba {
namespace {

// Lists the shared libraries that the program runs with: their paths, which contain versions, and sizes.
std::string LibrariesInUse() {
  std::set<std::string> libraries;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const size_t path = line.find('/');
    if (path == std::string::npos || line.find(".so", path) == std::string::npos) continue;
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(line.substr(path), error);
    libraries.insert(line.substr(path) + " " + std::to_string(error ? 0 : size) + "\n");
  }
  std::string text;
  for (const std::string& library : libraries) text += library;
  return text;
}

}  // namespace

const std::string& DigestOfProgram() {
  static const std::string digest = DigestOf(DigestOfFile("/proc/self/exe") + LibrariesInUse());
  return digest;
}

}  // namespace heba
