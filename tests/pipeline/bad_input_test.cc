// Bad input gives one line that names the file, the error and the remedy, and exit status 2 (1 if the work failed).
// No output is written.
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr const char* kScene = R"(
setup: eye_to_hand
target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}
camera: {model: pinhole, image_size: [640, 480], fx: 700, fy: 700, cx: 319.5, cy: 239.5, distortion: []}
hand_eye: {translation: [800 mm, 0 mm, 500 mm], rpy: [-120 deg, 0 deg, 60 deg]}
board: {translation: [0 mm, 0 mm, 100 mm], rpy: [0 deg, 5 deg, 10 deg]}
motion: {captures: 6, distance: 400 mm, tilt: 30 deg, spread: 0.3}
image: {noise: 1 grey}
)";

// A change that spoils the data set in a folder.
using Spoil = std::function<void(const fs::path& folder)>;

Spoil Remove(const std::string& path) {
  return [=](const fs::path& folder) { ASSERT_GT(fs::remove_all(folder / path), 0U) << path; };
}

Spoil Write(const std::string& file, const std::string& text) {
  return [=](const fs::path& folder) { WriteAll(folder / file, text); };
}

// Replaces the first occurrence of `from`, which must exist.
Spoil Replace(const std::string& file, const std::string& from, const std::string& to) {
  return [=](const fs::path& folder) {
    std::string text = ReadAll(folder / file);
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from << " is not in " << file << ":\n" << text;
    WriteAll(folder / file, text.replace(at, from.size(), to));
  };
}

// Replaces the first line that contains `key`.
void ReplaceLine(const fs::path& file, const std::string& key, const std::string& line) {
  std::string text = ReadAll(file);
  const size_t at = text.find(key);
  ASSERT_NE(at, std::string::npos) << key << " is not in " << text;
  const size_t begin = text.rfind('\n', at) + 1;
  size_t end = text.find('\n', at);
  WriteAll(file, text.replace(begin, end - begin, line));
}

// Returns ten lists, each ten times as long as the one before.
std::string AliasBomb() {
  std::string text = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    std::string items = before;
    for (int k = 1; k < 10; ++k) items += ", " + before;
    text += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + items + "]\n";
  }
  return text;
}

// Returns a PNG whose header claims 100,000 x 100,000 pixels, with its end.
std::string HugePng() {
  const std::string size = std::string("\x00\x01\x86\xa0", 4);
  return std::string("\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR", 16) + size + size +
         std::string("\x08\x00\x00\x00\x00", 5) + "abcd" + std::string("\x00\x00\x00\x00IEND\xae\x42\x60\x82", 12);
}

// Returns a TIFF that claims the same size.
std::string HugeTiff() {
  return std::string("II*\0\x08\0\0\0\x02\0", 10) + std::string("\0\x01\x04\0\x01\0\0\0\xa0\x86\x01\0", 12) +
         std::string("\x01\x01\x04\0\x01\0\0\0\xa0\x86\x01\0", 12) + std::string(4, '\0');
}

// Sets field `column` of data row `row` (row 0 follows the header).
Spoil SetPose(int row, int column, const std::string& value) {
  return [=](const fs::path& folder) {
    std::istringstream lines(ReadAll(folder / "poses.csv"));
    std::string text;
    std::string line;
    for (int i = -1; std::getline(lines, line); ++i) {
      if (i == row) {
        std::istringstream fields(line);
        std::string field;
        std::string changed;
        for (int c = 0; std::getline(fields, field, ','); ++c) {
          changed += (c > 0 ? "," : "") + (c == column ? value : field);
        }
        line = changed;
      }
      text += line + "\n";
    }
    WriteAll(folder / "poses.csv", text);
  };
}

// A good data set, rendered once; each case spoils a copy of it.
class BadInputTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    root_ = new fs::path(TestFolder("bad_input"));
    WriteAll(*root_ / "scene.yaml", kScene);
    std::string long_scene = kScene;
    WriteAll(*root_ / "long_scene.yaml", long_scene.replace(long_scene.find("captures: 6"), 11, "captures: 5000"));
    const CommandResult result =
        RunHeba({"simulate", (*root_ / "scene.yaml").string(), "--out", (*root_ / "good").string(), "--quiet"});
    ASSERT_EQ(result.status, 0) << result.err;
  }
  static void TearDownTestSuite() {
    fs::remove_all(*root_);
    delete root_;
  }

  void SetUp() override {
    folder_ = *root_ / "case";
    fs::remove_all(folder_);
    fs::copy(*root_ / "good", folder_, fs::copy_options::recursive);
  }

  // Runs the config and checks that the error is one line that contains all `parts`.
  void ExpectError(int status, const std::vector<std::string>& parts) {
    const fs::path out = *root_ / "out";
    fs::remove_all(out);
    const CommandResult result = RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"});
    EXPECT_EQ(result.status, status) << result.err;
    EXPECT_THAT(result.err, testing::StartsWith("heba: error: "));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    for (const std::string& part : parts) EXPECT_THAT(result.err, testing::HasSubstr(part));
    EXPECT_EQ(result.out, "");
    EXPECT_FALSE(fs::exists(out)) << "a failed run left a folder";
    // No partial output is left next to the folder either.
    for (const fs::directory_entry& entry : fs::directory_iterator(*root_)) {
      EXPECT_THAT(entry.path().filename().string(), testing::Not(testing::HasSubstr(".part")));
    }
  }

  static fs::path* root_;
  fs::path folder_;
};
fs::path* BadInputTest::root_ = nullptr;

TEST_F(BadInputTest, GoodDataSetRuns) {
  const fs::path out = *root_ / "good_run";
  const CommandResult result = RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(fs::exists(out / "result.json"));
}

// One error in an input file, which gives exit status 2.
struct BadInput {
  std::string name;
  Spoil spoil;
  std::vector<std::string> parts;  // Parts of the message.
};

