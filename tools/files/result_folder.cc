#include "tools/files/result_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "tools/run/digest.h"

namespace heba {
namespace fs = std::filesystem;

namespace {

constexpr const char* kRecordName = ".heba";
constexpr std::string_view kRecordHead = "heba folder 1\n";
constexpr std::string_view kStagingSuffix = ".part-";

constexpr std::string_view kKindHead = "kind ";

// The digest of each file, by its path in the folder.
using Record = std::map<std::string, std::string>;

// Reads a folder's record; nothing for a folder that heba did not make.
std::optional<Record> ReadRecord(const fs::path& folder) {
  std::error_code error;
  const fs::path file = folder / kRecordName;
  if (!fs::is_regular_file(fs::symlink_status(file, error))) return std::nullopt;
  std::string text;
  try {
    text = ReadTextFile(file);
  } catch (const InputError&) {
    return std::nullopt;
  }
  if (!text.starts_with(kRecordHead)) return std::nullopt;
  Record record;
  std::istringstream lines(text.substr(kRecordHead.size()));
  constexpr size_t kDigits = 32;
  for (std::string line; std::getline(lines, line);) {
    if (line.size() > kDigits + 1 && line[kDigits] == ' ') record[line.substr(kDigits + 1)] = line.substr(0, kDigits);
  }
  return record;
}

// Returns the kind of content that a folder's record states; empty if it states none.
std::string KindOf(const fs::path& folder) {
  std::istringstream lines(ReadTextFile(folder / kRecordName));
  std::string line;
  std::getline(lines, line);
  std::getline(lines, line);
  return line.starts_with(kKindHead) ? line.substr(kKindHead.size()) : "";
}

// Returns the paths of everything in the folder except its record, folders before their contents.
std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    fs::path path = entry.path().lexically_relative(folder);
    if (path != kRecordName) entries.push_back(std::move(path));
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

bool IsFolder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(fs::symlink_status(path, error));
}

bool IsThere(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

// Throws InputError unless every recorded file may be replaced: it is as it was written, empty, or gone.
void CheckUnchanged(const fs::path& folder, const Record& record) {
  for (const auto& [name, digest] : record) {
    const fs::path file = folder / name;
    std::error_code error;
    if (!IsThere(file)) continue;
    const bool is_same = fs::is_regular_file(fs::symlink_status(file, error)) &&
                         (fs::file_size(file, error) == 0 || DigestOfFile(file) == digest);
    if (!is_same) {
      throw InputError(
          file.string() +
          ": was changed since heba wrote it, and would be replaced; move it away, or name another folder");
    }
  }
}

std::string RecordText(const fs::path& folder, const std::string& kind) {
  std::string text = std::string(kRecordHead) + std::string(kKindHead) + kind + "\n";
  for (const fs::path& entry : EntriesOf(folder)) {
    if (!IsFolder(folder / entry)) text += DigestOfFile(folder / entry) + " " + entry.string() + "\n";
  }
  return text;
}

// Links a file that is not heba's, or copies it if the file system does not support links.
void LinkOrCopy(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (fs::is_symlink(fs::symlink_status(from, error))) {
    fs::copy_symlink(from, to);
    return;
  }
  if (link(from.c_str(), to.c_str()) == 0) return;
  fs::copy_file(from, to);
}

// Adds everything in `older` that is not in its record to `newer`.
void KeepOthers(const fs::path& older, const Record& record, const fs::path& newer) {
  for (const fs::path& entry : EntriesOf(older)) {
    const bool is_folder = IsFolder(older / entry);
    if (record.count(entry.string()) > 0) continue;
    if (is_folder) {
      const bool is_of_results = std::any_of(
          record.begin(), record.end(), [&](const auto& file) { return file.first.starts_with(entry.string() + "/"); });
      if (!is_of_results && !IsThere(newer / entry)) fs::create_directories(newer / entry);
      continue;
    }
    if (IsThere(newer / entry)) {
      throw InputError((older / entry).string() +
                       ": was not written by heba, and would be replaced; move it away, or name another folder");
    }
    fs::create_directories((newer / entry).parent_path());
    LinkOrCopy(older / entry, newer / entry);
  }
}

// Removes a staging folder, its record last: if the program is killed, the rest is still recognised as heba's.
void RemoveStaging(const fs::path& folder) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().filename() != kRecordName) fs::remove_all(entry.path(), error);
  }
  fs::remove(folder / kRecordName, error);
  fs::remove(folder, error);
}

