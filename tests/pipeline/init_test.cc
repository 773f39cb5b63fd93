// `heba init`: from a folder as it is after recording to a config that runs.
#include <algorithm>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kTarget = "{type: chessboard, rows: 6, columns: 7, square: 25 mm}";

class InitTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = TestFolder(testing::UnitTest::GetInstance()->current_test_info()->name());
    WriteAll(folder_ / "scene.yaml",
             std::string("setup: eye_in_hand\ntarget: ") + kTarget +
                 "\ncamera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}\n"
                 "hand_eye: {translation: [60 mm, 0 mm, 40 mm], rpy: [0 deg, 5 deg, 90 deg]}\n"
                 "board: {translation: [500 mm, 0 mm, 0 mm], rpy: [180 deg, 0 deg, 0 deg]}\n"
                 "motion: {captures: 10, distance: 400 mm}\nimage: {noise: 1 grey}\npose_format: kuka\n");
    ASSERT_EQ(RunHeba({"simulate", (folder_ / "scene.yaml").string(), "--out", (folder_ / "data").string(), "--quiet"})
                  .status,
              0);
    fs::create_directory(folder_ / "cell");
    fs::copy(folder_ / "data/images", folder_ / "cell/images");
    fs::copy(folder_ / "data/poses.csv", folder_ / "cell/robot_log.csv");
  }
  CommandResult Init(const std::vector<std::string>& flags) const {
    std::vector<std::string> words = {"init", (folder_ / "cell").string()};
    words.insert(words.end(), flags.begin(), flags.end());
    return RunHeba(words);
  }
  std::string Config(const std::string& name) const { return (folder_ / "cell" / name).string(); }
  fs::path folder_;
};

TEST_F(InitTest, WritesAConfigThatRuns) {
  const CommandResult made = Init({"--target", kTarget});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(Unbroken(made.out), HasSubstr("which fits the images; eye_in_hand: robot and images differ by"));
  const std::string config = ReadAll(folder_ / "cell/config.yaml");
  EXPECT_THAT(config, AllOf(HasSubstr("\nsetup: eye_in_hand\n"), HasSubstr("  pose_format: kuka\n"),
                            HasSubstr("\ntarget: \"target.yaml\"\n"), HasSubstr("  # target_shape: auto\n")));
  const CommandResult run = RunHeba({"run", (folder_ / "cell/config.yaml").string(), "--quiet"});
  EXPECT_EQ(run.status, 0) << run.err;
  // Nothing is replaced but what the command itself wrote, and that if it is asked to.
  const CommandResult again = Init({"--target", kTarget});
  EXPECT_EQ(again.status, 2);
  EXPECT_THAT(again.err, HasSubstr("config.yaml: exists already"));
  EXPECT_EQ(ReadAll(folder_ / "cell/config.yaml"), config);
  EXPECT_EQ(Init({"--target", kTarget, "--force"}).status, 0);
  WriteAll(folder_ / "cell/config.yaml", "setup: eye_in_hand\n");
  const CommandResult forced = Init({"--target", kTarget, "--force"});
  EXPECT_EQ(forced.status, 2);
  EXPECT_THAT(forced.err, HasSubstr("--force replaces only what 'heba init' wrote"));
}

TEST_F(InitTest, WritesBothFilesOrNone) {
  // An image that cannot be read ends the trials after the target was written.
  std::vector<fs::path> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "cell/images"))
    images.push_back(entry.path());
  WriteAll(*std::min_element(images.begin(), images.end()), "");
  const CommandResult made = Init({"--target", kTarget});
  EXPECT_EQ(made.status, 2);
  EXPECT_FALSE(fs::exists(folder_ / "cell/target.yaml"));
  EXPECT_FALSE(fs::exists(folder_ / "cell/config.yaml"));
  // A fault of the camera is reported before anything is written.
  WriteAll(folder_ / "bad.yaml", "{model: pinhole, image_size: [640, 480], fx: -600, fy: 600, cx: 320, cy: 240}\n");
  const CommandResult camera = Init({"--target", kTarget, "--camera", (folder_ / "bad.yaml").string()});
  EXPECT_EQ(camera.status, 2);
  EXPECT_FALSE(fs::exists(folder_ / "cell/target.yaml"));
}

