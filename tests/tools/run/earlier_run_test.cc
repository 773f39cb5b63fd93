// A run that builds on an earlier one: tools/run/earlier_run.h.
#include "tools/run/earlier_run.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"
#include "heba/run.h"
#include "tests/support/datasets.h"
#include "tests/support/input_error.h"

namespace heba {
namespace {

constexpr size_t kNumEarlier = 16;

class EarlierRunTest : public testing::Test {
 protected:
  // A camera with free intrinsics beside an arm, and a chessboard that looks the same if it is turned by 180 deg.
  EarlierRunTest() : target_(ParseTarget("{type: chessboard, rows: 7, columns: 9, square: 20 mm}")) {
    TestSceneOptions scene;
    scene.num_captures = 20;
    scene.noise_px = 0.05;
    scene.points = AllPoints(*target_).points_in_target;
    scene.robot_translation_m = 1e-4;
    scene.robot_rotation_rad = DegToRad(0.01);
    all_ = DatasetOf(MakeTestScene(3, scene), scene.setup, target_);
    all_.has_camera = {false};
    all_.rig.cameras[0].camera = Camera();
    for (size_t i = 0; i < all_.captures.size(); ++i) {
      all_.captures[i].name = all_.given_detections[i].detection.image_digest = std::to_string(i) + ".png";
    }
  }

  Dataset Part(size_t first, size_t last) const {
    std::vector<size_t> captures;
    for (size_t i = first; i < last; ++i) captures.push_back(i);
    return PartOf(all_, captures);
  }

  // Runs captures with a camera of a given model.
  static Outcome<RunOutput> RunBrown5(Dataset captures) {
    captures.rig.cameras[0].camera.model = "brown5";
    return heba::Run(captures, WithoutFolds());
  }

  // The run of the later captures on top of that of the earlier ones.
  static Outcome<RunOutput> Update(const RunOutput& earlier, const Dataset& later, const ChangeOfCell& change = {}) {
    RunOptions options = WithoutFolds();
    options.earlier = EarlierRun{"earlier", std::make_shared<const RunResult>(earlier.result), change};
    return heba::Run(later, options);
  }

  static const Finding* PriorOf(const RunResult& result) {
    const auto found = std::find_if(result.verdict.findings.begin(), result.verdict.findings.end(),
                                    [](const Finding& finding) { return finding.code == "prior"; });
    return found == result.verdict.findings.end() ? nullptr : &*found;
  }

