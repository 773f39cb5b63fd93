// Runs on recorded captures of an arm in three configurations (ur5_three_configurations): which are used, how well
// those that were held out are predicted, and what is estimated from parts of them and from spoiled ones.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/metrics.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/io/pose_formats.h"
#include "heba/io/result_file.h"
#include "heba/target.h"
#include "tests/pipeline/cli.h"
#include "tests/support/data_sets.h"
#include "tools/files/detection_file.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;

// The rows of a file: the header, and the captures.
using Rows = std::vector<std::vector<std::string>>;

Rows ReadRows(const fs::path& file) {
  Rows rows;
  for (const std::string& line : Split(ReadAll(file), '\n')) {
    if (!line.empty()) rows.push_back(Split(line, ','));
  }
  return rows;
}

void WriteRows(const fs::path& file, const Rows& rows) {
  std::string text;
  for (const std::vector<std::string>& row : rows) text += Join(row, ",") + "\n";
  WriteAll(file, text);
}

class RecordedArmRunTest : public testing::Test {
 protected:
  void SetUp() override {
    data_ = DataDir() / "ur5_three_configurations";
    HEBA_SKIP_WITHOUT(data_);
    folder_ = TestFolder("recorded_arm_run");
    poses_ = ReadRows(data_ / "poses.csv");
    joints_ = ReadRows(data_ / "joints.csv");
  }

  // Returns the result of a run on these captures, in increasing order.
  Json Run(const std::vector<size_t>& captures, const Rows& joints, const std::string& robot,
           const std::string& more = "") {
    Rows poses = {poses_.front()};
    Rows of_captures = {joints.front()};
    for (const size_t i : captures) {
      poses.push_back(poses_[i + 1]);
      if (joints.size() > 1) of_captures.push_back(joints[i + 1]);
    }
    WriteRows(folder_ / "poses.csv", poses);
    WriteRows(folder_ / "joints.csv", of_captures);
    const std::string joints_key = joints.size() > 1 ? ", joints: joints.csv" : "";
    WriteAll(folder_ / "config.yaml",
             "setup: eye_in_hand\n"
             "target: {type: chessboard, rows: 7, columns: 8, square: 40 mm}\n"
             "captures: {images: " +
                 (data_ / "images" / "*.jpg").string() + ", poses: poses.csv, pose_format: ur" + joints_key +
                 "}\n"
                 "robot: " +
                 robot + "\n" + more);
    const CommandResult run =
        RunHeba({"run", (folder_ / "config.yaml").string(), "--out", (folder_ / "run").string(), "--quiet"},
                "HEBA_CACHE=" + (folder_ / "cache").string());
    EXPECT_EQ(run.status, 0) << run.err;
    return Json::parse(ReadAll(folder_ / "run" / "result.json"));
  }

  size_t NumCaptures() const { return poses_.size() - 1; }

  std::vector<size_t> All() const {
    std::vector<size_t> all(NumCaptures());
    std::iota(all.begin(), all.end(), size_t{0});
    return all;
  }

  std::vector<size_t> Subset(size_t size, Rng& rng) const {
    std::vector<size_t> all = All();
    for (size_t i = 0; i < size; ++i) {
      std::swap(all[i], all[i + static_cast<size_t>(rng.Uniform(0, 1) * static_cast<double>(all.size() - i))]);
    }
    all.resize(size);
    std::sort(all.begin(), all.end());
    return all;
  }

  fs::path data_;
  fs::path folder_;
  Rows poses_;
  Rows joints_;
};

int NumUsed(const Json& result) {
  int num_used = 0;
  for (const Json& capture : result["captures"]) num_used += capture["used"].get<bool>() ? 1 : 0;
  return num_used;
}

TEST_F(RecordedArmRunTest, RecordedJointsPredictHeldOutCaptures) {
  const Json result = Run(All(), joints_, "{model: ur5}");
  EXPECT_EQ(NumUsed(result), 55);
  const Json& refined = result["estimates"].back();
  EXPECT_EQ(refined["robot"]["decision"], "estimated");
  EXPECT_LE(refined["errors"]["holdout_rms_px"].get<double>(), 0.36);
  EXPECT_LE(refined["errors"]["holdout_target_mm"].get<double>(), 0.34);
}