std::vector<BadInput> BadInputs() {
  return {
      {"MissingConfig", Remove("config.yaml"), {"config.yaml", "no such file"}},
      {"MissingPosesFile", Remove("poses.csv"), {"poses.csv", "no such file"}},
      {"MissingTargetFile", Remove("target.yaml"), {"target.yaml", "no such file"}},
      {"MissingCameraFile", Remove("camera.yaml"), {"camera.yaml", "no such file"}},
      {"MissingImagesFolder", Remove("images"), {"config.yaml:", "captures.images", "no folder"}},
      {"EmptyImage", Write("images/002.png", ""), {"002.png", "is empty"}},
      {"DicomNamedPng",
       Write("images/002.png", std::string(128, '\0') + "DICM" + std::string(60, '\2')),
       {"002.png", "is a DICOM image, which heba does not read; convert it to PNG"}},
      {"WebpNamedPng", Write("images/002.png", "RIFF\x24\x01\x01\x01WEBPVP8 "), {"002.png", "is a WebP image"}},
      {"TiffThatClaimsToBeHuge", Write("images/002.png", HugeTiff()), {"002.png", "400 million pixels"}},
      {"NotAnImage", Write("images/002.png", "this is no image"), {"002.png", "not an image", "PNG, JPEG"}},
      {"PoseRowWithAMissingNumber", SetPose(2, 3, ""), {"poses.csv:4", "z"}},
      {"PoseRowWithTooFewFields", Replace("poses.csv", "003.png,", "003.png\n#"), {"poses.csv:5"}},
      {"PoseRowWithText", SetPose(1, 2, "abc"), {"poses.csv:3", "abc"}},
      {"PoseRowWithNan", SetPose(1, 2, "nan"), {"poses.csv:3", "finite"}},
      {"PoseRowWithInfinity", SetPose(1, 2, "inf"), {"poses.csv:3", "finite"}},
      {"QuaternionThatIsNotNearUnitLength", SetPose(3, 7, "3.5"), {"poses.csv:5", "quaternion"}},
      {"PoseOfAnImageThatIsNotThere", SetPose(0, 0, "00O.png"), {"poses.csv:2", "00O.png", "did you mean '000.png'?"}},
      {"DuplicateRows", SetPose(4, 0, "003.png"), {"poses.csv:6", "003.png"}},
      {"JointsWithoutARobot",
       Replace("config.yaml", "pose_format: ros", "pose_format: joints"),
       {"config.yaml:", "robot"}},
      {"UnknownRobot",
       Replace("config.yaml", "pose_format: ros", "pose_format: joints\n  robot: ur55"),
       {"config.yaml:", "robot", "did you mean 'ur5'?"}},
      {"PosesThatAreNoJoints",
       Replace("config.yaml", "pose_format: ros", "pose_format: joints\n  robot: ur5"),
       {"poses.csv:1", "ros"}},
      {"UnknownPoseColumn", Replace("poses.csv", "qw", "qv"), {"poses.csv:1", "qv", "qw"}},
      {"CountsThatDisagreeWithoutImageColumn",
       Write("poses.csv", "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,0,0,0,0,0,1\n"),
       {"poses.csv", "2 rows", "6 images"}},
      {"TextInUtf16", Write("config.yaml", std::string("s\0e\0t\0u\0p\0:\0", 12)), {"config.yaml", "UTF-8"}},
      {"NameOfTwoLines", Replace("config.yaml", "setup:", "name: \"a\\nb\"\nsetup:"), {"name", "cannot name a folder"}},
      {"NameThatIsTooLong",
       Replace("config.yaml", "setup:", "name: " + std::string(255, 'n') + "\nsetup:"),
       {"name", "cannot name a folder"}},
      {"IntrinsicsThatStandTwice",
       Replace("config.yaml", "setup:", "refine: {intrinsics: [focal, focal]}\nsetup:"),
       {"intrinsics", "twice"}},
      {"LengthsBeyondTheWorld",
       Replace("config.yaml", "setup:", "refine: {robot_noise: {rotation: 0.1 deg, translation: 1e300 m}}\nsetup:"),
       {"translation", "out of range"}},
      {"NoiseThatNoRobotHas",
       Replace("config.yaml", "setup:", "refine: {robot_noise: {rotation: 90 deg, translation: 1 mm}}\nsetup:"),
       {"rotation", "at most 10 deg"}},
      {"UnknownKey",
       Replace("config.yaml", "setup:", "setpu: x\nsetup:"),
       {"config.yaml:1", "setpu", "did you mean 'setup'?"}},
      {"UnknownNestedKey",
       Replace("config.yaml", "  poses:", "  poeses: x\n  poses:"),
       {"config.yaml:", "poeses", "did you mean 'poses'?"}},
      {"MissingUnit", Replace("target.yaml", "square: 20 mm", "square: 0.02"), {"target.yaml:", "square", "no unit"}},
      {"WrongUnit", Replace("target.yaml", "square: 20 mm", "square: 2 deg"), {"target.yaml:", "square", "deg", "mm"}},
      {"NegativeLength",
       Replace("target.yaml", "square: 20 mm", "square: -0.02 m"),
       {"target.yaml:", "square", "greater than zero"}},
      {"UnknownTarget",
       Replace("target.yaml", "chessboard", "chesboard"),
       {"target.yaml:1", "chesboard", "did you mean 'chessboard'?"}},
      {"UnknownSetup", Replace("config.yaml", "eye_to_hand", "eye_on_hand"), {"config.yaml:1", "setup", "eye_on_hand"}},
      {"UnknownPoseFormat",
       Replace("config.yaml", "pose_format: ros", "pose_format: rso"),
       {"config.yaml:", "pose_format", "rso", "did you mean 'ros'?"}},
      {"UnknownSeed",
       Replace("config.yaml", "setup:", "seed: parc\nsetup:"),
       {"config.yaml:1", "seed", "did you mean 'park'?"}},
      {"UnknownMethod", Replace("config.yaml", "setup:", "methods: [park, shach]\nsetup:"), {"config.yaml:1", "shach"}},
      {"UnknownCameraModel",
       Replace("config.yaml", "model: pinhole", "model: pinhoel"),
       {"config.yaml:", "pinhoel", "did you mean 'pinhole'?"}},
      {"YamlSyntax", Replace("config.yaml", "setup:", "setup: [\nsetup:"), {"config.yaml:", "YAML"}},
      {"DuplicateKey",
       Replace("config.yaml", "setup:", "setup: eye_to_hand\nsetup:"),
       {"config.yaml:2", "setup", "twice"}},
      {"ImageSizeThatDisagreesWithTheCameraFile",
       Replace("camera.yaml", "480", "960"),
       {"camera.yaml", "640 x 960", "640 x 480"}},
      {"TruthBetweenOtherFrames", Replace("truth.json", "\"base\"", "\"gripper\""), {"truth.json", "hand_eye", "base"}},
      {"BrokenTruth", Write("truth.json", "{\"hand_eye\": "), {"truth.json", "JSON"}},
      {"OneFold",
       Replace("config.yaml", "evaluate:", "evaluate:\n  folds: 1"),
       {"config.yaml:", "folds", "0 for none"}},
      {"NegativeFolds", Replace("config.yaml", "evaluate:", "evaluate:\n  folds: -3"), {"config.yaml:", "folds"}},
      {"FoldsInWords",
       Replace("config.yaml", "evaluate:", "evaluate:\n  folds: five"),
       {"folds", "whole number", "five"}},
      // Errors in configs.
      {"EmptyConfig", Write("config.yaml", ""), {"config.yaml", "mapping"}},
      {"ConfigThatIsAList", Write("config.yaml", "- a\n- b\n"), {"config.yaml:1", "mapping"}},
      {"ConfigThatIsNoText", Write("config.yaml", std::string("\x00\xff\xfe\x01", 4)), {"config.yaml"}},
      {"HugeConfig", Write("config.yaml", "a: " + std::string(3 << 20, 'x')), {"config.yaml", "MiB"}},
      {"AliasBomb", Write("config.yaml", AliasBomb()), {"config.yaml", "values"}},
      {"DeepConfig", Write("config.yaml", std::string(100000, '[')), {"config.yaml"}},
      {"ConfigThatIsItsOwnBase",
       Replace("config.yaml", "setup:", "base: config.yaml\nsetup:"),
       {"config.yaml", "base"}},
      {"NameThatIsAPath",
       Replace("config.yaml", "setup:", "name: ../../etc\nsetup:"),
       {"config.yaml:1", "cannot name a folder"}},
      {"KeyWithANewline", Replace("config.yaml", "setup:", "\"a\\nb\": 1\nsetup:"), {"config.yaml:1", "unknown"}},
      // Errors in poses.
      {"PosesWithoutAHeader", Write("poses.csv", "000.png,0,0,0,0,0,0,1\n"), {"poses.csv:1", "name the columns"}},
      {"PosesWithoutRows", Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n"), {"poses.csv", "no captures"}},
      {"EmptyPoses", Write("poses.csv", ""), {"poses.csv", "is empty"}},
      {"PosesThatAreNoText", Write("poses.csv", std::string("x,y\0z", 5)), {"poses.csv", "UTF-8"}},
      {"PosesWithAnOpenQuote", SetPose(1, 0, "\"001.png"), {"poses.csv:3", "quote is not closed"}},
      {"PosesWithADecimalComma", SetPose(1, 1, "0,25"), {"poses.csv:3", "9 fields"}},
      {"PoseThatIsFartherThanAnyRobot", SetPose(1, 1, "1e12"), {"poses.csv:3", "larger than any robot's"}},
      {"PosesWithAColumnTwice", Replace("poses.csv", "qx,qy", "qx,qx"), {"poses.csv:1", "qx", "twice"}},
      {"PosesWithoutAColumn", Replace("poses.csv", "qx,qy", "role,qy"), {"poses.csv:1", "qx", "missing"}},
      {"UnknownRole",
       [](const fs::path& folder) {
         std::string text = ReadAll(folder / "poses.csv");
         text.insert(text.find('\n'), ",role");
         for (size_t at = text.find(".png"); at != std::string::npos; at = text.find(".png", at + 1)) {
           text.insert(text.find('\n', at), ",hoem");
         }
         WriteAll(folder / "poses.csv", text);
       },
       {"poses.csv:2", "hoem", "did you mean 'home'?"}},
      {"UnknownDirectionOfPoses",
       Replace("config.yaml", "pose_format: ros", "pose_format: ros\n  poses_are: gripper_in_base"),
       {"poses_are", "gripper_in_base", "base_from_gripper"}},
      {"UnitsThatTheFormatHasAlready",
       Replace("config.yaml", "pose_format: ros", "pose_format: ros\n  units: mm"),
       {"units", "always in m"}},
      {"UrdfThatIsNotThere",
       Replace("config.yaml", "pose_format: ros", "pose_format: joints\n  robot: no.urdf"),
       {"no.urdf", "no such file"}},
      {"UrdfThatIsNone",
       Replace("config.yaml", "pose_format: ros", "pose_format: joints\n  robot: poses.csv.urdf"),
       {"poses.csv.urdf"}},
      // Errors in images.
      {"ImageThatClaimsToBeHuge", Write("images/002.png", HugePng()), {"002.png", "400 million pixels"}},
      {"GlobThatMatchesNothing",
       [](const fs::path& folder) { ReplaceLine(folder / "config.yaml", "images:", "  images: \"images/*.tiff\""); },
       {"captures.images", "no file matches"}},
      {"ListWithAImageThatIsNotThere",
       [](const fs::path& folder) {
         ReplaceLine(folder / "config.yaml", "images:", "  images: [images/000.png, no.png]");
       },
       {"captures.images", "no.png"}},
      {"EmptyListOfImages",
       [](const fs::path& folder) { ReplaceLine(folder / "config.yaml", "images:", "  images: []"); },
       {"captures.images", "empty"}},
      {"ImagesFromTwoPlaces", Replace("config.yaml", "  poses:", "  data: x\n  poses:"), {"captures.data", "'images'"}},
      // Errors in data of other projects and in given detections.
      {"DataOfNoKnownForm",
       [](const fs::path& folder) { ReplaceLine(folder / "config.yaml", "images:", "  data: config.yaml"); },
       {"config.yaml", "not a data set in a known format"}},
      {"DataOfAFormThatIsNone",
       [](const fs::path& folder) { ReplaceLine(folder / "config.yaml", "images:", "  data: .\n  format: vips"); },
       {"format", "did you mean 'visp'?"}},
      {"DetectionsThatAreNoJson",
       [](const fs::path& folder) { ReplaceLine(folder / "config.yaml", "images:", "  detections: poses.csv"); },
       {"poses.csv", "JSON"}},
      {"DetectionsOfAPointThatTheTargetHasNot",
       [](const fs::path& folder) {
         WriteAll(folder / "d.json",
                  "{\"captures\": [{\"image\": \"000.png\", \"image_size\": [640, 480], \"ids\": [99], "
                  "\"pixels\": [[1, 2]]}]}");
         WriteAll(folder / "poses.csv", "image,x,y,z,qx,qy,qz,qw\n000.png,0,0,0,0,0,0,1\n");
         ReplaceLine(folder / "config.yaml", "images:", "  detections: d.json");
       },
       {"d.json", "000.png", "no point 99"}},
      {"DetectionsWithANumberTooLarge",
       [](const fs::path& folder) {
         WriteAll(folder / "d.json", "{\"captures\": [{\"image\": \"0\", \"image_size\": [1e999, 480]}]}");
         ReplaceLine(folder / "config.yaml", "images:", "  detections: d.json");
       },
       {"d.json", "too large"}},
      // Errors in cameras.
      {"CameraOfNoKnownForm", Write("camera.yaml", "lens: good\n"), {"camera.yaml", "no camera"}},
      {"CameraWithANegativeFocalLength",
       Replace("camera.yaml", "fx: ", "fx: -"),
       {"camera.yaml:1", "fx and fy must be positive"}},
      {"CameraThatIsNoNumber", Replace("camera.yaml", "fx: 700", "fx: .nan"), {"camera.yaml", "fx"}},
      {"CameraOfAnUnknownModel",
       Replace("camera.yaml", "pinhole", "pinhoole"),
       {"camera.yaml", "did you mean 'pinhole'?"}},
      {"CameraInXml", Write("camera.yaml", "<?xml version=\"1.0\"?>\n<opencv_storage/>\n"), {"camera.yaml", "XML"}},
      {"CameraThatIsAFolder",
       [](const fs::path& folder) {
         fs::remove(folder / "camera.yaml");
         fs::create_directory(folder / "camera.yaml");
       },
       {"camera.yaml", "folder"}},
      // Errors in targets.
      {"TargetWithoutAType", Write("target.yaml", "rows: 5\ncolumns: 8\nsquare: 20 mm\n"), {"target.yaml", "type"}},
      {"TargetWithoutRows", Replace("target.yaml", "rows: 5", "rows: 0"), {"target.yaml:", "rows"}},
      {"TargetWithTooManyRows", Replace("target.yaml", "rows: 5", "rows: 2000000000"), {"target.yaml:", "rows"}},
      {"TargetWithTooFewMarkers",
       Write("target.yaml",
             "type: charuco\nrows: 20\ncolumns: 20\nsquare: 20 mm\nmarker: 15 mm\ndictionary: DICT_4X4_50\n"),
       {"target.yaml:", "dictionary", "200"}},
      // Errors in settings of the refinement.
      {"UnknownLoss",
       Replace("config.yaml", "evaluate:", "refine: {loss: hubber}\nevaluate:"),
       {"loss", "did you mean 'huber'?"}},
      {"UnknownIntrinsics",
       Replace("config.yaml", "evaluate:", "refine: {intrinsics: [focus]}\nevaluate:"),
       {"intrinsics", "focus", "focal"}},
      {"PixelNoiseOfZero",
       Replace("config.yaml", "evaluate:", "refine: {pixel_noise: 0 px}\nevaluate:"),
       {"pixel_noise", "greater than zero"}},
      {"NegativeRobotNoise",
       Replace("config.yaml", "evaluate:", "refine: {robot_noise: {rotation: -1 deg, translation: 1 mm}}\nevaluate:"),
       {"rotation", "negative"}},
      {"RobotNoiseWithoutAUnit",
       Replace("config.yaml", "evaluate:", "refine: {robot_noise: {rotation: 1, translation: 1 mm}}\nevaluate:"),
       {"rotation", "no unit"}},
  };
}

class BadInputTableTest : public BadInputTest, public testing::WithParamInterface<BadInput> {};

TEST_P(BadInputTableTest, IsNamed) {
  GetParam().spoil(folder_);
  ExpectError(2, GetParam().parts);
}

INSTANTIATE_TEST_SUITE_P(All, BadInputTableTest, testing::ValuesIn(BadInputs()),
                         [](const auto& test) { return test.param.name; });

// A file of another kind is named as what it is, and a folder by the file in it.
TEST_F(BadInputTest, NamesTheKindOfAnotherFile) {
  const auto error_of = [](const std::vector<std::string>& words) {
    const CommandResult result = RunHeba(words);
    EXPECT_EQ(result.status, 2) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    return result.err;
  };
  const std::string scene = (*root_ / "scene.yaml").string();
  const std::string config = (folder_ / "config.yaml").string();
  const std::string target = (folder_ / "target.yaml").string();
  EXPECT_EQ(error_of({"run", scene}), "heba: error: " + scene + ": this is a scene; use 'heba simulate'\n");
  EXPECT_THAT(error_of({"doctor", target}), testing::HasSubstr(target + ": this is a target, which a run config "));
  EXPECT_EQ(error_of({"simulate", config, "--out", (*root_ / "out").string()}),
            "heba: error: " + config + ": this is a run config; use 'heba run'\n");
  EXPECT_THAT(error_of({"study", config}), testing::HasSubstr("this is a run config; use 'heba run'"));
  EXPECT_THAT(error_of({"target", config, "--out", (*root_ / "x.svg").string()}),
              testing::HasSubstr("this is a run config; use 'heba run'"));
  EXPECT_EQ(error_of({"run", folder_.string()}),
            "heba: error: " + folder_.string() + ": this is a folder; did you mean " + config + "?\n");
  EXPECT_THAT(error_of({"run", (folder_ / "images").string()}),
              testing::HasSubstr("a file is needed, which 'heba init"));
  // A run may be named by its result, too.
  ASSERT_EQ(RunHeba({"run", config, "--out", (folder_ / "run").string(), "--quiet"}).status, 0);
  const CommandResult by_file = RunHeba({"export", (folder_ / "run/result.json").string(), "--to", "ros"});
  EXPECT_EQ(by_file.status, 0) << by_file.err;
  EXPECT_EQ(by_file.out, RunHeba({"export", (folder_ / "run").string(), "--to", "ros"}).out);
}

TEST_F(BadInputTest, ReportsAnEmptyImagesFolder) {
  fs::remove_all(folder_ / "images");
  fs::create_directory(folder_ / "images");
  ExpectError(2, {"captures.images", "no images"});
}
TEST_F(BadInputTest, ReportsATruncatedPng) {
  const std::string bytes = ReadAll(folder_ / "images" / "002.png");
  WriteAll(folder_ / "images" / "002.png", bytes.substr(0, bytes.size() / 2));
  ExpectError(2, {"002.png", "is truncated"});
}
TEST_F(BadInputTest, ReportsImagesOfDifferentSizes) {
  const fs::path scene = *root_ / "other_scene.yaml";
  std::string text = kScene;
  text.replace(text.find("[640, 480]"), 10, "[644, 484]");
  WriteAll(scene, text);
  ASSERT_EQ(RunHeba({"simulate", scene.string(), "--out", (*root_ / "other").string(), "--quiet"}).status, 0);
  fs::copy_file(*root_ / "other" / "images" / "003.png", folder_ / "images" / "003.png",
                fs::copy_options::overwrite_existing);
  ExpectError(2, {"003.png", "644 x 484", "640 x 480"});
}

TEST_F(BadInputTest, ReportsATargetThatIsNeverSeen) {
  WriteAll(folder_ / "target.yaml",
           "type: charuco\nrows: 5\ncolumns: 7\nsquare: 20 mm\nmarker: 15 mm\ndictionary: DICT_4X4_50\n");
  ExpectError(1, {"config.yaml", "detected in 0 of 2 images", "with type: chessboard, rows: 5, columns: 8"});
}
TEST_F(BadInputTest, ReportsTooFewCaptures) {
  std::istringstream lines(ReadAll(folder_ / "poses.csv"));
  std::string text;
  std::string line;
  for (int i = 0; i < 3 && std::getline(lines, line); ++i) text += line + "\n";
  WriteAll(folder_ / "poses.csv", text);
  ExpectError(1, {"config.yaml", "at least 3 captures"});
}
TEST_F(BadInputTest, ReportsARobotThatDidNotMove) {
  std::istringstream lines(ReadAll(folder_ / "poses.csv"));
  std::string line;
  std::getline(lines, line);
  std::string text = line + "\n";
  while (std::getline(lines, line)) text += line.substr(0, 7) + ",0,0,0,0,0,0,1\n";
  WriteAll(folder_ / "poses.csv", text);
  ExpectError(1, {"config.yaml", "the images show rotations of", "one and the same rotation"});
}
TEST_F(BadInputTest, ReportsRotationsAboutASingleAxis) {
  std::istringstream lines(ReadAll(folder_ / "poses.csv"));
  std::string line;
  std::getline(lines, line);
  std::string text = line + "\n";
  for (int i = 0; std::getline(lines, line); ++i) {
    const double half = 0.1 * i;
    text += line.substr(0, 7) + ",0,0,0,0,0," + std::to_string(std::sin(half)) + "," + std::to_string(std::cos(half)) +
            "\n";
  }
  WriteAll(folder_ / "poses.csv", text);
  ExpectError(1, {"config.yaml", "one axis only", "second axis"});
}

TEST_F(BadInputTest, KeepsAnOutputFolderWithOtherFiles) {
  const fs::path out = *root_ / "precious";
  fs::create_directory(out);
  WriteAll(out / "thesis.txt", "ten years of work");
  const CommandResult result = RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"});
  EXPECT_EQ(result.status, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("was not created by heba"));
  EXPECT_EQ(ReadAll(out / "thesis.txt"), "ten years of work");
}
TEST_F(BadInputTest, FailedRunKeepsThePreviousResult) {
  const fs::path out = *root_ / "former";
  ASSERT_EQ(RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"}).status, 0);
  const std::string before = ReadAll(out / "result.json");
  SetPose(3, 7, "3.5")(folder_);
  EXPECT_EQ(RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"}).status, 2);
  EXPECT_EQ(ReadAll(out / "result.json"), before);
}

// Names contain characters that are special in shells, YAML, CSV and HTML.
TEST_F(BadInputTest, AcceptsUnusualFileNames) {
  const fs::path odd = *root_ / "a 'b' \"c\" \xc3\xa4\xe6\x9c\xba; $(touch x) <i>&amp;";
  fs::create_directories(odd.parent_path());
  fs::copy(folder_, odd, fs::copy_options::recursive);
  const std::string name = "o'dd \"1\", \xc3\xb6#;.png";
  fs::rename(odd / "images" / "000.png", odd / "images" / name);
  std::string text = ReadAll(odd / "poses.csv");
  text.replace(text.find("000.png"), 7, "\"o'dd \"\"1\"\", \xc3\xb6#;.png\"");
  WriteAll(odd / "poses.csv", text);
  const fs::path out = odd / "re\nsults";
  const CommandResult result = RunHeba({"run", (odd / "config.yaml").string(), "--out", out.string(), "--quiet"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(ReadAll(out / "result.json"), testing::HasSubstr("o'dd \\\"1\\\", \xc3\xb6#;.png"));
  EXPECT_FALSE(fs::exists("x"));
  fs::remove_all(odd);
}

// Reading from a pipe without a writer would block.
TEST_F(BadInputTest, RefusesPipesAsInputs) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  const std::string pipe = (folder_ / "pipe").string();
  for (const char* key :
       {"captures.poses", "target", "camera.intrinsics", "evaluate.truth", "captures.detections", "base"}) {
    const CommandResult result = RunHeba({"run", (folder_ / "config.yaml").string(), "--set",
                                          std::string(key) + "=" + pipe, "--out", (*root_ / "piped").string()},
                                         "HEBA_CACHE= timeout 20");
    EXPECT_EQ(result.status, 2) << key << ": " << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << key << ": " << result.err;
  }
  fs::remove(folder_ / "images/002.png");
  ASSERT_EQ(mkfifo((folder_ / "images/002.png").c_str(), 0600), 0);
  ExpectError(2, {"002.png"});
}

// Fill bytes before a JPEG marker are not part of it; the frame that follows claims 65535 x 65535 pixels.
TEST_F(BadInputTest, FillBytesDoNotHideAHugeJpeg) {
  const std::string frame = std::string("\xff\xff\xff\xff\xff\xc0\x00\x0b\x08\xff\xff\xff\xff\x01\x01\x11\x00", 17);
  WriteAll(folder_ / "images/003.png", std::string("\xff\xd8", 2) + frame + "\xff\xd9");
  ExpectError(2, {"003.png", "400 million pixels"});
}

// The header is read before the image is decoded: this one states another size, and its pixel data is invalid.
TEST_F(BadInputTest, DoesNotDecodeAnImageOfAnotherSize) {
  std::string other = ReadAll(folder_ / "images/003.png");
  other[18] = 0x4e;  // The width becomes 20,000.
  other[19] = 0x20;
  WriteAll(folder_ / "images/003.png", other);
  ExpectError(2, {"003.png: is 20", "all images must come from one camera at one resolution"});
}

// libpng writes its own warnings to standard error, here about a checksum that does not matter.
TEST_F(BadInputTest, LibrariesDoNotWriteToStandardError) {
  std::string image = ReadAll(folder_ / "images/003.png");
  constexpr size_t kBehindHeader = 33;
  image.insert(kBehindHeader, std::string("\x00\x00\x00\x04gAMA\x00\x00\xb1\x8f....", 16));
  WriteAll(folder_ / "images/003.png", image);
  const CommandResult result =
      RunHeba({"detect", (folder_ / "config.yaml").string(), "--out", (*root_ / "warned").string(), "--quiet"});
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.err, "");
}

TEST_F(BadInputTest, EnvironmentIsChecked) {
  const std::string config = (folder_ / "config.yaml").string();
  for (const std::string setting : {"HEBA_SIMD=nonsense", "HEBA_CACHE_MB=much", "HEBA_CACHE_MB=-1"}) {
    const CommandResult result =
        RunHeba({"detect", config, "--out", (*root_ / "environment").string(), "--quiet"}, setting);
    EXPECT_EQ(result.status, 2) << setting;
    EXPECT_THAT(result.err, testing::StartsWith("heba: error: " + setting.substr(0, setting.find('=')))) << setting;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
}

// Cached detections can be listed, their size is limited, and clearing the cache removes nothing else.
TEST_F(BadInputTest, CacheIsLimitedAndCanBeCleared) {
  const fs::path cache = *root_ / "kept";
  const std::string environment = "HEBA_CACHE=" + ShellQuoted(cache.string());
  const auto detect = [&](const std::string& limit) {
    const CommandResult result =
        RunHeba({"detect", (folder_ / "config.yaml").string(), "--out", (*root_ / "cached").string(), "--quiet"},
                environment + limit);
    EXPECT_EQ(result.status, 0) << result.err;
  };
  const auto shown = [&] { return RunHeba({"cache", "show"}, environment).out; };
  detect("");
  EXPECT_THAT(shown(), testing::HasSubstr(": 6 detections, "));
  WriteAll(cache / "detections" / "notes.txt", "mine");
  WriteAll(cache / "mine.detection", "mine");
  const CommandResult cleared = RunHeba({"cache", "clear"}, environment);
  EXPECT_EQ(cleared.status, 0) << cleared.err;
  EXPECT_THAT(cleared.out, testing::HasSubstr("removed 6 detections"));
  EXPECT_THAT(shown(), testing::HasSubstr(": 0 detections, "));
  EXPECT_TRUE(fs::exists(cache / "detections" / "notes.txt"));
  EXPECT_TRUE(fs::exists(cache / "mine.detection"));
  detect(" HEBA_CACHE_MB=0");
  EXPECT_THAT(shown(), testing::HasSubstr(": 0 detections, "));
  EXPECT_EQ(RunHeba({"cache", "burn"}, environment).status, 2);
  EXPECT_THAT(RunHeba({"cache", "show"}, "HEBA_CACHE=").out, testing::HasSubstr("no detections are kept"));
}

// Control characters in a file name do not reach the terminal.
TEST_F(BadInputTest, EscapesControlCharactersInNames) {
  const std::string hostile = "003\x1b[2Jx.png";
  fs::rename(folder_ / "images/003.png", folder_ / "images" / hostile);
  std::string poses = ReadAll(folder_ / "poses.csv");
  poses.replace(poses.find("003.png"), 7, hostile);
  WriteAll(folder_ / "poses.csv", poses);
  const CommandResult result =
      RunHeba({"detect", (folder_ / "config.yaml").string(), "--out", (*root_ / "hostile").string()});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, testing::HasSubstr("003?[2Jx.png: "));
  EXPECT_EQ((result.out + result.err).find('\x1b'), std::string::npos);
}

// The values of a file are counted before it is parsed, because parsing too many would take gigabytes.
TEST_F(BadInputTest, DoesNotParseFilesWithTooManyValues) {
  std::string json = "{\"captures\": [";
  for (int i = 0; i < 21'000'000; ++i) json += "0,";
  WriteAll(folder_ / "detections.json", json + "0]}");
  const CommandResult result =
      RunHeba({"run", (folder_ / "config.yaml").string(), "--set", "captures.images=", "--set",
               "captures.detections=" + (folder_ / "detections.json").string(), "--out", (*root_ / "many").string()});
  EXPECT_EQ(result.status, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("contains more than 20 million values"));
}

// Numbers in notations that gflags does not accept, and more threads than any machine has.
TEST_F(BadInputTest, ChecksTheNumberOfThreads) {
  const std::string config = (folder_ / "config.yaml").string();
  for (const auto& [jobs, status] : std::map<std::string, int>{{"1e3", 0}, {"1.0", 0}, {"1e9", 2}, {"1.5", 2}}) {
    const CommandResult result =
        RunHeba({"detect", config, "--jobs", jobs, "--out", (*root_ / jobs).string(), "--quiet"});
    EXPECT_EQ(result.status, status) << jobs << ": " << result.err;
  }
}

TEST_F(BadInputTest, FailsIfStandardOutputIsFull) {
  const fs::path out = *root_ / "full_output";
  ASSERT_EQ(RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"}).status, 0);
  const std::string program = ShellQuoted(HEBA_PROGRAM);
  for (const std::string& command :
       {"export " + ShellQuoted(out.string()) + " --to ros1", std::string("help"), std::string("--version")}) {
    const int raw = std::system((program + " " + command + " > /dev/full 2> /dev/null").c_str());
    EXPECT_EQ(WEXITSTATUS(raw), 1) << command;
  }
}

TEST_F(BadInputTest, OnlyRegularFilesAreReplaced) {
  const fs::path out = *root_ / "exported_run";
  ASSERT_EQ(RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out.string(), "--quiet"}).status, 0);
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  WriteAll(folder_ / "notes.txt", "mine");
  fs::create_symlink("notes.txt", folder_ / "link");
  for (const fs::path& path : {folder_ / "pipe", folder_ / "link", fs::path("/dev/null")}) {
    const CommandResult result = RunHeba({"export", out.string(), "--to", "ros1", "--out", path.string()});
    EXPECT_EQ(result.status, 2) << path;
    EXPECT_THAT(result.err, testing::HasSubstr("is not a regular file")) << path;
  }
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(ReadAll(folder_ / "notes.txt"), "mine");
  const CommandResult itself =
      RunHeba({"export", out.string(), "--to", "ros1", "--parent", "tool0", "--child", "tool0"});
  EXPECT_EQ(itself.status, 2);
  EXPECT_THAT(itself.err, testing::HasSubstr("a frame has no pose in itself"));
  // The run's own detections are the input, one of them moved outside of the image.
  const std::string detections = ReadAll(out / "detections.json");
  WriteAll(folder_ / "detections.json", detections);
  const auto run = [&] {
    return RunHeba({"run", (folder_ / "config.yaml").string(), "--set",
                    "captures.detections=" + (folder_ / "detections.json").string(), "--set", "captures.images=null",
                    "--out", (*root_ / "from_detections").string(), "--quiet"});
  };
  std::string outside = detections;
  const size_t pixels = outside.find("\"pixels\":[[") + 11;
  outside.replace(pixels, outside.find(',', pixels) - pixels, "99999");
  WriteAll(folder_ / "detections.json", outside);
  EXPECT_THAT(run().err, testing::HasSubstr("lies outside of the image"));
}

// A second import or simulation keeps runs and notes, and refuses to replace a config that was edited.
TEST_F(BadInputTest, KeepsFilesOfTheUser) {
  const fs::path data = *root_ / "kept_data";
  const std::vector<std::string> simulate = {"simulate", (*root_ / "scene.yaml").string(), "--out", data.string(),
                                             "--quiet"};
  ASSERT_EQ(RunHeba(simulate).status, 0);
  ASSERT_EQ(RunHeba({"run", (data / "config.yaml").string(), "--quiet"}).status, 0);
  WriteAll(data / "runs/config/notes.txt", "mine");
  ASSERT_EQ(RunHeba(simulate).status, 0);
  EXPECT_TRUE(fs::exists(data / "runs/config/result.json"));
  ASSERT_EQ(RunHeba({"run", (data / "config.yaml").string(), "--quiet"}).status, 0);
  EXPECT_EQ(ReadAll(data / "runs/config/notes.txt"), "mine");
  WriteAll(data / "config.yaml", ReadAll(data / "config.yaml") + "# mine\n");
  const CommandResult refused = RunHeba(simulate);
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, testing::HasSubstr("config.yaml: was changed since heba wrote it"));
  EXPECT_THAT(ReadAll(data / "config.yaml"), testing::HasSubstr("# mine"));
}

// Ctrl-C and the termination by a batch system give one line and leave no partial output.
TEST_F(BadInputTest, InterruptionLeavesNoFiles) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const fs::path place = *root_ / "interrupted";
    fs::remove_all(place);
    fs::create_directories(place);
    const std::string err = (*root_ / "interrupted.err").string();
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      if (std::freopen(err.c_str(), "w", stderr) == nullptr) _exit(127);
      setenv("HEBA_CACHE", "", 1);
      const std::string scene = (*root_ / "long_scene.yaml").string();
      execl(HEBA_PROGRAM, HEBA_PROGRAM, "simulate", scene.c_str(), "--out", (place / "a").c_str(), "--quiet", nullptr);
      _exit(127);
    }
    // Waits until the program has begun to write.
    for (int i = 0; i < 2000 && fs::is_empty(place); ++i) usleep(1000);
    EXPECT_FALSE(fs::is_empty(place));
    kill(child, signal);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 128 + signal);
    EXPECT_EQ(ReadAll(err), "heba: error: interrupted\n");
    EXPECT_TRUE(fs::is_empty(place));
  }
}

