// Tests the output on a terminal of 80 columns.
#include <fstream>
#include <regex>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/pipeline/cli.h"

namespace heba {
namespace {

constexpr const char* kBold = "\x1b[1m";

// Returns the lines of the program's standard output on a terminal of its own.
std::vector<std::string> LinesOnTerminal(const std::string& arguments, const std::string& environment) {
  const std::filesystem::path file = TestFolder("terminal") / "typescript";
  const std::string inner =
      "stty cols 80; " + environment +
      " HEBA_CACHE=" + ShellQuoted((std::filesystem::path(testing::TempDir()) / "heba_terminal_cache").string()) + " " +
      HEBA_PROGRAM + " " + arguments + " 2>/dev/null";
  const std::string command =
      "script -qec " + ShellQuoted(inner) + " " + ShellQuoted(file.string()) + " > /dev/null < /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  std::vector<std::string> lines;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.rfind("Script ", 0) != 0) lines.push_back(line);  // Lines that script itself writes first and last.
  }
  return lines;
}

size_t VisibleLength(std::string line) {
  for (const std::string code : {kBold, "\x1b[0m"}) {
    for (size_t at = line.find(code); at != std::string::npos; at = line.find(code)) line.erase(at, code.size());
  }
  return line.size();
}

std::string Whole(const std::vector<std::string>& lines) {
  std::string whole;
  for (const std::string& line : lines) whole += line + "\n";
  return whole;
}

TEST(TerminalTest, LinesFitTheTerminalAndColourIsOptional) {
  const std::filesystem::path folder = TestFolder("terminal_data");
  const std::string source = HEBA_SOURCE_DIR;
  ASSERT_EQ(RunHeba({"simulate", source + "/configs/sample_scene.yaml", "--set", "motion.captures=8", "--out",
                     (folder / "data").string(), "--quiet"})
                .status,
            0);
  WriteAll(folder / "study.yaml",
           "trials: 3\nscenes: {small: " + source + "/configs/scenes/ring4_eye_to_hand.yaml}\npixel_noise: [1 px]\n");
  const std::string config = (folder / "data/config.yaml").string();
  const std::string run = "run " + config + " --out " + (folder / "run").string();
  const std::vector<std::string> coloured = LinesOnTerminal(run, "env -u NO_COLOR");
  EXPECT_THAT(Whole(coloured), testing::HasSubstr(kBold));
  EXPECT_THAT(Whole(coloured), testing::HasSubstr("verdict: "));
  EXPECT_THAT(Whole(LinesOnTerminal(run, "env NO_COLOR=1")), testing::Not(testing::HasSubstr("\x1b")));
  // Piped output is not wrapped, and tables need no wrapping.
  const std::string piped = RunHeba({"run", config, "--out", (folder / "run").string()}).out;
  EXPECT_THAT(piped, testing::Not(testing::HasSubstr("\x1b")));
  EXPECT_FALSE(std::regex_search(piped, std::regex(R"([0-9]\.[0-9]+\.[0-9])"))) << "two columns run together:\n"
                                                                                << piped;
  const std::regex row(R"(\w+( +-?[0-9.]+){5,} *)");
  int num_rows = 0;
  std::istringstream stream(piped);
  for (std::string line; std::getline(stream, line);) {
    if (!std::regex_match(line, row)) continue;
    ++num_rows;
    EXPECT_LE(line.size(), 80U) << line;
    EXPECT_THAT(Whole(coloured), testing::HasSubstr(line));
  }
  EXPECT_GE(num_rows, 8);

  const std::vector<std::vector<std::string>> outputs = {
      coloured,
      LinesOnTerminal(run + " --set refine.robot_noise=auto", "env -u NO_COLOR"),
      LinesOnTerminal("study " + (folder / "study.yaml").string() + " --out " + (folder / "study").string(), "env"),
      LinesOnTerminal("compare " + (folder / "run").string() + " " + (folder / "run").string(), "env"),
  };
  for (const std::vector<std::string>& lines : outputs) {
    EXPECT_GT(lines.size(), 6U);
    for (const std::string& line : lines) {
      // Paths are not wrapped.
      if (line.rfind("results: ", 0) == 0) continue;
      EXPECT_LE(VisibleLength(line), 80U) << line;
    }
  }
}

}  // namespace
}  // namespace heba
