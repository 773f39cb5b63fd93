#include "heba/base/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {
namespace fs = std::filesystem;

namespace {

// A file descriptor that is closed by its destructor.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

bool WriteAll(int descriptor, std::string_view content) {
  while (!content.empty()) {
    const ssize_t count = write(descriptor, content.data(), content.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    content.remove_prefix(static_cast<size_t>(count));
  }
  return true;
}

}  // namespace

bool HasImageSuffix(const std::filesystem::path& path) {
  static constexpr std::array<std::string_view, 14> kSuffixes = {".png", ".jpg",  ".jpeg", ".bmp", ".dib",
                                                                 ".tif", ".tiff", ".pbm",  ".pgm", ".ppm",
                                                                 ".pnm", ".webp", ".exr",  ".jp2"};
  const std::string suffix = Lower(path.extension().string());
  return std::find(kSuffixes.begin(), kSuffixes.end(), suffix) != kSuffixes.end();
}

std::string FileMeant(const fs::path& path) {
  const auto digits_of = [](const std::string& name) {
    std::string digits;
    std::copy_if(name.begin(), name.end(), std::back_inserter(digits), [](char c) { return c >= '0' && c <= '9'; });
    return digits;
  };
  const std::string name = path.filename().string();
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  std::vector<std::string> likely;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::string other = entry->path().filename().string();
    if (digits_of(other) == digits_of(name)) likely.push_back(std::move(other));
  }
  std::sort(likely.begin(), likely.end());
  return DidYouMean(name, likely);
}

std::string ReadTextFile(const fs::path& path, size_t max_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError(path.string() + ": there is no such file" + FileMeant(path));
  if (fs::is_directory(status)) throw InputError(path.string() + ": this is a folder; a file is needed");
  // Reading from a pipe or a device may never end.
  if (!fs::is_regular_file(status)) throw InputError(path.string() + ": is not a regular file");
  // Files of the kernel look regular, and may wait for what never comes.
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) throw InputError(path.string() + ": cannot be read (" + std::strerror(errno) + ")");
  std::string content;
  char buffer[1 << 16];
  ssize_t num_read = 0;
  do {
    num_read = read(file, buffer, sizeof(buffer));
    if (num_read > 0) content.append(buffer, static_cast<size_t>(num_read));
  } while (content.size() <= max_bytes && (num_read > 0 || (num_read < 0 && errno == EINTR)));
  const int fault = num_read < 0 ? errno : 0;
  close(file);
  if (content.size() > max_bytes) {
    throw InputError(path.string() + ": larger than " + std::to_string(max_bytes >> 20) +
                     " MiB, the limit for this file");
  }
  if (fault != 0) throw InputError(path.string() + ": cannot be read (" + std::strerror(fault) + ")");
  return content;
}

void WriteFileAtomically(const fs::path& path, std::string_view content) {
  const auto fail = [&](int error) {
    const std::string fault = path.string() + ": cannot be written (" + std::strerror(error) + ")";
    constexpr std::array<int, 4> kDisk = {ENOSPC, EDQUOT, EIO, EFBIG};
    if (std::find(kDisk.begin(), kDisk.end(), error) != kDisk.end()) throw OutputError(fault);
    throw InputError(fault);
  };
  std::error_code status_error;
  const fs::file_status status = fs::symlink_status(path, status_error);
  if (fs::is_directory(status)) throw InputError(path.string() + ": is a folder; a file name is needed");
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw InputError(path.string() + ": is not a regular file, and is not replaced");
  }
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  const fs::path temporary =
      path.parent_path() / fs::path(".").concat(path.filename().string() + ".part-" + RandomName());
  constexpr mode_t kMode = 0666;
  // An unnamed file disappears if the program is interrupted. It gets its name through /proc, which may not be mounted.
  constexpr const char* kDescriptors = "/proc/self/fd";
  const bool has_proc = access(kDescriptors, X_OK) == 0;
  const Descriptor unnamed(has_proc ? open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, kMode) : -1);
  const bool is_unnamed = unnamed.number() >= 0;
  const Descriptor named(
      is_unnamed ? -1 : open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, kMode));
  const int descriptor = is_unnamed ? unnamed.number() : named.number();
  if (descriptor < 0) fail(errno);
  const auto give_up = [&](int error) {
    unlink(temporary.c_str());
    fail(error);
  };
  if (!WriteAll(descriptor, content) || fsync(descriptor) != 0) give_up(errno);
  if (is_unnamed) {
    const std::string handle = std::string(kDescriptors) + "/" + std::to_string(descriptor);
    if (linkat(AT_FDCWD, handle.c_str(), AT_FDCWD, temporary.c_str(), AT_SYMLINK_FOLLOW) != 0) give_up(errno);
  }
  if (rename(temporary.c_str(), path.c_str()) != 0) give_up(errno);
}

std::string RandomName() {
  unsigned long long number = 0;
  if (getentropy(&number, sizeof(number)) != 0) throw InputError("the system provides no random numbers");
  char text[20];
  std::snprintf(text, sizeof(text), "%016llx", number);
  return text;
}

}  // namespace heba