TEST_F(BadInputTest, ReportsUnwritableOutputInOneLine) {
  for (const std::string& out :
       {std::string("/proc/heba_results"), (folder_ / "poses.csv").string(), (folder_ / "poses.csv" / "below").string(),
        (folder_ / std::string(300, 'x')).string()}) {
    const CommandResult result = RunHeba({"run", (folder_ / "config.yaml").string(), "--out", out, "--quiet"});
    EXPECT_EQ(result.status, 2) << out;
    EXPECT_THAT(result.err, testing::StartsWith("heba: error: ")) << out;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
}

// Inputs may be read-only, so nothing is written next to them. (Root may write anywhere; the modification times show
// it.)
TEST_F(BadInputTest, WritesNothingBesideTheInputs) {
  std::map<std::string, fs::file_time_type> before;
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) before[entry.path()] = entry.last_write_time();
  EXPECT_EQ(
      RunHeba({"run", (folder_ / "config.yaml").string(), "--out", (*root_ / "elsewhere").string(), "--quiet"}).status,
      0);
  EXPECT_EQ(RunHeba({"doctor", (folder_ / "config.yaml").string(), "--quiet"}).status, 0);
  std::map<std::string, fs::file_time_type> after;
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) after[entry.path()] = entry.last_write_time();
  EXPECT_EQ(before, after);
}

