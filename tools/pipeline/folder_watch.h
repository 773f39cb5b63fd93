// Waits for files to be written into folders.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <set>

namespace heba {

// Follows folders by inotify, where the system has it. Network drives report nothing of what other machines write: a
// caller looks by itself after each wait, too.
class FolderWatch {
 public:
  FolderWatch();
  ~FolderWatch();
  FolderWatch(const FolderWatch&) = delete;
  FolderWatch& operator=(const FolderWatch&) = delete;

  // Follows these folders beside the others. One that does not exist is not followed.
  void Follow(const std::set<std::filesystem::path>& folders);

  // Waits until something has happened in one of the folders, or for `at_most`. Returns the files that were closed by
  // their writers or moved to where they are: these are complete.
  std::set<std::filesystem::path> Wait(std::chrono::milliseconds at_most);

 private:
  int file_ = -1;  // The descriptor of inotify; negative if there is none.
  std::map<std::filesystem::path, int> watches_;
};

}  // namespace heba
