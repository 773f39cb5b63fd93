#include "tools/files/program_digest.h"

#include <fstream>
#include <set>
#include <system_error>

#include "heba/base/error.h"
#include "heba/io/result_file.h"
#include "tools/run/digest.h"

namespace heba {
namespace {

// Lists the shared libraries that the program runs with: their paths, which contain versions, sizes and times. A Python
// module of heba is one of them.
std::string LibrariesInUse(const std::filesystem::path& process) {
  std::set<std::string> libraries;
  std::ifstream maps(process / "maps");
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

std::string DigestOfProcess(const std::filesystem::path& process) {
  std::string program;
  try {
    program = DigestOfFile(process / "exe");
  } catch (const InputError&) {
    program = Version() + " " + HEBA_COMMIT;
  }
  return DigestOf(program + LibrariesInUse(process));
}

const std::string& DigestOfProgram() {
  static const std::string digest = DigestOfProcess("/proc/self");
  return digest;
}

}  // namespace heba
