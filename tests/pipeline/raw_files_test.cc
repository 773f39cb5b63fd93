// Reads the files that a user has after a session without preparation: images, and poses in an undescribed format.
#include <algorithm>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kScene =
    "setup: eye_to_hand\n"
    "target: {type: chessboard, rows: 5, columns: 7, square: 20 mm}\n"
    "camera: {model: brown5, image_size: [640, 480], fx: 700, fy: 700, cx: 320, cy: 240, distortion: [0, 0, 0, 0, 0]}\n"
    "hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}\n"
    "board: {translation: [-70 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}\n"
    "motion: {captures: 10, distance: 420 mm, tilt: 35 deg, spin: 60 deg, spread: 0.3}\n"
    "image: {noise: 2 grey}\n";

// Images of one data set and its poses, in formats that the tests choose.
class RawFilesTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    root_ = new fs::path(TestFolder("raw_files"));
    WriteAll(*root_ / "scene.yaml", kScene);
    const CommandResult made =
        RunHeba({"simulate", (*root_ / "scene.yaml").string(), "--out", (*root_ / "data").string(), "--quiet"});
    ASSERT_EQ(made.status, 0) << made.err;
  }
  static void TearDownTestSuite() { delete root_; }

  void SetUp() override {
    folder_ = *root_ / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::copy(*root_ / "data", folder_, fs::copy_options::recursive);
    rows_ = ReadPoseFile(folder_ / "poses.csv", *FindPoseFormat("ros"));
  }

  // Returns the numbers of the captures' poses in a format, one line for each pose.
  std::string Lines(const std::string& format, const std::string& separator) const {
    std::string text;
    for (const PoseRow& row : rows_) {
      std::vector<std::string> fields;
      for (const double number : NumbersFromPose(*FindPoseFormat(format), row.pose))
        fields.push_back(RoundTrip(number));
      text += Join(fields, separator) + "\n";
    }
    return text;
  }

  CommandResult Heba(std::vector<std::string> arguments) const {
    return RunHeba(arguments, "HEBA_CACHE=" + (*root_ / "cache").string());
  }
  Json Run(const std::vector<std::string>& settings) const {
    std::vector<std::string> arguments = {"run",
                                          (folder_ / "config.yaml").string(),
                                          "--quiet",
                                          "--out",
                                          (folder_ / "run").string(),
                                          "--set",
                                          "evaluate.folds=0"};
    for (const std::string& setting : settings) arguments.insert(arguments.end(), {"--set", setting});
    const CommandResult run = Heba(arguments);
    EXPECT_EQ(run.status, 0) << run.err;
    return run.status == 0 ? Json::parse(ReadAll(folder_ / "run" / "result.json")) : Json();
  }
  std::string Setting(const std::string& name) const { return "captures.poses=" + (folder_ / name).string(); }

  static inline fs::path* root_ = nullptr;
  fs::path folder_;
  std::vector<PoseRow> rows_;
};

std::vector<std::string> UnusedOf(const Json& result) {
  std::vector<std::string> unused;
  for (const Json& capture : result["captures"]) {
    if (!capture["used"])
      unused.push_back(capture["image"].get<std::string>() + ": " + capture["reason"].get<std::string>());
  }
  return unused;
}

TEST_F(RawFilesTest, HeaderlessAndSeparatePoseFilesGiveTheSameResult) {
  const Json wanted = Run({})["estimates"].back()["hand_eye"];
  WriteAll(folder_ / "bare.txt", Lines("ros", "  "));
  EXPECT_EQ(
      Run({Setting("bare.txt"),
           "captures.pose_format={columns: [x, y, z, qx, qy, qz, qw], translation: m, rotation: quaternion_xyzw}"})
          ["estimates"]
              .back()["hand_eye"],
      wanted);
  fs::create_directory(folder_ / "one_each");
  const std::vector<std::string> lines = Split(Lines("ros", ", "), '\n');
  for (size_t i = 0; i < rows_.size(); ++i) {
    const std::string name = "pose_" + std::to_string(i);
    if (i % 2 == 0) WriteAll(folder_ / "one_each" / (name + ".txt"), lines[i]);
    if (i % 2 == 1) WriteAll(folder_ / "one_each" / (name + ".json"), "{\"pose\": [" + lines[i] + "]}");
  }
  EXPECT_EQ(Run({Setting("one_each")})["estimates"].back()["hand_eye"], wanted);
  // Files and images are paired by their numbers, even if one of them is missing.
  fs::remove(folder_ / "images" / "003.png");
  fs::remove(folder_ / "one_each" / "pose_4.txt");
  const Json result = Run({Setting("one_each")});
  EXPECT_THAT(UnusedOf(result), testing::UnorderedElementsAre("pose_3: the image is not among those of captures.images",
                                                              "004.png: the robot's pose is not in the poses file"));
}