// Returns whether the open file still has a name; errno is ENOENT if it was removed meanwhile.
bool HasName(int descriptor) {
  struct stat status = {};
  if (fstat(descriptor, &status) != 0) return false;
  if (status.st_nlink == 0) errno = ENOENT;
  return status.st_nlink > 0;
}

// Returns whether `name` has the form ".NAME.part-0123456789abcdef".
bool IsStagingName(const std::string& name) {
  const size_t suffix = name.rfind(kStagingSuffix);
  if (!name.starts_with(".") || suffix == std::string::npos) return false;
  const std::string number = name.substr(suffix + kStagingSuffix.size());
  return number.size() == 16 && number.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// The folders that are being filled now.
struct AllStaging {
  std::mutex mutex;
  std::set<fs::path> folders;
  bool is_abandoned = false;
};
AllStaging& Staging() {
  static AllStaging staging;
  return staging;
}

}  // namespace

StagedFolder::StagedFolder(const fs::path& final_path, const std::string& kind) {
  // "runs/x/" and "runs/x" are the same folder, and a link stands for its target.
  kind_ = kind;
  final_path_ = fs::absolute(final_path).lexically_normal();
  if (final_path_.filename().empty()) final_path_ = final_path_.parent_path();
  std::error_code error;
  if (fs::is_symlink(fs::symlink_status(final_path_, error))) {
    const fs::path real = fs::canonical(final_path_, error);
    if (error) throw InputError(final_path_.string() + ": is a broken link; name a folder");
    final_path_ = real;
  }
  if (fs::exists(final_path_, error) && !fs::is_directory(final_path_, error)) {
    throw InputError(final_path_.string() + ": is a file; the results need a folder of that name");
  }
  if (fs::is_directory(final_path_, error) && !fs::is_empty(final_path_, error)) {
    const std::optional<Record> record = ReadRecord(final_path_);
    if (!record) {
      throw InputError(
          final_path_.string() +
          ": contains other files and was not created by heba, so it is not replaced; name a new or empty folder");
    }
    const std::string older_kind = KindOf(final_path_);
    if (!older_kind.empty() && older_kind != kind_) {
      throw InputError(final_path_.string() + ": contains " + older_kind + ", which " + kind_ +
                       " would replace; name another folder");
    }
    CheckUnchanged(final_path_, *record);
  }
  fs::create_directories(final_path_.parent_path(), error);
  RemoveStaleStaging(final_path_.parent_path());
  // The lock ensures that AbandonStaging knows every folder that exists, and that none is created after it.
  const std::lock_guard<std::mutex> guard(Staging().mutex);
  if (Staging().is_abandoned) throw InputError("interrupted");
  // Until its record is locked and written, another thread or program may consider the folder stale and remove it.
  constexpr int kMostTrials = 100;
  bool is_marked = false;
  for (int trial = 0; trial < kMostTrials && !is_marked; ++trial) {
    staging_ = final_path_.parent_path() /
               ("." + final_path_.filename().string() + std::string(kStagingSuffix) + RandomName());
    if (!fs::create_directory(staging_, error) || error) {
      if (error == std::errc::no_space_on_device) {
        throw OutputError(final_path_.string() + ": cannot be created (no space)");
      }
      throw InputError(final_path_.string() + ": cannot be created (" + error.message() + ")");
    }
    // The folder is in use as long as its record is locked; network file systems support such locks too.
    lock_ = open((staging_ / kRecordName).c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    is_marked = lock_ >= 0 && flock(lock_, LOCK_EX | LOCK_NB) == 0 && HasName(lock_) &&
                write(lock_, kRecordHead.data(), kRecordHead.size()) == static_cast<ssize_t>(kRecordHead.size());
    if (is_marked) break;
    const int reason = errno;
    if (lock_ >= 0) close(lock_);
    lock_ = -1;
    RemoveStaging(staging_);
    const bool was_taken_away = reason == ENOENT || reason == EWOULDBLOCK;
    if (!was_taken_away || trial + 1 == kMostTrials) {
      throw InputError(final_path_.string() + ": cannot be written (" + std::strerror(reason) + ")");
    }
  }
  Staging().folders.insert(staging_);
}

StagedFolder::~StagedFolder() {
  {
    const std::lock_guard<std::mutex> guard(Staging().mutex);
    Staging().folders.erase(staging_);
  }
  if (!committed_) RemoveStaging(staging_);
  if (lock_ >= 0) close(lock_);
}

void StagedFolder::Commit() {
  std::error_code error;
  const std::string record = RecordText(staging_, kind_);
  if (pwrite(lock_, record.data(), record.size(), 0) != static_cast<ssize_t>(record.size()) || fsync(lock_) != 0) {
    throw OutputError(final_path_.string() + ": cannot be written (" + std::strerror(errno) + ")");
  }
  if (!fs::exists(final_path_, error)) {
    fs::rename(staging_, final_path_, error);
    if (error) throw InputError(final_path_.string() + ": cannot be written (" + error.message() + ")");
    committed_ = true;
    return;
  }
  const Record older = ReadRecord(final_path_).value_or(Record());
  try {
    CheckUnchanged(final_path_, older);
    KeepOthers(final_path_, older, staging_);
  } catch (const fs::filesystem_error& fault) {
    throw InputError(final_path_.string() + ": cannot be replaced (" + fault.code().message() + ")");
  }
  if (renameat2(AT_FDCWD, staging_.c_str(), AT_FDCWD, final_path_.c_str(), RENAME_EXCHANGE) != 0) {
    // The file system cannot exchange folders: the older results are moved away, and the new ones immediately take
    // their place.
    const fs::path away = staging_.string() + "0";
    fs::rename(final_path_, away, error);
    if (!error) fs::rename(staging_, final_path_, error);
    if (error) throw InputError(final_path_.string() + ": cannot be written (" + error.message() + ")");
    fs::rename(away, staging_, error);
  }
  committed_ = true;
  // The staging folder now holds the older results. Files that were added to them meanwhile are kept.
  for (const fs::path& entry : EntriesOf(staging_)) {
    if (IsFolder(staging_ / entry) || older.count(entry.string()) > 0 || IsThere(final_path_ / entry)) continue;
    fs::create_directories((final_path_ / entry).parent_path(), error);
    fs::rename(staging_ / entry, final_path_ / entry, error);
  }
  RemoveStaging(staging_);
}

void RemoveStaleStaging(const fs::path& parent) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, error)) {
    if (!IsStagingName(entry.path().filename().string()) || !IsFolder(entry.path())) continue;
    if (!ReadRecord(entry.path())) {
      // Without a record the folder contains nothing of heba's. It is removed only if it is empty or contains an empty
      // record.
      const fs::path unwritten = entry.path() / kRecordName;
      const int descriptor = open(unwritten.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC);
      if (descriptor >= 0 && flock(descriptor, LOCK_EX | LOCK_NB) == 0 && fs::file_size(unwritten, error) == 0) {
        fs::remove(unwritten, error);
      }
      if (descriptor >= 0) close(descriptor);
      rmdir(entry.path().c_str());
      continue;
    }
    const int descriptor = open((entry.path() / kRecordName).c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor < 0) continue;
    if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) RemoveStaging(entry.path());
    close(descriptor);
  }
}

void AbandonStaging() {
  const std::lock_guard<std::mutex> guard(Staging().mutex);
  Staging().is_abandoned = true;
  for (const fs::path& folder : Staging().folders) {
    std::error_code error;
    // After renaming, nobody writes into it.
    const fs::path away = folder.string() + "0";
    fs::rename(folder, away, error);
    if (!error) RemoveStaging(away);
  }
}

FolderLock::FolderLock(const fs::path& folder, const std::string& name, Kind kind) {
  std::error_code error;
  fs::create_directories(folder, error);
  const fs::path file = folder / name;
  descriptor_ = open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (descriptor_ < 0) throw InputError(file.string() + ": cannot be created (" + std::strerror(errno) + ")");
  if (flock(descriptor_, (kind == Kind::kAlone ? LOCK_EX : LOCK_SH) | LOCK_NB) != 0) {
    const bool is_taken = errno == EWOULDBLOCK;
    const std::string reason = std::strerror(errno);
    close(descriptor_);
    throw InputError(folder.string() +
                     (is_taken ? ": another heba process is using this folder; wait for it, or name another one"
                               : ": cannot be locked (" + reason + ")"));
  }
}

FolderLock::~FolderLock() { close(descriptor_); }

}  // namespace heba
