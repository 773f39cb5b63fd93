#include "tools/files/program_digest.h"

#include <filesystem>
#include <fstream>
#include <set>
#include <system_error>

#include "tools/run/digest.h"

namespace heba {
namespace {

// Lists the shared libraries that the program runs with: their paths, which contain versions, sizes and times. A Python
// module of heba is one of them.
std::string LibrariesInUse() {
  std::set<std::string> libraries;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const size_t path = line.find('/');
    if (path == std::string::npos || line.find(".so", path) == std::string::npos) continue;
    std::error_code no_size;
    std::error_code no_time;
    const std::uintmax_t size = std::filesystem::file_size(line.substr(path), no_size);
    const auto time = std::filesystem::last_write_time(line.substr(path), no_time).time_since_epoch().count();
    libraries.insert(line.substr(path) + " " + std::to_string(no_size ? 0 : size) + " " +
                     std::to_string(no_time ? 0 : time) + "\n");
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
