// Files, read within limits and written whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace heba {

// Whether a file name has the suffix of a picture, of a format that heba reads or of one that it refuses in words.
bool HasImageSuffix(const std::filesystem::path& path);

// The whole file. InputError if it is missing, a folder, unreadable or larger than `max_bytes`.
std::string ReadTextFile(const std::filesystem::path& path, size_t max_bytes = size_t{64} << 20);

// Writes `content` to a file beside `path` and renames it into place, so that `path` is never seen half written.
// InputError if the folder does not exist or cannot be written.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

// A folder that appears whole or not at all: fill `staging()`, then Commit(). What was at the final place before is
// replaced by Commit and is untouched until then. Without Commit the staged files are removed.
class StagedFolder {
 public:
  // `marker` is a file that the folder will hold. A folder that is already there is replaced only if it is empty or has
  // such a file: results replace older results and nothing else. InputError otherwise, if a file stands at
  // `final_path`, or if the parent folder cannot be made or written.
  StagedFolder(const std::filesystem::path& final_path, const std::string& marker);
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  const std::filesystem::path& staging() const { return staging_; }
  // In one step: whenever the program is ended, either the older results or the new ones are there.
  void Commit();

 private:
  std::filesystem::path final_path_;
  std::filesystem::path staging_;
  int lock_ = -1;
  bool committed_ = false;
};

// Removes what StagedFolders of programs that were ended have left in `parent`, and nothing that is still at work.
void RemoveStaleStaging(const std::filesystem::path& parent);

// A folder for one program at a time, on one machine or on several that share it: a lock on a file in it, which ends
// with the program, however that ends.
class FolderLock {
 public:
  enum class Kind { kAlone, kShared };  // kShared: with others that want it shared.
  // Makes the folder if needed. InputError if another program has the lock.
  FolderLock(const std::filesystem::path& folder, const std::string& name, Kind kind);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace heba
