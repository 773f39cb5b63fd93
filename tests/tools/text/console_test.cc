#include "tools/text/console.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::Not;

// Returns the text that `action` writes to standard error, which is no terminal meanwhile.
template <class Action>
std::string ErrorOutputOf(const Action& action) {
  testing::internal::CaptureStderr();
  action();
  return testing::internal::GetCapturedStderr();
}

TEST(ConsoleTest, PrintsNotesAndKeepsThemForTheLog) {
  Console console(Verbosity::kNormal);
  EXPECT_EQ(ErrorOutputOf([&] {
              console.Note("first");
              console.Note("second");
            }),
            "first\nsecond\n");
  EXPECT_EQ(console.log(), "first\nsecond\n");
}

TEST(ConsoleTest, KeepsNotesThatItDoesNotPrint) {
  Console console(Verbosity::kQuiet);
  EXPECT_EQ(ErrorOutputOf([&] { console.Note("first"); }), "");
  EXPECT_EQ(console.log(), "first\n");
}

// Names of files may contain anything. The log is a file, so it keeps the text unchanged.
TEST(ConsoleTest, PrintsControlCharactersAsQuestionMarks) {
  Console console(Verbosity::kNormal);
  EXPECT_EQ(ErrorOutputOf([&] { console.Note("a\x1b[2Jb\tc\x7f"); }), "a?[2Jb?c?\n");
  EXPECT_EQ(console.log(), "a\x1b[2Jb\tc\x7f\n");
}

TEST(ConsoleTest, BreaksLongLinesOfTheOutput) {
  Console console(Verbosity::kNormal);
  std::string line;
  for (int i = 0; i < 100; ++i) line += "word ";
  const std::string printed = ErrorOutputOf([&] { console.Note(line); });
  EXPECT_THAT(printed, HasSubstr("word\n  word"));
  EXPECT_THAT(console.log(), Not(HasSubstr("word\n  word")));
}

TEST(ForTerminalTest, BreaksLinesAt160CharactersIfThereIsNoTerminal) {
  testing::internal::CaptureStdout();
  const std::string fits = ForTerminal(std::string(155, 'a') + " bcde");
  const std::string broken = ForTerminal(std::string(155, 'a') + " bcdef");
  testing::internal::GetCapturedStdout();
  EXPECT_EQ(fits, std::string(155, 'a') + " bcde");
  EXPECT_EQ(broken, std::string(155, 'a') + "\n  bcdef");
}

TEST(ForTerminalTest, KeepsOnlyTheSequencesForBoldAndPlain) {
  testing::internal::CaptureStdout();
  const std::string text = ForTerminal("\x1b[1mbold\x1b[0m \x1b[31mred\nline");
  testing::internal::GetCapturedStdout();
  EXPECT_EQ(text, "\x1b[1mbold\x1b[0m ?[31mred\nline");
}

TEST(UseColourTest, IsFalseIfStandardOutputIsNoTerminal) {
  testing::internal::CaptureStdout();
  const bool use_colour = UseColour();
  testing::internal::GetCapturedStdout();
  EXPECT_FALSE(use_colour);
}

TEST(PrintErrorTest, IsOneLineWithTheProgramsName) {
  EXPECT_EQ(ErrorOutputOf([] { PrintError("cell.yaml:3: name:\nis missing"); }),
            "heba: error: cell.yaml:3: name: is missing\n");
}

TEST(ProgressBarTest, ShowsTheShareOfTheSteps) {
  EXPECT_EQ(ProgressBar("detect", 0, 3), "detect [" + std::string(30, '.') + "] 0/3");
  EXPECT_EQ(ProgressBar("detect", 1, 3), "detect [" + std::string(10, '#') + std::string(20, '.') + "] 1/3");
  EXPECT_EQ(ProgressBar("detect", 3, 3), "detect [" + std::string(30, '#') + "] 3/3");
}

// A study may have more trials than an int can count.
TEST(ProgressBarTest, CountsBillionsOfSteps) {
  EXPECT_EQ(ProgressBar("trial", 4'000'000'000, 6'000'000'000),
            "trial [" + std::string(20, '#') + std::string(10, '.') + "] 4000000000/6000000000");
}

TEST(ProgressTest, PrintsALineForEachQuarterIfThereIsNoTerminal) {
  EXPECT_EQ(ErrorOutputOf([] {
              Progress progress("detect", 10, Verbosity::kNormal);
              for (int i = 0; i < 10; ++i) progress.Step();
            }),
            "detect 3/10\ndetect 5/10\ndetect 8/10\ndetect 10/10\n");
}

TEST(ProgressTest, FewStepsArePrintedOneByOne) {
  EXPECT_EQ(ErrorOutputOf([] {
              Progress progress("detect", 2, Verbosity::kNormal);
              progress.Step();
              progress.Step();
            }),
            "detect 1/2\ndetect 2/2\n");
}

TEST(ProgressTest, PrintsNothingIfQuietOrIfThereIsNothingToDo) {
  EXPECT_EQ(ErrorOutputOf([] {
              Progress quiet("detect", 2, Verbosity::kQuiet);
              quiet.Step();
              Progress empty("detect", 0, Verbosity::kNormal);
            }),
            "");
}

}  // namespace
}  // namespace heba
