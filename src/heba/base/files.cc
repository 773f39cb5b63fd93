#include "heba/base/files.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "heba/base/error.h"

namespace heba {
namespace fs = std::filesystem;

std::string ReadTextFile(const fs::path& path, size_t max_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError(path.string() + ": there is no such file");
  if (fs::is_directory(status)) throw InputError(path.string() + ": this is a folder; a file is needed");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  std::string content;
  char buffer[1 << 16];
  while (stream.read(buffer, sizeof(buffer)) || stream.gcount() > 0) {
    content.append(buffer, static_cast<size_t>(stream.gcount()));
    if (content.size() > max_bytes) {
      throw InputError(path.string() + ": larger than " + std::to_string(max_bytes >> 20) +
                       " MiB, the limit for this file");
    }
  }
  if (stream.bad()) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  return content;
}

void WriteFileAtomically(const fs::path& path, std::string_view content) {
  const fs::path temporary = path.parent_path() / ("." + path.filename().string() + ".part" + std::to_string(getpid()));
  {
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    stream.write(content.data(), static_cast<std::streamsize>(content.size()));
    stream.flush();
    if (!stream) {
      const std::string reason = std::strerror(errno);
      std::error_code ignored;
      fs::remove(temporary, ignored);
      throw InputError(path.string() + ": cannot be written (" + reason + ")");
    }
  }
  std::error_code error;
  fs::rename(temporary, path, error);
  if (error) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw InputError(path.string() + ": cannot be written (" + error.message() + ")");
  }
}

StagedFolder::StagedFolder(const fs::path& final_path, const std::string& marker) {
  // "runs/x/" and "runs/x" are the same folder.
  final_path_ = fs::absolute(final_path).lexically_normal();
  if (final_path_.filename().empty()) final_path_ = final_path_.parent_path();
  std::error_code error;
  if (fs::exists(final_path_, error) && !fs::is_directory(final_path_, error)) {
    throw InputError(final_path_.string() + ": is a file; the results need a folder of that name");
  }
  if (fs::is_directory(final_path_, error) && !fs::is_empty(final_path_, error) &&
      !fs::exists(final_path_ / marker, error)) {
    throw InputError(final_path_.string() + ": holds other files (no " + marker +
                     "), so it is not replaced; name a new or empty folder");
  }
  fs::create_directories(final_path_.parent_path(), error);
  staging_ = final_path_.parent_path() / ("." + final_path_.filename().string() + ".part" + std::to_string(getpid()));
  fs::remove_all(staging_, error);
  fs::create_directory(staging_, error);
  if (error) throw InputError(final_path_.string() + ": cannot be made (" + error.message() + ")");
}

StagedFolder::~StagedFolder() {
  if (committed_) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
}

void StagedFolder::Commit() {
  std::error_code error;
  const fs::path old = staging_.string() + ".old";
  if (fs::exists(final_path_)) {
    fs::rename(final_path_, old, error);
    if (error) throw InputError(final_path_.string() + ": cannot be replaced (" + error.message() + ")");
  }
  fs::rename(staging_, final_path_, error);
  if (error) {
    std::error_code ignored;
    fs::rename(old, final_path_, ignored);
    throw InputError(final_path_.string() + ": cannot be written (" + error.message() + ")");
  }
  committed_ = true;
  fs::remove_all(old, error);
}

}  // namespace heba