// The disk is full: a small tmpfs in a mount namespace of the test.
TEST_F(BadInputTest, ReportsAFullDiskInOneLineAndLeavesNoFiles) {
  const fs::path disk = *root_ / "disk";
  fs::create_directories(disk);
  const std::string mount = "mount -t tmpfs -o size=64k tmpfs " + ShellQuoted(disk.string());
  if (std::system(("unshare -Urm sh -c " + ShellQuoted(mount) + " 2> /dev/null").c_str()) != 0) {
    GTEST_SKIP() << "no tmpfs can be mounted here";
  }
  const std::string err = (*root_ / "disk.err").string();
  const std::string inside = mount + " && HEBA_CACHE= " + ShellQuoted(HEBA_PROGRAM) + " run " +
                             ShellQuoted((folder_ / "config.yaml").string()) + " --quiet --out " +
                             ShellQuoted((disk / "run").string()) + " 2> " + ShellQuoted(err) + "; echo $? > " +
                             ShellQuoted(err + ".status") + "; ls -A " + ShellQuoted(disk.string()) + " > " +
                             ShellQuoted(err + ".left");
  ASSERT_EQ(std::system(("unshare -Urm sh -c " + ShellQuoted(inside)).c_str()), 0);
  const std::string said = ReadAll(err);
  EXPECT_THAT(said, testing::StartsWith("heba: error: "));
  EXPECT_THAT(said, testing::HasSubstr("No space left"));
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  EXPECT_EQ(ReadAll(err + ".status"), "1\n");
  EXPECT_EQ(ReadAll(err + ".left"), "");
}