  std::shared_ptr<const Target> target_;
  Dataset all_;
};

TEST_F(EarlierRunTest, AFewCapturesRefreshIt) {
  const Outcome<RunOutput> earlier = RunBrown5(Part(0, kNumEarlier));
  ASSERT_TRUE(earlier) << earlier.reason();
  const Outcome<RunOutput> of_all = RunBrown5(all_);
  ASSERT_TRUE(of_all) << of_all.reason();
  Dataset later = Part(kNumEarlier, all_.captures.size());
  const Outcome<RunOutput> updated = Update(*earlier, later);
  ASSERT_TRUE(updated) << updated.reason();
  const PairSolution& solution = *FindRefined(updated->result)->solution;
  const PairSolution& whole = *FindRefined(of_all->result)->solution;
  EXPECT_EQ(solution.camera.model, whole.camera.model);
  const Eigen::Matrix<double, 6, 6> covariance = *PoseCovarianceOf(whole.covariance_repeatable, kHandEyeBlock);
  const Eigen::Matrix<double, 6, 6> of_update = *PoseCovarianceOf(solution.covariance_repeatable, kHandEyeBlock);
  const Tangent6 difference =
      LocalCoordinates(whole.hand_eye.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
  for (Eigen::Index i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(difference[i]), 0.2 * std::sqrt(covariance(i, i))) << i;
    EXPECT_NEAR(of_update(i, i) / covariance(i, i), 1, 0.15) << i;
  }
  const Finding* const prior = PriorOf(updated->result);
  ASSERT_NE(prior, nullptr);
  EXPECT_EQ(prior->grade, Grade::kGood);
  // That there are few captures does not matter beside the earlier ones.
  for (const Finding& finding : updated->result.verdict.findings) EXPECT_NE(finding.code, "few_captures");

  // The detector may read the board from its other end.
  for (TargetDetection& seen : later.given_detections) {
    for (int& id : seen.detection.detection.ids) id = static_cast<int>(target_->points().size()) - 1 - id;
  }
  const Outcome<RunOutput> turned = Update(*earlier, later);
  ASSERT_TRUE(turned) << turned.reason();
  const HandEye& read = FindRefined(turned->result)->hand_eye;
  EXPECT_LT(DistanceM(read.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera), 1e-6);
  EXPECT_LT(AngleRad(read.target_mount_from_target, solution.hand_eye.target_mount_from_target), 1e-6);
}

TEST_F(EarlierRunTest, SaysThatTheCameraHasMoved) {
  const Outcome<RunOutput> earlier = RunBrown5(Part(0, kNumEarlier));
  ASSERT_TRUE(earlier) << earlier.reason();
  // The images are the same if the base is where the motion is undone.
  Dataset later = Part(kNumEarlier, all_.captures.size());
  const Rigid3d motion(ExpRotation({0, 0.005, 0}), {0.003, 0, 0});
  for (Recording& capture : later.captures) capture.base_from_gripper[0] = motion * capture.base_from_gripper[0];
  const Outcome<RunOutput> updated = Update(*earlier, later);
  ASSERT_TRUE(updated) << updated.reason();
  const Finding* const prior = PriorOf(updated->result);
  ASSERT_NE(prior, nullptr);
  EXPECT_EQ(prior->grade, Grade::kBad);
  EXPECT_EQ(prior->Name("part"), "camera_pose");
  EXPECT_EQ(prior->Name("run"), "earlier");
  EXPECT_EQ(updated->result.verdict.grade, Grade::kBad);
  // A motion that is stated is taken in.
  const Outcome<RunOutput> told = Update(*earlier, later, {3e-3, 5e-3, false});
  ASSERT_TRUE(told) << told.reason();
  EXPECT_EQ(PriorOf(told->result)->grade, Grade::kGood);
}

TEST_F(EarlierRunTest, RefusesAnotherTargetSetupOrCamera) {
  const Outcome<RunOutput> earlier = RunBrown5(Part(0, kNumEarlier));
  ASSERT_TRUE(earlier) << earlier.reason();
  Dataset other = Part(kNumEarlier, all_.captures.size());
  other.targets[0] = ParseTarget("{type: circle_grid, rows: 7, columns: 9, spacing: 20 mm, dot_diameter: 10 mm}");
  EXPECT_EQ(InputErrorOf([&] { static_cast<void>(Update(*earlier, other)); }),
            "earlier: is a run with a target of type chessboard, but the target is of type circle_grid");
  other = Part(kNumEarlier, all_.captures.size());
  other.rig = DatasetOf(Setup::kEyeInHand, target_).rig;
  EXPECT_EQ(InputErrorOf([&] { static_cast<void>(Update(*earlier, other)); }),
            "earlier: is a run with the setup eye_to_hand, but the captures are of eye_in_hand");
  other = Part(kNumEarlier, all_.captures.size());
  other.has_camera = {true};
  Camera& camera = other.rig.cameras[0].camera;
  camera = FindRefined(earlier->result)->camera;
  camera.width_px /= 2;
  EXPECT_NE(InputErrorOf([&] { static_cast<void>(Update(*earlier, other)); }).find("earlier: is a run with images of "),
            std::string::npos);
  camera = {"fisheye4", 1280, 960, {1000, 1000, 640, 480, 0, 0, 0, 0}};
  EXPECT_EQ(InputErrorOf([&] { static_cast<void>(Update(*earlier, other)); }),
            "earlier: is a run with the camera model brown5, but that of the camera is fisheye4");
}

}  // namespace
}  // namespace heba
