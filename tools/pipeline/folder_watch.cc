#include "tools/pipeline/folder_watch.h"

#include <poll.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <thread>

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr uint32_t kComplete = IN_CLOSE_WRITE | IN_MOVED_TO;

}  // namespace

FolderWatch::FolderWatch() : file_(inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {}

FolderWatch::~FolderWatch() {
  if (file_ >= 0) close(file_);
}

void FolderWatch::Follow(const std::set<fs::path>& folders) {
  if (file_ < 0) return;
  for (const fs::path& folder : folders) {
    if (watches_.contains(folder)) continue;
    const int watch = inotify_add_watch(file_, folder.c_str(), kComplete | IN_CREATE | IN_ONLYDIR);
    if (watch >= 0) watches_[folder] = watch;
  }
}

std::set<fs::path> FolderWatch::Wait(std::chrono::milliseconds at_most) {
  std::set<fs::path> complete;
  if (file_ < 0) {
    std::this_thread::sleep_for(at_most);
    return complete;
  }
  pollfd ready{file_, POLLIN, 0};
  if (poll(&ready, 1, static_cast<int>(at_most.count())) <= 0) return complete;
  alignas(inotify_event) std::array<char, 16384> events{};
  for (ssize_t size = read(file_, events.data(), events.size()); size > 0;
       size = read(file_, events.data(), events.size())) {
    for (ssize_t at = 0; at < size;) {
      inotify_event event;
      std::memcpy(&event, events.data() + at, sizeof event);
      const std::string name = event.len > 0 ? events.data() + at + sizeof event : "";
      at += static_cast<ssize_t>(sizeof event + event.len);
      if ((event.mask & kComplete) == 0) continue;
      // A folder may have been named in several ways.
      for (const auto& [folder, watch] : watches_) {
        if (watch == event.wd) complete.insert(folder / name);
      }
    }
  }
  return complete;
}

}  // namespace heba