// An empty folder hides /proc, as in a chroot: neither the digest of the program nor unnamed files are possible.
TEST_F(BadInputTest, RunsWithoutProc) {
  const std::string hide = "mount -t tmpfs tmpfs /proc";
  if (std::system(("unshare -Urm sh -c " + ShellQuoted(hide) + " 2> /dev/null").c_str()) != 0) {
    GTEST_SKIP() << "/proc cannot be hidden here";
  }
  const fs::path out = *root_ / "without_proc";
  const std::string err = (*root_ / "without_proc.err").string();
  const std::string inside = hide + " && HEBA_CACHE= " + ShellQuoted(HEBA_PROGRAM) + " run " +
                             ShellQuoted((folder_ / "config.yaml").string()) + " --quiet --out " +
                             ShellQuoted(out.string()) + " 2> " + ShellQuoted(err);
  EXPECT_EQ(std::system(("unshare -Urm sh -c " + ShellQuoted(inside)).c_str()), 0) << ReadAll(err);
  EXPECT_EQ(ReadAll(err), "");
  EXPECT_TRUE(fs::exists(out / "result.json"));
}

struct WrongCall {
  std::string name;
  std::vector<std::string> arguments;
  std::string part;
};

TEST(CommandLineTest, WrongCallsPrintOneLineAndExitWithStatus2) {
  const std::vector<WrongCall> calls = {
      {"unknown command", {"rnu"}, "did you mean 'run'?"},
      {"no config", {"run"}, "CONFIG... is missing: heba run CONFIG..."},
      {"unknown flag", {"run", "x.yaml", "--outt", "y"}, "did you mean 'out'?"},
      {"flag of another command", {"run", "x.yaml", "--dpi", "300"}, "no flag --dpi"},
      {"library's flag", {"run", "x.yaml", "--logtostderr"}, "no flag --logtostderr"},
      {"flag without value", {"run", "x.yaml", "--out"}, "needs a value"},
      {"number expected", {"run", "x.yaml", "--jobs", "many"}, "whole number"},
      {"negative jobs", {"detect", "x.yaml", "--jobs=-1"}, ""},
      {"a flag where a value belongs", {"run", "x.yaml", "--out", "--quiet"}, "--out needs a value"},
      {"a config that is a device", {"run", "/dev/zero"}, "is not a regular file"},
      {"a config without end", {"doctor", "/dev/urandom"}, "is not a regular file"},
      {"two configs for one", {"detect", "a.yaml", "b.yaml"}, "takes one CONFIG, or images with --any"},
      {"missing config", {"run", "no/such.yaml"}, "no such file"},
      {"export of nothing", {"export", "no/such", "--to", "urdf"}, "no such file"},
      {"export without a form", {"export", "no/such"}, "needs --to FORMAT"},
      {"export to an unknown form", {"export", "no/such", "--to", "kuke"}, "did you mean 'kuka'?"},
      {"export of all forms to nowhere", {"export", "no/such", "--to", "all"}, "no such file"},
      {"cache with a misspelt word",
       {"cache", "clean"},
       "'clean' is unknown; did you mean 'clear'? One of: show, clear"},
      {"verdict that is misspelt", {"run", "x.yaml", "--fail-on", "doubtfull"}, "did you mean 'doubtful'?"},
      {"cache without a word", {"cache"}, "show|clear is missing"},
      {"locate without an image", {"locate", "no/such"}, "needs an IMAGE"},
      {"locate in nothing", {"locate", "no/such", "a.png"}, "no such file"},
      {"sheet without --out", {"target", "x.yaml"}, "needs --out"},
  };
  for (const WrongCall& call : calls) {
    const CommandResult result = RunHeba(call.arguments);
    EXPECT_EQ(result.status, 2) << call.name;
    EXPECT_THAT(result.err, testing::StartsWith("heba: error: ")) << call.name;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << call.name << ": " << result.err;
    EXPECT_THAT(result.err, testing::HasSubstr(call.part)) << call.name;
  }
}

TEST(CommandLineTest, HelpAndVersionSucceed) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{},
                                                    {"help"},
                                                    {"--help"},
                                                    {"run", "--help"},
                                                    {"help", "target"},
                                                    {"--version"},
                                                    {"cache", "--help"},
                                                    {"cache", "-h"},
                                                    {"help", "cache"}}) {
    const CommandResult result = RunHeba(arguments);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.err, "");
    EXPECT_THAT(result.out, testing::HasSubstr("heba"));
  }
}

}  // namespace
}  // namespace heba
