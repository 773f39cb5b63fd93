// Terminal output while the program works, and its log.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace heba {

// The exit statuses of the program.
enum ExitStatus { kDone = 0, kWorkFailed = 1, kInputWrong = 2 };

enum class Verbosity { kNormal, kQuiet };

// Prints lines on standard error and keeps them for log.txt.
class Console {
 public:
  explicit Console(Verbosity verbosity) : verbosity_(verbosity) {}
  // Adds a line to the log and, unless quiet, prints it.
  void Note(const std::string& line);
  const std::string& log() const { return log_; }
  Verbosity verbosity() const { return verbosity_; }

 private:
  Verbosity verbosity_;
  std::string log_;
};

// Returns the bar that a terminal shows: "detect [######......] 2/4", 30 characters wide. `total` must be positive.
std::string ProgressBar(const std::string& what, int64_t done, int64_t total);

// Shows the progress of `total` equal steps: a bar on a terminal, otherwise a line for each quarter, nothing if quiet.
// Not thread-safe.
class Progress {
 public:
  Progress(std::string what, int64_t total, Verbosity verbosity);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void Step();

 private:
  void Draw() const;

  std::string what_;
  int64_t total_;
  int64_t done_ = 0;
  bool quiet_;
  bool terminal_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Returns whether standard output may be coloured: if it is a terminal, and NO_COLOR is not set in the environment.
bool UseColour();

// Prepares text for standard output: breaks long lines at the terminal's width, or at 160 characters if it is no
// terminal, and replaces control characters by question marks.
std::string ForTerminal(const std::string& text);

// Prints "heba: error: " and `message`, made one line, on standard error.
void PrintError(const std::string& message);

}  // namespace heba
