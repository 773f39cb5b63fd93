#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "heba/evaluation/verdict.h"

namespace heba {
namespace {

// Returns a result of two cameras with sigmas of 0.1 mm and 0.006 deg, 20 images each, and small hold-out errors.
RunResult GoodResult() {
  RunResult result;
  result.rig.robots = {"arm"};
  for (const char* name : {"left", "right"}) {
    Camera camera;
    camera.model = "pinhole";
    result.rig.cameras.push_back({name, {0, Mount::Part::kBase}, camera});
    result.solution.cameras.push_back(camera);
    CameraErrors& errors = result.errors.emplace_back();
    errors.holdout_rms_px = 0.3;
    errors.holdout_target_mm = 0.3;
    errors.holdout_target_deg = 0.02;
    for (int i = 0; i < 20; ++i) {
      result.images.push_back({std::to_string(i), name, "", true, "", {{"plate", 48, 0, 0.1, true}}});
    }
  }
  result.rig.targets.push_back({"plate", {0, Mount::Part::kGripper}, TargetShape()});
  result.solution.pixel_sigmas_px = {0.1, 0.1};
  result.solution.covariance.layout = UnknownsOf(result.rig);
  const Eigen::Index size = result.solution.covariance.layout.size();
  result.solution.covariance.matrix = 1e-8 * Eigen::MatrixXd::Identity(size, size);
  result.holdout_chi2 = 1.02;
  return result;
}

std::vector<Finding> FindingsWith(const Verdict& verdict, const std::string& code) {
  std::vector<Finding> found;
  std::copy_if(verdict.findings.begin(), verdict.findings.end(), std::back_inserter(found),
               [&](const Finding& finding) { return finding.code == code; });
  return found;
}

TEST(CellVerdictTest, AGoodCellIsGood) { EXPECT_EQ(JudgeRun(GoodResult()).grade, Grade::kGood); }

// A camera that could not be held out is named with the reason, and does not hide the errors of the others.
TEST(CellVerdictTest, NamesTheCameraWithoutHoldOut) {
  RunResult result = GoodResult();
  result.errors[1] = CameraErrors();
  result.errors[1].holdout_reason = Failure("fold 2: the data do not determine it");
  const Verdict verdict = JudgeRun(result);
  EXPECT_EQ(verdict.grade, Grade::kDoubtful);
  const std::vector<Finding> missing = FindingsWith(verdict, "no_hold_out");
  ASSERT_EQ(missing.size(), 1U);
  EXPECT_EQ(missing.front().Name("of_camera"), "right");
  EXPECT_EQ(missing.front().reason.text, "fold 2: the data do not determine it");
  const std::vector<Finding> known = FindingsWith(verdict, "hold_out");
  ASSERT_EQ(known.size(), 1U);
  EXPECT_EQ(known.front().Name("of_camera"), "left");
  // Without any fold there is one finding about all cameras.
  for (CameraErrors& errors : result.errors) errors = CameraErrors();
  const std::vector<Finding> none = FindingsWith(JudgeRun(result), "no_hold_out");
  ASSERT_EQ(none.size(), 1U);
  EXPECT_EQ(none.front().Name("reason"), "none_held_out");
}

// A capture without which one camera would move by more than chance explains is named with that camera.
TEST(CellVerdictTest, NamesTheCaptureThatMovesACamera) {
  RunResult result = GoodResult();
  for (ImageResult& image : result.images) image.move_without = CaptureMove{Tangent6::Constant(1e-6), 0.5};
  EXPECT_TRUE(FindingsWith(JudgeRun(result), "influential_capture").empty());
  ImageResult& strong = result.images[27];
  strong.move_without->tangent[0] = 5e-3;
  strong.move_without->p_value = 1e-6;
  const Verdict verdict = JudgeRun(result);
  EXPECT_EQ(verdict.grade, Grade::kDoubtful);
  const std::vector<Finding> found = FindingsWith(verdict, "influential_capture");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().Name("of_camera"), "right");
  EXPECT_EQ(found.front().Name("image"), "7");
  EXPECT_NEAR(*found.front().Number("chance"), 20 * 1e-6, 1e-12);
}

// The weak direction of the camera whose uncertainty is too large belongs to it; those of others stay.
TEST(CellVerdictTest, TheUncertaintyTakesTheWeakDirectionOfItsCamera) {
  RunResult result = GoodResult();
  for (const char* name : {"left", "right"}) {
    result.observations.push_back({Grade::kDoubtful, FindingCode("weak_direction"), {{"x", 9}}, {{"of_camera", name}}});
  }
  EXPECT_EQ(FindingsWith(JudgeRun(result), "weak_direction").size(), 2U);
  const UnknownBlock block = result.solution.covariance.layout.Block(CameraPoseBlock(result.rig.cameras[1]));
  result.solution.covariance.matrix(block.first, block.first) = 1;
  const Verdict verdict = JudgeRun(result);
  const std::vector<Finding> uncertainty = FindingsWith(verdict, "uncertainty");
  ASSERT_EQ(uncertainty.size(), 1U);
  EXPECT_EQ(uncertainty.front().Name("of_camera"), "right");
  ASSERT_EQ(uncertainty.front().parts.size(), 1U);
  EXPECT_EQ(uncertainty.front().parts.front().Name("of_camera"), "right");
  const std::vector<Finding> others = FindingsWith(verdict, "weak_direction");
  ASSERT_EQ(others.size(), 1U);
  EXPECT_EQ(others.front().Name("of_camera"), "left");
}

// The uncertainty is that of a target at the camera's working point, if there is one, and says that it does not include
// intrinsics that are held.
TEST(CellVerdictTest, JudgesEachCameraAtItsWorkingPoint) {
  RunResult result = GoodResult();
  result.working_points = {WorkingPoint{Eigen::Vector3d(0, 0, 3), 1e-8 * Eigen::Matrix3d::Identity()},
                           WorkingPoint{Eigen::Vector3d(0, 0, 1), 1e-8 * Eigen::Matrix3d::Identity()}};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
  result.working_points[1]->covariance_m2(1, 1) = std::pow(5e-3, 2);
  const Verdict verdict = JudgeRun(result);
  const Finding& first = verdict.findings.front();
  EXPECT_EQ(first.code, "uncertainty");
  EXPECT_EQ(first.grade, Grade::kDoubtful);
  EXPECT_EQ(first.Name("of_camera"), "right");
  EXPECT_NEAR(first.Number("at_work_mm").value_or(0), 5, 1e-9);
}

// Copies of images are not images that could not be used.
TEST(CellVerdictTest, CopiesDoNotCount) {
  RunResult result = GoodResult();
  for (int i = 0; i < 60; ++i) {
    ImageResult copy{std::to_string(20 + i), "left", "", false, "the same image", {{"plate", 48, 0, {}, false}}};
    copy.repeat_of = "3";
    result.images.push_back(copy);
  }
  const Verdict verdict = JudgeRun(result);
  EXPECT_EQ(verdict.grade, Grade::kGood);
}

// Requirements replace the built-in limits, and each is judged for the camera that it concerns.
TEST(CellVerdictTest, RequirementsReplaceBuiltInLimits) {
  RunResult result = GoodResult();
  result.errors[1].holdout_target_mm = 3;  // The built-in limits alone would grade this as doubtful.
  result.observations.push_back({Grade::kDoubtful, FindingCode("weak_direction"), {{"x", 9}}, {{"of_camera", "left"}}});
  EXPECT_EQ(JudgeRun(result).grade, Grade::kDoubtful);
  // A requirement for one camera leaves the limits of the other.
  result.requirements = {{0, {10e-3, 0.95, "here", 2e-3}}};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kDoubtful);
  EXPECT_TRUE(FindingsWith(JudgeRun(result), "weak_direction").empty());
  result.requirements.push_back({1, {10e-3, 0.95, "here", 2e-3}});
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
  result.requirements[1].requirement.within_m = 2.5e-3;
  const std::vector<Finding> required = FindingsWith(JudgeRun(result), "required");
  ASSERT_EQ(required.size(), 2U);
  EXPECT_EQ(required[0].grade, Grade::kBad);
  EXPECT_EQ(required[0].Name("of_camera"), "right");
  EXPECT_EQ(required[1].grade, Grade::kGood);
  // A place that is not in view is no place where the limit holds.
  result.requirements[0].requirement.reached_m.reset();
  EXPECT_EQ(FindingsWith(JudgeRun(result), "required")[1].grade, Grade::kBad);
}

}  // namespace
}  // namespace heba
