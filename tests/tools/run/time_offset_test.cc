// Tests of runs with a robot's stream of poses: heba/run.h.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/data/pose_stream.h"
#include "heba/run.h"
#include "tests/support/datasets.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

// A carried camera that passes the poses of its captures, and the true hand-eye pose.
struct MovingCell {
  Dataset dataset;
  Rigid3d gripper_from_camera;
};

// Returns a cell whose camera's clock is behind that of the robot by an offset.
MovingCell CellWithOffset(uint64_t seed, double offset_s) {
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 6, columns: 9, square: 20 mm}");
  TestSceneOptions options;
  options.setup = Setup::kEyeInHand;
  options.camera = {"pinhole", 1280, 960, {1000, 1000, 640, 480}};
  options.num_captures = 20;
  options.noise_px = 0.1;
  options.points = AllPoints(*target).points_in_target;
  const TestScene scene = MakeTestScene(seed, options);
  MovingCell cell{WithFixedCamera(DatasetOf(scene, Setup::kEyeInHand, target)),
                  scene.hand_eye.camera_mount_from_camera};
  for (size_t i = 0; i < cell.dataset.captures.size(); ++i) {
    Recording& capture = cell.dataset.captures[i];
    capture.name = cell.dataset.given_detections[i].detection.image_digest = std::to_string(i) + ".png";
    capture.images = {capture.name};
  }
  cell.dataset = OnStream(std::move(cell.dataset), offset_s);
  return cell;
}

const Finding* FindOffset(const RunResult& result) {
  const std::vector<Finding>& findings = result.verdict.findings;
  const auto found = std::find_if(findings.begin(), findings.end(),
                                  [](const Finding& finding) { return finding.code == "time_offset"; });
  return found == findings.end() ? nullptr : &*found;
}

// Returns the squares of the errors of as many offsets, in units of their sigmas.
double SquaresOfErrors(int num_cells) {
  double squares = 0;
  for (int seed = 1; seed <= num_cells; ++seed) {
    const double offset_s = seed % 2 == 0 ? 0.31 : -0.87;
    const MovingCell cell = CellWithOffset(static_cast<uint64_t>(seed), offset_s);
    const Outcome<RunOutput> run = heba::Run(cell.dataset, WithoutFolds());
    EXPECT_TRUE(run && run->result.time_offset) << seed;
    if (!run || !run->result.time_offset) return -1;
    const EstimatedTimeOffset& offset = *run->result.time_offset;
    EXPECT_LT(offset.sigma_s, 1e-3);
    squares += std::pow((offset.value_s - offset_s) / offset.sigma_s, 2);
    EXPECT_THAT(FindRefined(run->result)->hand_eye.camera_mount_from_camera,
                IsNearPose(cell.gripper_from_camera, 1e-3, 2e-3));
    const Finding* const finding = FindOffset(run->result);
    EXPECT_NE(finding, nullptr);
    if (finding == nullptr) return -1;
    EXPECT_EQ(finding->grade, Grade::kGood);
    EXPECT_NEAR(*finding->Number("offset_ms"), 1000 * offset_s, 5);
  }
  return squares;
}

// Bounds are two sides of .999 together of chi-square.
TEST(TimeOffsetTest, IsFoundWithItsSigma) { EXPECT_LT(SquaresOfErrors(2), 15.2); }

TEST(TimeOffsetNightly, IsFoundWithItsSigma) {
  const double squares = SquaresOfErrors(8);
  EXPECT_GT(squares, 0.7);
  EXPECT_LT(squares, 27.9);
}

// The sigma of the hand-eye pose has the share of the offset: it is larger than with a known one.
TEST(TimeOffsetTest, IsPartOfTheCovariance) {
  const MovingCell cell = CellWithOffset(3, 0);
  RunOptions options = WithoutFolds();
  const Outcome<RunOutput> estimated = heba::Run(cell.dataset, options);
  options.estimates_time_offset = false;
  const Outcome<RunOutput> known = heba::Run(cell.dataset, options);
  ASSERT_TRUE(estimated && known);
  EXPECT_FALSE(known->result.time_offset);
  const auto information_of = [](const RunOutput& run) {
    return run.result.solution.covariance.matrix.diagonal().cwiseInverse().sum();
  };
  EXPECT_LT(information_of(*estimated), information_of(*known));
}

TEST(TimeOffsetTest, IsNotDeterminedWhereTheRobotStands) {
  MovingCell cell = CellWithOffset(4, 0);
  PoseStream standing;
  for (size_t i = 0; i < cell.dataset.captures.size(); ++i) {
    const double time_s = *cell.dataset.captures[i].time_s;
    for (const double within_s : {-0.5, -0.3, -0.1, 0.1, 0.3, 0.5}) {
      standing.times_s.push_back(time_s + within_s);
      standing.base_from_gripper.push_back(cell.dataset.captures[i].base_from_gripper.front());
    }
  }
  cell.dataset.stream = standing;
  const Outcome<RunOutput> run = heba::Run(cell.dataset, WithoutFolds());
  ASSERT_TRUE(run) << run.reason();
  EXPECT_FALSE(run->result.time_offset);
  const Finding* const finding = FindOffset(run->result);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->grade, Grade::kDoubtful);
  EXPECT_FALSE(finding->Number("offset_ms"));
  EXPECT_THAT(FindRefined(run->result)->hand_eye.camera_mount_from_camera,
              IsNearPose(cell.gripper_from_camera, 1e-3, 2e-3));
}

TEST(TimeOffsetTest, RefusesAStreamWithoutTimes) {
  MovingCell cell = CellWithOffset(1, 0);
  const auto error_of = [&] { return InputErrorOf([&] { (void)heba::Run(cell.dataset, WithoutFolds()); }); };
  std::swap(cell.dataset.stream->times_s[0], cell.dataset.stream->times_s[1]);
  EXPECT_THAT(error_of(), HasSubstr("at increasing times"));
  std::swap(cell.dataset.stream->times_s[0], cell.dataset.stream->times_s[1]);
  cell.dataset.captures[2].time_s.reset();
  EXPECT_THAT(error_of(), HasSubstr("capture 2.png needs a time"));
}

}  // namespace
}  // namespace heba