TEST_F(InitTest, SaysWhatIsMissing) {
  EXPECT_THAT(Unbroken(Init({}).err), HasSubstr("contains no target file; the images show --target '{type: chessboard, "
                                                "rows: 6, columns: 7, square: SIZE}'"));
  EXPECT_THAT(Init({"--target", "{type: chessbord}"}).err, HasSubstr("did you mean 'chessboard'?"));
  EXPECT_THAT(Init({"--target", kTarget, "--setup", "eye_in_hnd"}).err, HasSubstr("did you mean 'eye_in_hand'?"));
  EXPECT_THAT(Init({"--target", kTarget, "--images", "absent"}).err, HasSubstr("--images: absent: no such"));
  fs::remove(folder_ / "cell/robot_log.csv");
  EXPECT_THAT(Init({"--target", kTarget}).err, HasSubstr("contains no robot poses; name their file (--poses)"));
  fs::remove_all(folder_ / "cell/images");
  EXPECT_THAT(Init({"--target", kTarget}).err, HasSubstr("contains no images; name their folder (--images)"));
  EXPECT_TRUE(fs::is_empty(folder_ / "cell"));
}

using InitNightly = InitTest;

// A target that the images contradict is not said to fit, and its correction is named.
TEST_F(InitNightly, NamesTheCorrectionOfAWrongTarget) {
  const CommandResult other = Init({"--target", "{type: chessboard, rows: 5, columns: 9, square: 25 mm}"});
  EXPECT_EQ(other.status, 0) << other.err;
  EXPECT_THAT(Unbroken(other.out), AllOf(HasSubstr("warning: the images show another target than the config names: "),
                                         HasSubstr("set in the target: rows: 6, columns: 7\n"),
                                         HasSubstr("fits the images if the target is"), HasSubstr("next: heba doctor "),
                                         Not(HasSubstr("heba run"))));
  EXPECT_THAT(ReadAll(folder_ / "cell/config.yaml"), HasSubstr("\n# Warning: the images show another target"));
  const CommandResult scaled =
      Init({"--target", "{type: chessboard, rows: 6, columns: 7, square: 20 mm}", "--out", Config("scaled.yaml")});
  EXPECT_EQ(scaled.status, 0) << scaled.err;
  EXPECT_THAT(Unbroken(scaled.out), AllOf(HasSubstr("warning: the target is 1.2"), HasSubstr("next: heba doctor ")));
}

// Nothing is written if no reading fits, and one line says why.
TEST_F(InitTest, FailsIfNoReadingFits) {
  const CommandResult other_setup =
      Init({"--target", kTarget, "--setup", "eye_to_hand", "--out", Config("fixed.yaml")});
  EXPECT_EQ(other_setup.status, 1) << other_setup.err;
  EXPECT_THAT(Unbroken(other_setup.err),
              AllOf(HasSubstr("heba: error: "), HasSubstr("the poses are the inverse of what the config says")));
  EXPECT_EQ(other_setup.out, "");
  EXPECT_FALSE(fs::exists(folder_ / "cell/fixed.yaml"));
  EXPECT_FALSE(fs::exists(folder_ / "cell/target.yaml"));
}

// The target that the images show takes the place of one of another type.
TEST_F(InitTest, NamesWhatTheImagesShow) {
  const CommandResult other = Init({"--target", "{type: circle_grid, rows: 4, columns: 9, spacing: 25 mm}"});
  EXPECT_THAT(Unbroken(other.out + other.err), HasSubstr("type: chessboard, rows: 6, columns: 7"));
}

TEST_F(InitTest, ReadsDecimalCommas) {
  std::string poses = ReadAll(folder_ / "cell/robot_log.csv");
  std::replace(poses.begin(), poses.end(), ',', ';');
  // The names of the images keep their points.
  for (size_t at = 0; (at = poses.find('.', at)) != std::string::npos; ++at) {
    if (poses.compare(at, 4, ".png") != 0) poses[at] = ',';
  }
  WriteAll(folder_ / "cell/robot_log.csv", poses);
  const CommandResult made = Init({"--target", kTarget});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_EQ(RunHeba({"run", (folder_ / "cell/config.yaml").string(), "--quiet"}).status, 0);
}

