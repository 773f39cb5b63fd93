// Runs the program from the command line.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace heba {

inline std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream content;
  content << stream.rdbuf();
  return content.str();
}

inline void WriteAll(const std::filesystem::path& path, const std::string& content) {
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  stream << content;
}

// Joins lines that the program has wrapped at 160 characters and continued with indentation.
inline std::string Unbroken(const std::string& text) {
  std::string whole;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text.compare(i, 3, "\n  ") != 0) {
      whole += text[i];
      continue;
    }
    i = text.find_first_not_of(' ', i + 1) - 1;
    whole += ' ';
  }
  return whole;
}

struct CommandResult {
  int status = -1;  // -1 if the program was ended by a signal.
  std::string out;
  std::string err;
};

inline std::string ShellQuoted(const std::string& word) {
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

// Returns an empty folder for this test program, which is removed at its end.
inline std::filesystem::path TestFolder(const std::string& name) {
  struct Folders {
    std::vector<std::filesystem::path> all;
    ~Folders() {
      std::error_code ignored;
      for (const std::filesystem::path& folder : all) std::filesystem::remove_all(folder, ignored);
    }
  };
  static Folders folders;
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("heba_" + name + "_" + std::to_string(getpid()));
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  folders.all.push_back(folder);
  return folder;
}

// `environment` holds assignments for the shell. By default no detections are read from or written to the cache.
inline CommandResult RunHeba(const std::vector<std::string>& arguments,
                             const std::string& environment = "HEBA_CACHE=") {
  static std::atomic<int> calls = 0;
  const std::string base = (std::filesystem::path(testing::TempDir()) /
                            ("heba_cli_" + std::to_string(getpid()) + "_" + std::to_string(calls++)))
                               .string();
  std::string command = environment + " " + ShellQuoted(HEBA_PROGRAM);
  for (const std::string& argument : arguments) command += " " + ShellQuoted(argument);
  command += " > " + ShellQuoted(base + ".out") + " 2> " + ShellQuoted(base + ".err") + " < /dev/null";
  const int raw = std::system(command.c_str());
  CommandResult result;
  // A shell reports a signal as 128 plus its number.
  if (WIFEXITED(raw) && WEXITSTATUS(raw) < 128) result.status = WEXITSTATUS(raw);
  result.out = ReadAll(base + ".out");
  result.err = ReadAll(base + ".err");
  std::filesystem::remove(base + ".out");
  std::filesystem::remove(base + ".err");
  return result;
}

}  // namespace heba
