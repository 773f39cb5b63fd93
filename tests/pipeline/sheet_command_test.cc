// `heba target`: sheets on paper, and proposed targets.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/target.h"
#include "tests/pipeline/cli.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

constexpr char kCamera[] =
    "{model: brown5, image_size: [1280, 960], fx: 1402.5, fy: 1403.1, cx: 648.2, cy: 473.9, "
    "distortion: [-0.11, 0.09, 0.0004, -0.0006, 0.0]}\n";

class SheetCommandTest : public testing::Test {
 protected:
  SheetCommandTest() {
    WriteAll(folder_ / "camera.yaml", kCamera);
    WriteAll(folder_ / "small.yaml", "{type: chessboard, rows: 6, columns: 9, square: 15 mm}\n");
    WriteAll(folder_ / "large.yaml", "{type: chessboard, rows: 6, columns: 9, square: 28 mm}\n");
  }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  TempFolder folder_;
};

TEST_F(SheetCommandTest, PaperThatFitsGivesOnePageWithoutAWarning) {
  for (const char* suffix : {"svg", "pdf", "png"}) {
    const std::string sheet = Path(std::string("sheet.") + suffix);
    const CommandResult result =
        RunHeba({"target", Path("small.yaml"), "--paper", "a4", "--dpi", "60", "--out", sheet});
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_THAT(result.err, IsEmpty());
    EXPECT_THAT(result.out, HasSubstr("297 x 210 mm, 54 points"));
    EXPECT_TRUE(std::filesystem::exists(sheet));
  }
}

// The keys of the target may be on the command line, as for `heba init`.
TEST_F(SheetCommandTest, KeysTakeThePlaceOfAFile) {
  const CommandResult keys =
      RunHeba({"target", "{type: chessboard, rows: 6, columns: 9, square: 15 mm}", "--out", Path("keys.svg")});
  EXPECT_EQ(keys.status, 0) << keys.err;
  ASSERT_EQ(RunHeba({"target", Path("small.yaml"), "--out", Path("file.svg")}).status, 0);
  EXPECT_EQ(ReadAll(Path("keys.svg")), ReadAll(Path("file.svg")));
  const CommandResult wrong = RunHeba({"target", "{type: chessbord}", "--out", Path("wrong.svg")});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean 'chessboard'?"));
}

TEST_F(SheetCommandTest, SheetLargerThanThePaperWarnsAndNamesALargerOne) {
  const CommandResult result = RunHeba({"target", Path("large.yaml"), "--paper", "a4", "--out", Path("sheet.pdf")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("2 pages of"));
  EXPECT_THAT(result.err, AllOf(StartsWith("heba: warning: "), HasSubstr("does not fit on a4 (210 x 297 mm)"),
                                HasSubstr("spread over 2 pages"), HasSubstr("it fits on a3")));
  EXPECT_THAT(ReadAll(Path("sheet.pdf")), HasSubstr("/Title (chessboard 9 x 6, 28 mm)"));
}

TEST_F(SheetCommandTest, LargerSheetsThanThePaperAreNoPng) {
  const CommandResult result = RunHeba({"target", Path("large.yaml"), "--paper", "a4", "--out", Path("sheet.png")});
  EXPECT_EQ(result.status, 2);
  EXPECT_THAT(result.err, HasSubstr("use a larger paper, or .pdf"));
  EXPECT_FALSE(std::filesystem::exists(Path("sheet.png")));
}

// YAML may be written as JSON: the description of the sheet has the name of such a target's file.
TEST_F(SheetCommandTest, OtherFilesAreNotReplaced) {
  constexpr char kTarget[] = R"({"type": "chessboard", "rows": 6, "columns": 9, "square": "15 mm"})";
  constexpr char kOther[] = R"({"serial": 7})";
  WriteAll(folder_ / "target.json", kTarget);
  WriteAll(folder_ / "target.pdf", kTarget);
  WriteAll(folder_ / "other.json", kOther);
  struct Call {
    std::string target;
    std::string sheet;
    std::string part;
  };
  const Call calls[] = {{"target.json", "target.pdf", "target.json would replace the file of the target"},
                        {"target.pdf", "target.pdf", "target.pdf would replace the file of the target"},
                        {"small.yaml", "other.pdf", "other.json would be replaced, which does not describe a sheet"}};
  for (const Call& call : calls) {
    const CommandResult result = RunHeba({"target", Path(call.target), "--out", Path(call.sheet)});
    EXPECT_EQ(result.status, 2);
    EXPECT_THAT(result.err, AllOf(HasSubstr(call.part), HasSubstr("choose another name")));
  }
  EXPECT_EQ(ReadAll(Path("target.json")), kTarget);
  EXPECT_EQ(ReadAll(Path("target.pdf")), kTarget);
  EXPECT_EQ(ReadAll(Path("other.json")), kOther);
  EXPECT_FALSE(std::filesystem::exists(Path("other.pdf")));
  // The description of a sheet is replaced together with the sheet.
  for (const char* target : {"large.yaml", "small.yaml"}) {
    EXPECT_EQ(RunHeba({"target", Path(target), "--out", Path("sheet.pdf")}).status, 0);
  }
}

// The image of an A0 sheet takes 700 MB.
TEST_F(SheetCommandTest, RunningOutOfMemoryFails) {
  if (HEBA_SANITIZE) GTEST_SKIP() << "a sanitizer needs more address space than the limit";
  const CommandResult result =
      RunHeba({"target", Path("large.yaml"), "--paper", "a0", "--dpi", "690", "--out", Path("sheet.png")},
              "ulimit -v 700000; HEBA_CACHE=");
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(result.err, "heba: error: out of memory\n");
  EXPECT_FALSE(std::filesystem::exists(Path("sheet.png")));
}

TEST_F(SheetCommandTest, SuggestionIsATargetWhoseSheetFitsOnThePaper) {
  const std::vector<std::string> call = {"target",     "--suggest", "--paper",  "letter",
                                         "--distance", "0.6 m",     "--camera", Path("camera.yaml")};
  const CommandResult printed = RunHeba(call);
  ASSERT_EQ(printed.status, 0) << printed.err;
  EXPECT_THAT(printed.out, StartsWith("# Proposed by heba target --suggest --paper letter"));
  EXPECT_EQ(ParseTarget(printed.out)->type(), "coded_board");
  std::vector<std::string> to_file = call;
  to_file.insert(to_file.end(), {"--target-type", "charuco", "--out", Path("charuco.yaml")});
  const CommandResult written = RunHeba(to_file);
  ASSERT_EQ(written.status, 0) << written.err;
  EXPECT_EQ(ParseTarget(ReadAll(Path("charuco.yaml")))->type(), "charuco");
  const CommandResult sheet =
      RunHeba({"target", Path("charuco.yaml"), "--paper", "letter", "--out", Path("charuco.pdf")});
  EXPECT_EQ(sheet.status, 0);
  EXPECT_THAT(sheet.err, IsEmpty());
}

TEST_F(SheetCommandTest, SuggestionThatIsNotPossibleFails) {
  const CommandResult result =
      RunHeba({"target", "--suggest", "--paper", "a5", "--distance", "9 m", "--camera", Path("camera.yaml")});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.err, AllOf(StartsWith("heba: error: no coded_board on a5 suits this camera at 9.00 m"),
                                HasSubstr("use a larger paper, a shorter distance or another --target-type")));
  EXPECT_THAT(result.out, IsEmpty());
}