TEST_F(InitTest, NamesTheUsersFilesInFaults) {
  // There is no column for the images.
  std::string poses = "x,y,z,a,b,c\n";
  for (int i = 0; i < 4; ++i) poses += "100,200,300," + std::to_string(i) + "0,20,30\n";
  WriteAll(folder_ / "cell/robot_log.csv", poses);
  const CommandResult made = Init({"--target", kTarget});
  EXPECT_EQ(made.status, 1);
  EXPECT_THAT(Unbroken(made.err),
              AllOf(HasSubstr("the data set cannot be read: " + (folder_ / "cell/robot_log.csv").string() +
                              ": has 4 rows without an image column for 10 images"),
                    Not(HasSubstr("heba_trial"))));
}

// The images decide between several files with poses, and the others are named.
TEST_F(InitTest, TriesAllPosesThatItFinds) {
  std::string shifted = ReadAll(folder_ / "cell/robot_log.csv");
  for (size_t at = 0; (at = shifted.find("\n00", at)) != std::string::npos; ++at) {
    shifted[at + 3] = shifted[at + 3] == '9' ? '0' : static_cast<char>(shifted[at + 3] + 1);
  }
  WriteAll(folder_ / "cell/a.csv", shifted);
  const CommandResult made = Init({"--target", kTarget});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(ReadAll(folder_ / "cell/config.yaml"), HasSubstr("  poses: \"robot_log.csv\"\n"));
  EXPECT_THAT(Unbroken(made.out), HasSubstr("other poses were found and not taken: "));
}

TEST_F(InitTest, ATargetBesideAnotherIsNamedAfterItsConfig) {
  WriteAll(folder_ / "cell/target.yaml", "{type: chessboard, rows: 4, columns: 9, square: 25 mm}\n");
  const CommandResult made = Init({"--target", kTarget, "--out", Config("c4.yaml")});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("c4.target.yaml\n"));
  EXPECT_THAT(ReadAll(folder_ / "cell/c4.yaml"), HasSubstr("\ntarget: \"c4.target.yaml\"\n"));
  EXPECT_EQ(ReadAll(folder_ / "cell/c4.target.yaml"), std::string(kTarget) + "\n");
  // A file with the same content is used again.
  fs::remove(folder_ / "cell/c4.yaml");
  EXPECT_EQ(Init({"--target", kTarget, "--out", Config("c4.yaml")}).status, 0);
}

TEST_F(InitTest, CountsImagesWithoutAPose) {
  const std::string poses = ReadAll(folder_ / "cell/robot_log.csv");
  WriteAll(folder_ / "cell/robot_log.csv", poses.substr(0, poses.find("\n008.png") + 1));
  const CommandResult made = Init({"--target", kTarget});
  EXPECT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(Unbroken(made.out), HasSubstr("remark: 2 of 10 images have no robot pose (008.png, 009.png)"));
  const CommandResult doctor = RunHeba({"doctor", (folder_ / "cell/config.yaml").string(), "--quiet"});
  EXPECT_THAT(Unbroken(doctor.out), HasSubstr("remark [unpaired]: 2 of 10 images have no robot pose"));
}

// On a terminal, what is missing is asked for, again if the answer is wrong.
TEST_F(InitTest, AsksOnATerminal) {
  WriteAll(folder_ / "answers", "chessbord\n3\n6\n7\n25\n3\n6\n7\n25 mm\n2\n");
  const std::string command = "script -qec " +
                              ShellQuoted(std::string(HEBA_PROGRAM) + " init " + (folder_ / "cell").string()) +
                              " /dev/null < " + ShellQuoted((folder_ / "answers").string()) + " > " +
                              ShellQuoted((folder_ / "screen").string());
  EXPECT_EQ(std::system(command.c_str()), 0);
  const std::string screen = ReadAll(folder_ / "screen");
  EXPECT_THAT(screen, AllOf(HasSubstr("did you mean 'chessboard'?"), HasSubstr("'25' has no unit"),
                            HasSubstr("Is the camera fixed (1, eye_to_hand)"), HasSubstr("next: heba run")));
  EXPECT_EQ(ReadAll(folder_ / "cell/target.yaml"), "type: chessboard\nrows: 6\ncolumns: 7\nsquare: 25 mm\n");
  EXPECT_THAT(ReadAll(folder_ / "cell/config.yaml"),
              AllOf(HasSubstr("\nsetup: eye_in_hand\n"), Not(HasSubstr("the inverse"))));
}

}  // namespace
}  // namespace heba
