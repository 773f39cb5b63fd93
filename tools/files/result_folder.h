// Folders that the program writes results into: they appear completely or not at all, and files in them that somebody
// else added or edited are never lost.
#pragma once

#include <filesystem>
#include <string>

namespace heba {

// A folder that appears completely or not at all: fill `staging()`, then call Commit(). It contains a record (the file
// .heba) of the files that were written and of their digests. An existing folder is replaced if it is empty or has
// such a record; other files in it are kept at their paths. The final path is untouched until Commit. Without Commit
// the staged files are removed.
class StagedFolder {
 public:
  // Creates the staging folder. A link to a folder stands for that folder. `kind` is the users' word for the content,
  // such as "a data set". Throws InputError if `final_path` is a file, if the folder there is neither empty nor has a
  // record, if one of its recorded files was changed since it was written, if its recorded content is of another kind,
  // or if the parent folder cannot be created or written; OutputError if the disk is full.
  explicit StagedFolder(const std::filesystem::path& final_path, const std::string& kind = "results");
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  const std::filesystem::path& staging() const { return staging_; }
  // Replaces the final folder in one step: whenever the program is killed, either the older results or the new ones
  // are there. Throws InputError, and replaces nothing, if a staged file has the name of a file there that is not
  // recorded or was changed; OutputError if the record cannot be written.
  void Commit();

 private:
  std::filesystem::path final_path_;
  std::filesystem::path staging_;
  std::string kind_;
  int lock_ = -1;
  bool committed_ = false;
};

// Removes the staging folders in `parent` that programs left behind when they were killed, but none that is still in
// use.
void RemoveStaleStaging(const std::filesystem::path& parent);

// Removes the folders of all StagedFolders of this program that are not committed. For a program that is about to end:
// further writes into them fail, and no further StagedFolder can be made.
void AbandonStaging();

// Reserves a folder for one program at a time, on one machine or on several that share it. It holds a lock on a file
// in the folder, which ends with the program in any case.
class FolderLock {
 public:
  enum class Kind { kAlone, kShared };  // kShared: several programs may hold it together.
  // Creates the folder if needed. Throws InputError if another program holds the lock.
  FolderLock(const std::filesystem::path& folder, const std::string& name, Kind kind);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace heba
