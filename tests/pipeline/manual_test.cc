// Tests of the short flags and of the texts that the program makes from its table: manual pages and completions.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/pipeline/cli.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(ManualTest, VersionStatesTheCommit) {
  EXPECT_THAT(RunHeba({"--version"}).out, testing::MatchesRegex("heba [0-9.]+( \\([0-9a-f]+\\))?\n"));
}

TEST(ManualTest, HelpShowsShortFlagsAndTheKindsOfValues) {
  const std::string help = RunHeba({"run", "-h"}).out;
  EXPECT_THAT(help, HasSubstr("-o, --out PATH"));
  EXPECT_THAT(help, HasSubstr("-j, --jobs N"));
  EXPECT_THAT(help, HasSubstr("-q, --quiet"));
  EXPECT_THAT(help, HasSubstr("--set KEY=VALUE"));
  EXPECT_EQ(RunHeba({"help", "run"}).out, help);
}

// A flag that several commands take has the words of each in its help.
TEST(ManualTest, HelpOfACommandHasItsOwnWords) {
  for (const char* command : {"init", "run", "compare", "detect", "target", "simulate", "study", "doctor", "import",
                              "export", "locate", "correct", "cache"}) {
    EXPECT_THAT(RunHeba({command, "--help"}).out, testing::Not(testing::ContainsRegex("(init|correct|target): ")))
        << command;
  }
  EXPECT_THAT(RunHeba({"init", "--help"}).out, HasSubstr("--camera PATH         the camera file; default: found"));
  EXPECT_THAT(RunHeba({"target", "--help"}).out, HasSubstr("--camera PATH         the file of the camera that"));
  EXPECT_THAT(RunHeba({"detect", "--help"}).out, HasSubstr("default: detections/NAME beside the config"));
  EXPECT_THAT(RunHeba({"help", "man", "correct"}).out, HasSubstr("the poses are those to reach"));
  EXPECT_THAT(RunHeba({"export", "--help"}).out, testing::Not(HasSubstr("to reach")));
}

TEST(ManualTest, ShortFlagsAreLongOnes) {
  const TempFolder folder;
  WriteAll(folder / "target.yaml", "{type: chessboard, rows: 6, columns: 7, square: 20 mm}\n");
  const std::string target = (folder / "target.yaml").string();
  for (const std::vector<std::string>& flag :
       std::vector<std::vector<std::string>>{{"-o", (folder / "a.svg").string()},
                                             {"-o" + (folder / "b.svg").string()},
                                             {"-o=" + (folder / "c.svg").string()}}) {
    std::vector<std::string> words = {"target", target};
    words.insert(words.end(), flag.begin(), flag.end());
    EXPECT_EQ(RunHeba(words).status, 0) << flag.front();
  }
  for (const char* name : {"a.svg", "b.svg", "c.svg"}) EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
  EXPECT_THAT(RunHeba({"target", target, "-q"}).err, HasSubstr("has no flag"));
  EXPECT_THAT(RunHeba({"run", target, "-qx"}).err, HasSubstr("-q takes no value, not 'x'"));
  EXPECT_THAT(RunHeba({"run", target, "-jx"}).err, HasSubstr("--jobs needs a whole number, not 'x'"));
}

TEST(ManualTest, EveryCommandHasAManualPage) {
  EXPECT_THAT(RunHeba({"help", "man"}).out, StartsWith(".TH HEBA 1"));
  const std::string page = RunHeba({"help", "man", "locate"}).out;
  EXPECT_THAT(page, StartsWith(".TH HEBA\\-LOCATE 1"));
  EXPECT_THAT(page, HasSubstr("\\-\\-pixels U,V;U,V"));
  const CommandResult wrong = RunHeba({"help", "man", "locat"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean 'locate'"));
}

TEST(ManualTest, HelpDescribesKeys) {
  EXPECT_THAT(RunHeba({"help"}).out, HasSubstr("the keys of a run config"));
  EXPECT_THAT(RunHeba({"help", "config", "evaluate.folds"}).out, HasSubstr("folds: whole number (default: 5)"));
  EXPECT_THAT(RunHeba({"help", "poses"}).out, HasSubstr("- kuka: columns x, y, z, a, b, c; mm and deg; euler_zyx"));
  EXPECT_THAT(RunHeba({"help", "study"}).out,
              testing::AllOf(StartsWith("usage: heba study"), HasSubstr("outlier_points: list of numbers")));
  const CommandResult wrong = RunHeba({"help", "confg"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean 'config'"));
}

TEST(ManualTest, CompletionsNameCommandsAndFlags) {
  for (const char* shell : {"bash", "zsh"}) {
    const std::string completion = RunHeba({"help", shell}).out;
    EXPECT_THAT(completion, HasSubstr("locate")) << shell;
    EXPECT_THAT(completion, HasSubstr("--fail-on")) << shell;
  }
}

}  // namespace
}  // namespace heba