TEST_F(RecordedArmRunTest, RecoveredJointsPredictHeldOutCaptures) {
  const Json result = Run(All(), {joints_.front()}, "{model: ur5, tool: {translation: [0 mm, 0 mm, 50 mm]}}");
  EXPECT_GE(NumUsed(result), 53);
  const Json& errors = result["estimates"].back()["errors"];
  EXPECT_LE(errors["holdout_rms_px"].get<double>(), 0.45);
  EXPECT_LE(errors["holdout_target_mm"].get<double>(), 0.45);
}

TEST_F(RecordedArmRunTest, ArmIsEstimatedFromRandomParts) {
  Rng rng(1);
  for (int part = 0; part < 20; ++part) {
    const size_t size = 25 + static_cast<size_t>(rng.Uniform(0, 1) * 30);
    const Json result = Run(Subset(size, rng), joints_, "{model: ur5}", "evaluate: {folds: 0}\n");
    EXPECT_EQ(result["estimates"].back()["robot"]["decision"], "estimated") << "part " << part << " of " << size;
  }
}

// Returns the root mean square of the reprojection errors of all captures of a data set that a result did not use, at
// the poses that it computes from what the robot reports.
double ErrorsOfOthersPx(const RunResult& result, const Rows& poses, const Rows& joints,
                        const std::vector<std::pair<std::string, CaptureDetection>>& detections, const Target& target) {
  const PairSolution& solution = *FindRefined(result)->solution;
  double squares = 0;
  int num_points = 0;
  for (size_t i = 0; i < detections.size(); ++i) {
    const std::string& name = detections[i].first;
    const CaptureDetection& capture = detections[i].second;
    const bool is_used = std::any_of(result.images.begin(), result.images.end(),
                                     [&](const ImageResult& other) { return other.used && other.image == name; });
    if (is_used || capture.detection.ids.empty()) continue;
    std::vector<double> numbers;
    for (size_t k = 1; k < poses[i + 1].size(); ++k) numbers.push_back(std::stod(poses[i + 1][k]));
    const Rigid3d reported = *PoseFromNumbers(*FindPoseFormat("ur"), numbers);
    Eigen::VectorXd positions(6);
    for (Eigen::Index j = 0; j < 6; ++j) positions[j] = std::stod(joints[i + 1][static_cast<size_t>(j) + 1]);
    const Rigid3d base_from_gripper = *TruePose(*result.arms[0], reported, positions);
    const Rigid3d camera_from_target = CameraFromTarget(
        solution.hand_eye, CameraMountFromTargetMount(SetupOf(result.rig.cameras[0].mount), base_from_gripper));
    const std::optional<SquaredErrors> errors = ViewErrors(
        solution.camera, camera_from_target, ApplyShape(ObservationsOf(target, capture.detection), solution.shape));
    EXPECT_TRUE(errors.has_value()) << name;
    if (!errors) continue;
    squares += std::pow(*errors->RmsPx(), 2) * capture.detection.ids.size();
    num_points += static_cast<int>(capture.detection.ids.size());
  }
  return std::sqrt(squares / num_points);
}

TEST_F(RecordedArmRunTest, EightCapturesPredictTheOthers) {
  Run(All(), joints_, "{model: ur5}", "evaluate: {folds: 0}\n");
  const auto detections = ReadDetections(folder_ / "run" / "detections.json");
  ASSERT_EQ(detections.size(), NumCaptures());
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 7, columns: 8, square: 40 mm}");
  Rng rng(3);
  std::vector<double> errors_px;
  for (int part = 0; part < 5; ++part) {
    Run(Subset(8, rng), joints_, "{model: ur5}", "evaluate: {folds: 0}\n");
    const RunResult result = ReadRunResult(folder_ / "run" / "result.json");
    ASSERT_TRUE(FindEstimatedArm(result, 0) != nullptr) << part;
    errors_px.push_back(ErrorsOfOthersPx(result, poses_, joints_, detections, *target));
  }
  std::sort(errors_px.begin(), errors_px.end());
  EXPECT_LE(errors_px[2], 0.8) << testing::PrintToString(errors_px);
}

