#include "tools/text/console.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "heba/base/text.h"

namespace heba {
namespace {

// Replaces control characters by question marks: in names of files and configs they could move the terminal's cursor.
// The program's own escape sequences for bold and plain are kept.
std::string WithoutControls(const std::string& text) {
  std::string shown = text;
  for (size_t i = 0; i < shown.size(); ++i) {
    const auto byte = static_cast<unsigned char>(shown[i]);
    if ((byte >= 0x20 && byte != 0x7f) || shown[i] == '\n') continue;
    const std::string_view rest = std::string_view(shown).substr(i);
    if (!rest.starts_with("\x1b[1m") && !rest.starts_with("\x1b[0m")) shown[i] = '?';
  }
  return shown;
}

std::string Fitted(const std::string& text, int descriptor) {
  constexpr size_t kWidthOfFiles = 160;
  constexpr size_t kUsualWidth = 80;
  if (isatty(descriptor) == 0) return Wrapped(WithoutControls(text), kWidthOfFiles);
  winsize size{};
  const bool is_known = ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return Wrapped(WithoutControls(text), is_known ? size.ws_col : kUsualWidth);
}

}  // namespace

void Console::Note(const std::string& line) {
  log_ += line + "\n";
  if (verbosity_ == Verbosity::kNormal) std::cerr << Fitted(line, STDERR_FILENO) << std::endl;
}

std::string ProgressBar(const std::string& what, int64_t done, int64_t total) {
  constexpr int64_t kWidth = 30;
  const auto filled = static_cast<size_t>(kWidth * done / total);
  return what + " [" + std::string(filled, '#') + std::string(static_cast<size_t>(kWidth) - filled, '.') + "] " +
         std::to_string(done) + "/" + std::to_string(total);
}

Progress::Progress(std::string what, int64_t total, Verbosity verbosity)
    : what_(std::move(what)),
      total_(total),
      quiet_(verbosity == Verbosity::kQuiet || total <= 0),
      terminal_(isatty(STDERR_FILENO) != 0) {
  if (!quiet_ && terminal_) Draw();
}

Progress::~Progress() {
  if (!quiet_ && terminal_) std::cerr << "\r\x1b[K" << std::flush;
}

void Progress::Step() {
  ++done_;
  if (quiet_) return;
  if (terminal_) {
    Draw();
  } else if (4 * done_ / total_ != 4 * (done_ - 1) / total_) {
    std::cerr << what_ << " " << done_ << "/" << total_ << std::endl;
  }
}

void Progress::Draw() const {
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  std::string left;
  if (done_ > 0 && done_ < total_) {
    const double steps_left_per_done = static_cast<double>(total_ - done_) / static_cast<double>(done_);
    left = "  " + Fixed(seconds * steps_left_per_done, 0) + " s left";
  }
  std::cerr << "\r\x1b[K" << ProgressBar(what_, done_, total_) << left << std::flush;
}

bool UseColour() { return isatty(STDOUT_FILENO) != 0 && std::getenv("NO_COLOR") == nullptr; }

std::string ForTerminal(const std::string& text) { return Fitted(text, STDOUT_FILENO); }

void PrintError(const std::string& message) {
  std::string line = "heba: error: " + message;
  std::replace(line.begin(), line.end(), '\n', ' ');
  std::cerr << line << std::endl;
}

}  // namespace heba