TEST_F(RawFilesTest, SkipsARemovedImageWithANote) {
  fs::remove(folder_ / "images" / "007.png");
  EXPECT_THAT(UnusedOf(Run({})), testing::ElementsAre("007.png: the image is not among those of captures.images"));
  EXPECT_THAT(ReadAll(folder_ / "run" / "log.txt"), HasSubstr("without 007.png: the image is not among those"));
}

// A misspelt name is an error, and the suggestion is an image without a pose.
TEST_F(RawFilesTest, RefusesAMisspeltImageName) {
  std::string poses = ReadAll(folder_ / "poses.csv");
  poses.replace(poses.find("003.png"), 7, "03.png");
  WriteAll(folder_ / "poses.csv", poses);
  const CommandResult run = Heba({"run", (folder_ / "config.yaml").string(), "--out", (folder_ / "run").string()});
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.err,
              AllOf(HasSubstr("poses.csv:5: the image 03.png is not among"), HasSubstr("did you mean '003.png'?")));
}

TEST_F(RawFilesTest, OmitsExcludedCaptures) {
  EXPECT_THAT(UnusedOf(Run({"captures.exclude=[002.png, 005.png]"})),
              testing::ElementsAre("002.png: left out by captures.exclude", "005.png: left out by captures.exclude"));
  EXPECT_THAT(ReadAll(folder_ / "run" / "config.yaml"), HasSubstr("exclude"));
  const CommandResult wrong = Heba({"run", (folder_ / "config.yaml").string(), "--set", "captures.exclude=[02.png]"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("there is no capture '02.png'; did you mean"));
}

// The doctor states the setting of the pose format that fits the images.
TEST_F(RawFilesTest, DoctorGuessesTheFormatOfUndescribedPoses) {
  struct Case {
    std::string format;
    std::string reading;
  };
  for (const Case& given : {Case{"kuka", "translation: mm, rotation: euler_zyx, angle: deg}"},
                            {"staubli", "translation: mm, rotation: euler_xyz, angle: deg}"},
                            {"ur", "translation: m, rotation: rotation_vector, angle: rad}"},
                            {"abb", "translation: mm, rotation: quaternion_wxyz}"},
                            {"matrix", "translation: m, rotation: matrix}"}}) {
    WriteAll(folder_ / "bare.txt", Lines(given.format, " "));
    const CommandResult doctor =
        Heba({"doctor", (folder_ / "config.yaml").string(), "--quiet", "--set", Setting("bare.txt")});
    EXPECT_EQ(doctor.status, 0) << doctor.err;
    EXPECT_THAT(doctor.out,
                AllOf(HasSubstr("wrong [pose_format]"), HasSubstr("fits the images"), HasSubstr(given.reading)))
        << given.format;
    // The suggested setting removes the error.
    const size_t begin = doctor.out.find("captures.pose_format: ") + 22;
    const std::string cure = doctor.out.substr(begin, doctor.out.find('\n', begin) - begin);
    const CommandResult again = Heba({"doctor", (folder_ / "config.yaml").string(), "--quiet", "--set",
                                      Setting("bare.txt"), "--set", "captures.pose_format=" + cure});
    EXPECT_THAT(again.out, HasSubstr("nothing is wrong")) << again.err << cure;
  }
  // An error that no pose format explains is still reported.
  WriteAll(folder_ / "bare.txt", "1 2 3\n4 5 6\n7 8 9\n");
  const CommandResult hopeless =
      Heba({"doctor", (folder_ / "config.yaml").string(), "--quiet", "--set", Setting("bare.txt")});
  EXPECT_EQ(hopeless.status, 2);
  EXPECT_THAT(hopeless.err, HasSubstr("the first line must name the columns"));
}

// Captures with one file for each pose can be excluded by either name, and an image has one pose.
TEST_F(RawFilesTest, ExcludesSeparatePoseFilesAndRefusesAmbiguousOnes) {
  fs::create_directory(folder_ / "one_each");
  const std::vector<std::string> lines = Split(Lines("ros", " "), '\n');
  for (size_t i = 0; i < rows_.size(); ++i) {
    WriteAll(folder_ / "one_each" / (fs::path(rows_[i].image).stem().string() + ".txt"), lines[i]);
  }
  EXPECT_THAT(UnusedOf(Run({Setting("one_each"), "captures.exclude=[\"003\", 004.png]"})),
              testing::ElementsAre("003.png: left out by captures.exclude", "004.png: left out by captures.exclude"));
  // Two files have the same number, and the names alone do not pair them.
  for (size_t i = 0; i < rows_.size(); ++i) {
    fs::rename(folder_ / "one_each" / (fs::path(rows_[i].image).stem().string() + ".txt"),
               folder_ / "one_each" / ("p" + std::to_string(i) + ".txt"));
  }
  WriteAll(folder_ / "one_each" / "q0.txt", lines[0]);
  const CommandResult twice = Heba(
      {"run", (folder_ / "config.yaml").string(), "--set", Setting("one_each"), "--out", (folder_ / "r").string()});
  EXPECT_EQ(twice.status, 2) << twice.out;
}

// The doctor recognises rotations before positions, headers in other words, and a leading time stamp.
TEST_F(RawFilesTest, DoctorFindsOtherPoseOrders) {
  std::string turns_first;
  std::string named = "stamp;file;Rz [deg];Ry [deg];Rx [deg];X [mm];Y [mm];Z [mm]\n";
  std::string upper_rows;
  for (size_t i = 0; i < rows_.size(); ++i) {
    const std::vector<double> n = NumbersFromPose(*FindPoseFormat("kuka"), rows_[i].pose);
    const auto text = [&](const std::vector<size_t>& places, const std::string& separator) {
      std::vector<std::string> fields;
      for (const size_t place : places) fields.push_back(RoundTrip(n[place]));
      return Join(fields, separator);
    };
    turns_first += text({3, 4, 5, 0, 1, 2}, " ") + "\n";
    named += std::to_string(17 + i) + ";" + rows_[i].image + ";" + text({3, 4, 5, 0, 1, 2}, ";") + "\n";
    const Eigen::Matrix4d matrix = rows_[i].pose.Matrix();
    for (int k = 0; k < 12; ++k) upper_rows += RoundTrip(matrix(k / 4, k % 4)) + (k < 11 ? " " : "\n");
  }
  for (const auto& [name, content] : std::map<std::string, std::string>{
           {"turns.txt", turns_first}, {"named.csv", named}, {"kitti.txt", upper_rows}}) {
    WriteAll(folder_ / name, content);
    const CommandResult doctor =
        Heba({"doctor", (folder_ / "config.yaml").string(), "--quiet", "--set", Setting(name)});
    EXPECT_THAT(doctor.out, HasSubstr("fits the images")) << name << doctor.err;
    const std::string out = Unbroken(doctor.out);
    const size_t begin = out.find("captures.pose_format: ") + 22;
    const std::string cure = out.substr(begin, out.find('}', begin) + 1 - begin);
    const CommandResult again = Heba({"doctor", (folder_ / "config.yaml").string(), "--quiet", "--set", Setting(name),
                                      "--set", "captures.pose_format=" + cure});
    EXPECT_THAT(again.out, HasSubstr("nothing is wrong")) << name << again.err << cure;
  }
  // A single misspelt number is reported as such, not as another format.
  std::string poses = ReadAll(folder_ / "poses.csv");
  const size_t last = poses.find_last_of("0123456789");
  poses[last] = 'x';
  WriteAll(folder_ / "misspelt.csv", poses);
  EXPECT_THAT(Heba({"doctor", (folder_ / "config.yaml").string(), "--quiet", "--set", Setting("misspelt.csv")}).err,
              HasSubstr("misspelt.csv:11: column 'qw'"));
}

// Import writes a valid config for poses inside files with other content.
TEST_F(RawFilesTest, ImportReadsPosesWithATime) {
  const fs::path bare = folder_ / "bare";
  fs::create_directories(bare / "poses");
  fs::rename(folder_ / "images", bare / "photos");
  for (size_t i = 0; i < rows_.size(); ++i) {
    const std::vector<double> n = NumbersFromPose(*FindPoseFormat("ros"), rows_[i].pose);
    const Json pose = {{"timestamp", 17.25 + static_cast<double>(i)},
                       {"pose",
                        {{"position", {{"x", n[0]}, {"y", n[1]}, {"z", n[2]}}},
                         {"orientation", {{"x", n[3]}, {"y", n[4]}, {"z", n[5]}, {"w", n[6]}}}}}};
    WriteAll(bare / "poses" / (std::to_string(i) + ".json"), pose.dump(1));
  }
  const fs::path out = folder_ / "imported";
  const CommandResult import =
      Heba({"import", bare.string(), "--target", (folder_ / "target.yaml").string(), "--out", out.string()});
  EXPECT_EQ(import.status, 0) << import.err;
  EXPECT_THAT(Unbroken(import.out), HasSubstr("which fits the images"));
  EXPECT_EQ(Heba({"run", (out / "config.yaml").string(), "--quiet"}).status, 0);
}

// Import does not claim that poses fit images that they do not belong to.
TEST_F(RawFilesTest, ImportDoesNotPairUnrelatedPoses) {
  const fs::path bare = folder_ / "bare";
  fs::create_directory(bare);
  fs::rename(folder_ / "images", bare / "photos");
  std::string text;
  for (int i = 0; i < 10; ++i) {
    text += Join({std::to_string((37 * i) % 100), std::to_string((53 * i) % 90), std::to_string((71 * i) % 80),
                  std::to_string((29 * i) % 70), std::to_string((31 * i) % 60), std::to_string((43 * i) % 50)},
                 " ") +
            "\n";
  }
  WriteAll(bare / "robot.txt", text);
  const CommandResult import = Heba({"import", bare.string(), "--target", (folder_ / "target.yaml").string(), "--out",
                                     (folder_ / "imported").string()});
  EXPECT_EQ(import.status, 0) << import.err;
  EXPECT_THAT(Unbroken(import.out), HasSubstr("no format that was tried fits"));
  EXPECT_THAT(ReadAll(folder_ / "imported" / "config.yaml"), HasSubstr("# setup:"));
  // A table with one row for each image is preferred to one of joints; a missing target is reported.
  WriteAll(bare / "joints.csv", "j1,j2,j3,j4,j5,j6\n1,2,3,4,5,6\n1,2,3,4,5,6\n1,2,3,4,5,6\n");
  WriteAll(bare / "robot.txt", Lines("kuka", " "));
  EXPECT_THAT(Heba({"import", bare.string(), "--out", (folder_ / "imported").string()}).out, HasSubstr("robot.txt"));
  const CommandResult nowhere =
      Heba({"import", bare.string(), "--target", "no_such.yaml", "--out", (folder_ / "imported").string()});
  EXPECT_EQ(nowhere.status, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("no_such.yaml"));
}

// The results of a run do not replace its own data.
TEST_F(RawFilesTest, DoesNotReplaceDataSets) {
  fs::copy_file(*root_ / "data" / ".heba", folder_ / ".heba", fs::copy_options::overwrite_existing);
  for (const std::string command : {"run", "detect"}) {
    const CommandResult result = Heba({command, (folder_ / "config.yaml").string(), "--out", folder_.string()});
    EXPECT_EQ(result.status, 2) << command;
    EXPECT_THAT(result.err, HasSubstr("contains a data set, which")) << command;
  }
  EXPECT_TRUE(fs::exists(folder_ / "images" / "000.png"));
}

TEST_F(RawFilesTest, ImportReadsABareFolder) {
  const fs::path bare = folder_ / "bare";
  fs::create_directory(bare);
  fs::rename(folder_ / "images", bare / "photos");
  WriteAll(bare / "robot.txt", Lines("staubli", ";"));
  const fs::path out = folder_ / "imported";
  // Without a target the guess is based on the magnitudes of the numbers only.
  const CommandResult unknown = Heba({"import", bare.string(), "--out", out.string()});
  EXPECT_EQ(unknown.status, 0) << unknown.err;
  EXPECT_THAT(Unbroken(unknown.out), HasSubstr("guessed from the size of the numbers"));
  EXPECT_THAT(ReadAll(out / "config.yaml"), AllOf(HasSubstr("# setup:"), HasSubstr("# target:")));
  const CommandResult known = Heba(
      {"import", bare.string(), "--target", (folder_ / "target.yaml").string(), "--out", (folder_ / "known").string()});
  EXPECT_EQ(known.status, 0) << known.err;
  EXPECT_THAT(
      ReadAll(folder_ / "known" / "config.yaml"),
      AllOf(HasSubstr("setup: eye_to_hand"), HasSubstr("rotation: euler_xyz, angle: deg}"), Not(HasSubstr("# setup"))));
  const CommandResult run = Heba({"run", (folder_ / "known" / "config.yaml").string(), "--quiet"});
  EXPECT_EQ(run.status, 0) << run.err;
  // A folder without poses cannot be imported.
  fs::remove(bare / "robot.txt");
  const CommandResult nothing = Heba({"import", bare.string(), "--out", (folder_ / "nothing").string()});
  EXPECT_EQ(nothing.status, 2);
  EXPECT_THAT(nothing.err, HasSubstr("nor a folder of images with a table of poses"));
}

}  // namespace
}  // namespace heba