TEST_F(RecordedArmRunTest, WrongJointsAndArmsAreNeverEstimatedAndGood) {
  using Spoil = Rows (*)(Rows);
  const std::map<std::string, std::pair<Spoil, std::string>> spoilings = {
      {"another arm", {[](Rows rows) { return rows; }, "{model: ur5e}"}},
      {"degrees",
       {[](Rows rows) {
          for (size_t i = 1; i < rows.size(); ++i) {
            for (size_t j = 1; j < rows[i].size(); ++j) rows[i][j] = std::to_string(57.2957795 * std::stod(rows[i][j]));
          }
          return rows;
        },
        "{model: ur5}"}},
      {"a row shifted",
       {[](Rows rows) {
          for (size_t i = 1; i + 1 < rows.size(); ++i)
            std::copy(rows[i + 1].begin() + 1, rows[i + 1].end(), rows[i].begin() + 1);
          return rows;
        },
        "{model: ur5}"}},
      {"joints exchanged",
       {[](Rows rows) {
          for (size_t i = 1; i < rows.size(); ++i) std::swap(rows[i][1], rows[i][2]);
          return rows;
        },
        "{model: ur5}"}}};
  Rng rng(2);
  for (const auto& [name, spoiling] : spoilings) {
    for (int part = 0; part < 5; ++part) {
      const size_t size = 25 + static_cast<size_t>(rng.Uniform(0, 1) * 20);
      const Json result = Run(Subset(size, rng), spoiling.first(joints_), spoiling.second, "evaluate: {folds: 0}\n");
      EXPECT_NE(result["verdict"]["grade"], "good") << name;
      EXPECT_EQ(result["estimates"].back()["robot"]["decision"], "declined") << name;
    }
  }
}

TEST_F(RecordedArmRunTest, CaptureWithOneWrongJointIsLeftOut) {
  Rows joints = joints_;
  joints[7][3] = "1e9";
  const Json result = Run(All(), joints, "{model: ur5}", "evaluate: {folds: 0}\n");
  EXPECT_EQ(NumUsed(result), 54);
  EXPECT_EQ(result["estimates"].back()["robot"]["decision"], "estimated");
  EXPECT_THAT(result["captures"][6]["reason"].get<std::string>(),
              testing::HasSubstr("its joints or its pose are wrong"));
}

// The arm of fr3_joints_pose_pairs, from poses of the target without images.
TEST(RecordedPairsRunTest, ArmIsEstimatedFromPairsAndEveryCommandReadsTheResult) {
  const fs::path data = DataDir() / "fr3_joints_pose_pairs";
  HEBA_SKIP_WITHOUT(data);
  const fs::path folder = TestFolder("recorded_pairs_run");
  WriteAll(folder / "config.yaml",
           "setup: eye_in_hand\n"
           "captures: {poses: tcp.csv, target_poses: {file: camera_in_target.csv, poses_are: target_from_camera}, "
           "joints: joints.csv}\n"
           "robot: {model: franka_fr3}\n");
  for (const char* const name : {"tcp.csv", "camera_in_target.csv", "joints.csv"}) {
    fs::copy_file(data / name, folder / name);
  }
  const fs::path run = folder / "run";
  const CommandResult made = RunHeba({"run", (folder / "config.yaml").string(), "--out", run.string(), "--quiet"});
  ASSERT_EQ(made.status, 0) << made.err;
  const Json result = Json::parse(ReadAll(run / "result.json"));
  const auto chain = std::find_if(result["estimates"].begin(), result["estimates"].end(),
                                  [](const Json& estimate) { return estimate["method"] == "chain"; });
  ASSERT_NE(chain, result["estimates"].end());
  EXPECT_EQ((*chain)["robot"]["decision"], "estimated");
  EXPECT_LE((*chain)["errors"]["holdout_target_mm"].get<double>(), 1.2);
  EXPECT_LE((*chain)["errors"]["holdout_target_deg"].get<double>(), 0.22);
  // A pose of this arm does not tell its joints.
  Rows rows = ReadRows(data / "tcp.csv");
  const Rows joints = ReadRows(data / "joints.csv");
  ASSERT_EQ(rows.size(), joints.size());
  for (size_t i = 0; i < rows.size(); ++i) rows[i].insert(rows[i].end(), joints[i].begin() + 1, joints[i].end());
  WriteRows(folder / "with_joints.csv", rows);
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"export", run.string(), "--to", "ros2"},
        {"export", run.string(), "--to", "robot_urdf"},
        {"compare", run.string(), run.string(), "--out", (folder / "compared").string()},
        {"correct", run.string(), (folder / "with_joints.csv").string(), "--out", (folder / "corrected.csv").string()},
        {"doctor", (folder / "config.yaml").string()}}) {
    const CommandResult read = RunHeba(command);
    EXPECT_EQ(read.status, 0) << command.front() << ": " << read.err << read.out;
  }
}

}  // namespace
}  // namespace heba
