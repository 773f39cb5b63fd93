#include "heba/base/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <system_error>

#include "heba/base/error.h"

namespace heba {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kStagingSuffix = ".part";

// What was written to a file, or into a folder, is on the disk.
void Sync(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  close(descriptor);
}

}  // namespace

bool HasImageSuffix(const std::filesystem::path& path) {
  static constexpr std::array<std::string_view, 13> kSuffixes = {
      ".png", ".jpg", ".jpeg", ".bmp", ".dib", ".tif", ".tiff", ".pgm", ".ppm", ".pnm", ".webp", ".exr", ".jp2"};
  std::string suffix = path.extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kSuffixes.begin(), kSuffixes.end(), suffix) != kSuffixes.end();
}

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
  const fs::path temporary =
      path.parent_path() / ("." + path.filename().string() + std::string(kStagingSuffix) + std::to_string(getpid()));
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
  Sync(temporary);
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
  staging_ = final_path_.parent_path() /
             ("." + final_path_.filename().string() + std::string(kStagingSuffix) + std::to_string(getpid()));
  fs::remove_all(staging_, error);
  fs::create_directory(staging_, error);
  if (error) throw InputError(final_path_.string() + ": cannot be made (" + error.message() + ")");
  // It lives as long as this lock.
  lock_ = open(staging_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ >= 0) flock(lock_, LOCK_EX | LOCK_NB);
}

StagedFolder::~StagedFolder() {
  if (lock_ >= 0) close(lock_);
  if (committed_) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
}

void StagedFolder::Commit() {
  std::error_code error;
  Sync(staging_);
  if (fs::exists(final_path_, error)) {
    const int status = renameat2(AT_FDCWD, staging_.c_str(), AT_FDCWD, final_path_.c_str(), RENAME_EXCHANGE);
    if (status == 0) {
      committed_ = true;
      fs::remove_all(staging_, error);  // The older results.
      return;
    }
    // A file system that cannot exchange: away with the older results, and at once the new ones in their place.
    fs::remove_all(final_path_, error);
  }
  fs::rename(staging_, final_path_, error);
  if (error) throw InputError(final_path_.string() + ": cannot be written (" + error.message() + ")");
  committed_ = true;
}

void RemoveStaleStaging(const fs::path& parent) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, error)) {
    const std::string name = entry.path().filename().string();
    const size_t suffix = name.rfind(kStagingSuffix);
    if (!name.starts_with(".") || suffix == std::string::npos) continue;
    const std::string number = name.substr(suffix + kStagingSuffix.size());
    if (number.empty() || number.find_first_not_of("0123456789") != std::string::npos) continue;
    const int descriptor = open(entry.path().c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) continue;
    const bool is_free = flock(descriptor, LOCK_EX | LOCK_NB) == 0;
    close(descriptor);
    if (is_free) fs::remove_all(entry.path(), error);
  }
}

FolderLock::FolderLock(const fs::path& folder, const std::string& name, Kind kind) {
  std::error_code error;
  fs::create_directories(folder, error);
  const fs::path file = folder / name;
  descriptor_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) throw InputError(file.string() + ": cannot be made (" + std::strerror(errno) + ")");
  if (flock(descriptor_, (kind == Kind::kAlone ? LOCK_EX : LOCK_SH) | LOCK_NB) != 0) {
    const bool is_taken = errno == EWOULDBLOCK;
    const std::string reason = std::strerror(errno);
    close(descriptor_);
    throw InputError(folder.string() + (is_taken
                                            ? ": another heba works in this folder; wait for it, or name another one"
                                            : ": cannot be locked (" + reason + ")"));
  }
}

FolderLock::~FolderLock() { close(descriptor_); }

}  // namespace heba
