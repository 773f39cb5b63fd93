// Folders that the program writes results into: whole or not at all, and nothing in them lost that somebody else put
// there or edited.
#pragma once

#include <filesystem>
#include <string>

namespace heba {

// A folder that appears whole or not at all: fill `staging()`, then Commit(). It holds a record (the file .heba) of the
// files that were written and of their digests. A folder that is already there is replaced if it is empty or has such a
// record; other files in it are kept, in place. What was at the final place is untouched until Commit. Without Commit
// the staged files are removed.
class StagedFolder {
 public:
  // A link to a folder stands for that folder. InputError if a file stands at `final_path`, if a folder there is
  // neither empty nor has a record, if one of its recorded files was changed since it was written, or if the parent
  // folder cannot be made or written; also if what is recorded there is of another kind, which nobody asked to replace.
  // `kind` is what users call the content, such as "a data set".
  explicit StagedFolder(const std::filesystem::path& final_path, const std::string& kind = "results");
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  const std::filesystem::path& staging() const { return staging_; }
  // In one step: whenever the program is ended, either the older results or the new ones are there. InputError, and
  // nothing is replaced, if a staged file has the name of a file there that is not recorded or was changed.
  void Commit();

 private:
  std::filesystem::path final_path_;
  std::filesystem::path staging_;
  std::string kind_;
  int lock_ = -1;
  bool committed_ = false;
};

// Removes what StagedFolders of programs that were ended have left in `parent`, and nothing that is still at work.
void RemoveStaleStaging(const std::filesystem::path& parent);

// Removes the folders of all StagedFolders of this program that are not committed. For a program that is about to end:
// the files that are still written into them fail, and no further StagedFolder can be made.
void AbandonStaging();

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
