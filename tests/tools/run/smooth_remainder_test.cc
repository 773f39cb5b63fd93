// Tests of what the errors of an arm leave: solvers/calibration/smooth_remainder.h, by runs.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/run.h"
#include "tests/support/arm_scenes.h"
#include "tests/support/datasets.h"

namespace heba {
namespace {

struct Figures {
  int num_named = 0;      // Runs that name a remainder.
  int num_runs = 0;       // Runs that estimate the arm.
  double rms_sigmas = 0;  // Root mean square of the error of the camera's pose, in units of its covariance.
};

// Runs scenes of an arm whose errors are estimated from recorded joints.
Figures FiguresOf(double joint_ripple_rad, SmoothPoseErrors smooth = SmoothPoseErrors::kAuto) {
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}");
  ArmSceneOptions scene_options;
  scene_options.setup = Setup::kEyeInHand;
  scene_options.num_captures = 30;
  scene_options.points = AllPoints(*target).points_in_target;
  scene_options.joint_ripple_rad = joint_ripple_rad;
  RunOptions options = WithoutFolds();
  options.calibration.smooth = smooth;
  Figures figures;
  double sum = 0;
  for (const uint64_t seed : {2, 3, 4, 5}) {
    const ArmScene scene = MakeArmScene(seed, scene_options);
    Dataset dataset = DatasetOf(scene.scene, scene_options.setup, target);
    SetArm(scene, &dataset);
    const Outcome<RunOutput> run = Run(WithFixedCamera(std::move(dataset)), options);
    EXPECT_TRUE(run) << run.reason();
    if (!run || !run->result.arms[0]->is_estimated) continue;
    ++figures.num_runs;
    const std::vector<Finding>& findings = run->result.verdict.findings;
    figures.num_named += std::any_of(findings.begin(), findings.end(),
                                     [](const Finding& finding) { return finding.Name("beside") == "errors_of_arm"; });
    const PairSolution& solution = *FindRefined(run->result)->solution;
    const Tangent6 error =
        LocalCoordinates(scene.scene.hand_eye.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
    sum += error.dot(SolveSymmetric(solution.covariance.matrix.topLeftCorner<6, 6>(), error)) / 6;
  }
  figures.rms_sigmas = std::sqrt(sum / figures.num_runs);
  return figures;
}

// Errors of gears are smooth, but none of the arm's parameters: the sigmas contain them.
TEST(SmoothRemainderTest, SigmasContainErrorsThatNoParameterOfTheArmHas) {
  const Figures figures = FiguresOf(DegToRad(0.03));
  EXPECT_EQ(figures.num_runs, 4);
  // Thirty captures show them at the level of a finding in half of the runs.
  EXPECT_GE(figures.num_named, 2);
  // It is 1.7 without them.
  EXPECT_LT(figures.rms_sigmas, 1.45);
  EXPECT_GT(figures.rms_sigmas, 0.5);
  // Smooth errors that are not wanted are not looked for.
  EXPECT_EQ(FiguresOf(DegToRad(0.03), SmoothPoseErrors::kNone).num_named, 0);
}

TEST(SmoothRemainderTest, SigmasOfArmsThatHaveNoneStayTrue) {
  const Figures figures = FiguresOf(0);
  EXPECT_EQ(figures.num_runs, 4);
  EXPECT_EQ(figures.num_named, 0);
  EXPECT_LT(figures.rms_sigmas, 1.4);
  EXPECT_GT(figures.rms_sigmas, 0.6);
}

}  // namespace
}  // namespace heba
