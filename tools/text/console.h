// What a person at the terminal sees while the program works, and the log of it.
#pragma once

#include <chrono>
#include <string>

namespace heba {

// The exit statuses of the program.
enum ExitStatus { kDone = 0, kWorkFailed = 1, kInputWrong = 2 };

enum class Verbosity { kNormal, kQuiet };

// Lines for standard error, kept for log.txt.
class Console {
 public:
  explicit Console(Verbosity verbosity) : verbosity_(verbosity) {}
  // A line for the log and, unless quiet, for the terminal.
  void Note(const std::string& line);
  const std::string& log() const { return log_; }
  Verbosity verbosity() const { return verbosity_; }

 private:
  Verbosity verbosity_;
  std::string log_;
};

// Progress of `total` like steps: a bar on a terminal, a line for each quarter otherwise, nothing if quiet. Not to be
// used from two threads at once.
class Progress {
 public:
  Progress(std::string what, int total, Verbosity verbosity);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void Step();

 private:
  void Draw() const;

  std::string what_;
  int total_;
  int done_ = 0;
  bool quiet_;
  bool terminal_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Whether standard output may be coloured: a terminal, and no NO_COLOR in the environment.
bool UseColour();

// Text for standard output: long lines broken to a terminal's width, or to 160 characters where it is none, and
// control characters as question marks.
std::string ForTerminal(const std::string& text);

// Prints "heba: error: " and `message`, made one line, on standard error.
void PrintError(const std::string& message);

}  // namespace heba
