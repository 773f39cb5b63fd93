// Captures with byte-identical image files count once, or not at all if their poses contradict each other.
#include <algorithm>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;
using testing::Not;

size_t NumLinesWith(const std::string& text, const std::string& part) {
  size_t num_lines = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, text.find('\n', at))) {
    ++num_lines;
    if (text.find('\n', at) == std::string::npos) break;
  }
  return num_lines;
}

// One rendered data set of eight captures and its result, shared by all tests.
class DuplicateImagesTest : public testing::Test {
 protected:
  static constexpr size_t kNumCaptures = 8;

  static void SetUpTestSuite() {
    folder_ = new fs::path(TestFolder("duplicate_images"));
    WriteAll(*folder_ / "scene.yaml",
             "setup: eye_to_hand\ntarget: {type: charuco, rows: 5, columns: 7, square: 25 mm, marker: 18 mm, "
             "dictionary: DICT_4X4_50}\n"
             "camera: {model: brown5, image_size: [800, 600], fx: 900, fy: 902, cx: 404, cy: 296, distortion: [-0.1, "
             "0.08, 0.0004, -0.0006, 0.0]}\n"
             "hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}\n"
             "board: {translation: [-70 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}\n"
             "motion: {captures: 8, distance: 420 mm, depth: 0.25, tilt: 30 deg, spin: 60 deg, spread: 0.3}\n"
             "image: {blur: 0.7 px, noise: 2 grey}\nseed: 5\n");
    const CommandResult simulated = RunHeba({"simulate", Path("scene.yaml"), "--out", Path("data"), "--quiet"});
    ASSERT_EQ(simulated.status, 0) << simulated.err;
    rows_ = ReadPoseFile(Path("data/poses.csv"), *FindPoseFormat("ros"));
    ASSERT_EQ(rows_.size(), kNumCaptures);
    const CommandResult run = Run("data");
    ASSERT_EQ(run.status, 0) << run.err;
    out_ = new std::string(run.out);
    result_ = new Json(Json::parse(ReadAll(Path("data/run/result.json"))));
  }
  static void TearDownTestSuite() {
    fs::remove_all(*folder_);
    delete out_;
    delete result_;
    delete folder_;
  }
  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }

  // Writes a data set with the images and poses of `rows`; each image is a copy of the rendered image that `source`
  // names.
  static void WriteSet(const std::string& name, const std::vector<PoseRow>& rows,
                       const std::map<std::string, std::string>& source) {
    fs::create_directories(*folder_ / name / "images");
    for (const PoseRow& row : rows) {
      fs::copy_file(*folder_ / "data/images" / source.at(row.image), *folder_ / name / "images" / row.image);
    }
    WriteAll(*folder_ / name / "poses.csv", PoseFileText(rows, *FindPoseFormat("ros")));
    for (const char* file : {"config.yaml", "target.yaml", "camera.yaml", "truth.json"}) {
      fs::copy_file(*folder_ / "data" / file, *folder_ / name / file);
    }
  }
  static CommandResult Run(const std::string& name) {
    return RunHeba({"run", Path(name + "/config.yaml"), "--out", Path(name + "/run"), "--set", "refine.intrinsics=[]",
                    "--set", "evaluate.folds=4"});
  }
  static CommandResult Doctor(const std::string& name) {
    return RunHeba({"doctor", Path(name + "/config.yaml"), "--quiet"});
  }

  static fs::path* folder_;
  static std::vector<PoseRow> rows_;
  static std::string* out_;
  static Json* result_;
};
fs::path* DuplicateImagesTest::folder_ = nullptr;
std::vector<PoseRow> DuplicateImagesTest::rows_;
std::string* DuplicateImagesTest::out_ = nullptr;
Json* DuplicateImagesTest::result_ = nullptr;

const Json& Bundle(const Json& result) {
  for (const Json& estimate : result["estimates"]) {
    if (estimate["method"] == "bundle") return estimate;
  }
  ADD_FAILURE() << "no bundle estimate";
  return result;
}

