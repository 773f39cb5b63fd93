#include "tools/run/digest.h"

#include <xxhash.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <system_error>

#include "heba/base/error.h"

namespace heba {
namespace {

std::string Hex(const XXH128_hash_t& hash) {
  char text[40];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                static_cast<unsigned long long>(hash.low64));
  return text;
}

}  // namespace

std::string DigestOf(std::string_view content) { return Hex(XXH3_128bits(content.data(), content.size())); }

std::string DigestOfFile(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error)) {
    throw InputError(path.string() + ": is not a regular file");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
  CHECK(state != nullptr);
  XXH3_128bits_reset(state.get());
  char buffer[1 << 16];
  while (stream.read(buffer, sizeof(buffer)) || stream.gcount() > 0) {
    XXH3_128bits_update(state.get(), buffer, static_cast<size_t>(stream.gcount()));
  }
  if (stream.bad()) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  return Hex(XXH3_128bits_digest(state.get()));
}

}  // namespace heba