TEST_F(SheetCommandTest, WrongFlagsAreNamed) {
  const std::string camera = Path("camera.yaml");
  const std::string small = Path("small.yaml");
  struct Call {
    std::vector<std::string> arguments;
    std::string part;
  };
  const Call calls[] = {
      {{"target"}, "TARGET.yaml is missing: heba target TARGET.yaml; --suggest"},
      {{"target", small, small}, "takes [TARGET.yaml], not 2 arguments"},
      {{"target", small, "--out", Path("a.pdf"), "--paper", "a44"}, "did you mean 'a4'?"},
      {{"target", small, "--out", Path("a.pdf"), "--camera", camera}, "--camera belongs to --suggest"},
      {{"target", small, "--out", Path("a.pdf"), "--distance", "1 m"}, "--distance belongs to --suggest"},
      {{"target", small, "--out", Path("a.pdf"), "--target-type", "coded_board"}, "--target-type belongs to --suggest"},
      {{"target", small, "--suggest"}, "takes no"},
      {{"target", "--suggest", "--paper", "a4", "--camera", camera}, "--distance is missing"},
      {{"target", "--suggest", "--paper", "a4", "--camera", camera, "--distance", "0.6"}, "--distance: '0.6'"},
      {{"target", "--suggest", "--paper", "a4", "--camera", camera, "--distance", "0 m"}, "from 10 mm to 100 m"},
      {{"target", "--suggest", "--paper", "a4", "--camera", Path("none.yaml"), "--distance", "1 m"}, "no such file"},
      {{"target", "--suggest", "--paper", "a4", "--camera", camera, "--distance", "1 m", "--target-type", "chesboard"},
       "did you mean 'chessboard'?"},
      {{"target", "--suggest", "--paper", "a4", "--camera", camera, "--distance", "1 mm", "--target-type", "none"},
       "not 'none'; the distance must be from 10 mm to 100 m"},
      {{"target", "--suggest", "--paper", "a4", "--camera", camera, "--distance", "1 m", "--out", Path("a.pdf")},
       "is written as .yaml"},
  };
  for (const Call& call : calls) {
    const CommandResult result = RunHeba(call.arguments);
    EXPECT_EQ(result.status, 2) << call.part << ": " << result.err;
    EXPECT_THAT(result.err, AllOf(StartsWith("heba: error: "), HasSubstr(call.part)));
  }
  EXPECT_FALSE(std::filesystem::exists(Path("a.pdf")));
}

}  // namespace
}  // namespace heba