TEST_F(DuplicateImagesTest, CopiesUnderOtherNamesDoNotChangeTheResult) {
  std::vector<PoseRow> rows;
  std::map<std::string, std::string> source;
  constexpr size_t kNumCopies = 8;
  for (const PoseRow& row : rows_) {
    for (size_t copy = 0; copy < kNumCopies; ++copy) {
      PoseRow another = row;
      if (copy > 0) another.image = fs::path(row.image).stem().string() + "_" + std::to_string(copy) + ".png";
      // The pose of a robot that stands still is read slightly differently each time.
      another.pose.translation.x() += 2e-5 * static_cast<double>(copy % 2);
      source[another.image] = row.image;
      rows.push_back(another);
    }
  }
  WriteSet("copies", rows, source);
  const CommandResult run = Run("copies");
  ASSERT_EQ(run.status, 0) << run.err;
  const Json result = Json::parse(ReadAll(Path("copies/run/result.json")));
  // The first of the copies is the original, so the same captures give the same numbers to the last digit.
  EXPECT_EQ(Bundle(result)["hand_eye"], Bundle(*result_)["hand_eye"]);
  EXPECT_EQ(Bundle(result)["covariance"], Bundle(*result_)["covariance"]);
  EXPECT_EQ(Bundle(result)["errors"], Bundle(*result_)["errors"]);
  ASSERT_EQ(result["captures"].size(), kNumCaptures * kNumCopies);
  size_t i = 0;
  for (const Json& capture : result["captures"]) {
    const std::string original = rows_[i / kNumCopies].image;
    EXPECT_EQ(capture["used"].get<bool>(), capture["image"] == original) << capture;
    if (capture["image"] == original) {
      EXPECT_TRUE(capture["repeat_of"].is_null());
    } else {
      EXPECT_EQ(capture["reason"], "the same image as " + original + ", byte by byte");
      EXPECT_EQ(capture["repeat_of"], original);
    }
    ++i;
  }
  const std::string log = ReadAll(Path("copies/run/log.txt"));
  EXPECT_EQ(NumLinesWith(log, "byte by byte"), 1U) << log;
  EXPECT_THAT(log, HasSubstr("56 of 64 captures repeat the image of another one"));
  // The verdict does not count the copies as captures that could not be used.
  EXPECT_EQ(run.out.substr(run.out.find("verdict: ")).substr(0, 14),
            out_->substr(out_->find("verdict: ")).substr(0, 14))
      << run.out;

  const CommandResult doctor = Doctor("copies");
  EXPECT_THAT(doctor.out, HasSubstr("nothing is wrong"));
  EXPECT_THAT(doctor.out, HasSubstr("remark [repeated_image]: 56 of 64 captures repeat the image"));
}

TEST_F(DuplicateImagesTest, IgnoresAnImageWithTwoPoses) {
  std::map<std::string, std::string> source;
  for (const PoseRow& row : rows_) source[row.image] = row.image;
  source[rows_[3].image] = rows_[1].image;
  WriteSet("contradiction", rows_, source);
  const CommandResult run = Run("contradiction");
  ASSERT_EQ(run.status, 0) << run.err;
  const Json result = Json::parse(ReadAll(Path("contradiction/run/result.json")));
  ASSERT_EQ(result["captures"].size(), kNumCaptures);
  for (size_t i = 0; i < kNumCaptures; ++i) {
    const Json& capture = result["captures"][i];
    EXPECT_EQ(capture["image"], rows_[i].image);
    EXPECT_EQ(capture["used"].get<bool>(), i != 1 && i != 3) << capture;
  }
  const std::string end =
      ", byte by byte, but with another pose of the robot: at most one of the poses belongs to the image, so no "
      "capture "
      "with this image is used";
  EXPECT_EQ(result["captures"][1]["reason"], "the same image as " + rows_[3].image + end);
  EXPECT_EQ(result["captures"][3]["reason"], "the same image as " + rows_[1].image + end);
  EXPECT_THAT(ReadAll(Path("contradiction/run/log.txt")),
              HasSubstr("2 of 8 captures share their images, byte by byte, with captures that have another pose"));
  const CommandResult doctor = Doctor("contradiction");
  EXPECT_THAT(doctor.out, HasSubstr("1. wrong [same_picture]: " + rows_[3].image + " is the same image as " +
                                    rows_[1].image + ", byte by byte, but has another pose of the robot"));
  EXPECT_THAT(doctor.out, Not(HasSubstr("repeated_image")));
}

TEST_F(DuplicateImagesTest, FailsIfAllPosesHaveTheSameImage) {
  std::map<std::string, std::string> source;
  for (const PoseRow& row : rows_) source[row.image] = rows_[0].image;
  WriteSet("frozen", rows_, source);
  const CommandResult run = Run("frozen");
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err, HasSubstr("8 of 8 captures share their images, byte by byte"));
  EXPECT_EQ(NumLinesWith(run.err, "heba: error: "), 1U) << run.err;
  EXPECT_FALSE(fs::exists(Path("frozen/run")));
}

}  // namespace
}  // namespace heba
