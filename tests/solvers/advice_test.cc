#include "solvers/advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "solvers/bundle_adjustment.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

std::vector<std::string> AdviceFor(const TestScene& scene, const std::vector<ParameterGroup>& free_groups) {
  BundleOptions options;
  options.loss = "none";
  options.free_intrinsics = free_groups;
  const Problem problem{scene.camera, scene.views};
  const Outcome<Solution> solution = RefineHandEye(problem, scene.hand_eye, options);
  EXPECT_TRUE(solution.ok()) << solution.reason();
  return AdviseOnCaptures(problem, *solution, FreeOf(scene.camera.Model(), free_groups));
}

// A scene's solution with a robot taken as exact and a camera that is held.
struct Solved {
  Problem problem;
  Solution solution;
  FreeParameters free;
};
Solved SolveWithHeldCamera(const TestScene& scene, const TestSceneOptions& options) {
  BundleOptions bundle;
  bundle.free_intrinsics = {};
  const Problem problem{scene.camera, scene.views, options.setup, DesignedShape(options.points)};
  const Outcome<Solution> solution = RefineHandEye(problem, scene.hand_eye, bundle);
  EXPECT_TRUE(solution.ok()) << solution.reason();
  return {problem, solution.ok() ? *solution : Solution(), FreeOf(scene.camera.Model(), bundle)};
}

TEST(AdviceTest, IsSilentWhereAllIsWellKnown) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  EXPECT_THAT(AdviceFor(MakeTestScene(3, options), {ParameterGroup::kFocal}), testing::IsEmpty());
}

// Turns about the tool point at one distance do not tell the focal length: what tells it is depth.
TEST(AdviceTest, NamesWhatIsKnownWorstAndWhatWouldCureIt) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  options.motion = TestSceneOptions::Motion::kTwoStep;
  options.points = GridPoints(3, 3, 0.03);
  const TestScene scene = MakeTestScene(3, options);
  const std::vector<std::string> advice = AdviceFor(scene, {ParameterGroup::kFocal});
  ASSERT_FALSE(advice.empty());
  EXPECT_THAT(advice, testing::Contains(testing::AllOf(testing::HasSubstr("the camera's fx is known to "),
                                                       testing::HasSubstr(" px only (one sigma); two captures "),
                                                       testing::HasSubstr("nearer and farther would make it "))));
}

TEST(AdviceTest, ManyTiltedCapturesNeedLess) {
  TestSceneOptions options;
  options.noise_px = 0.3;
  options.points = GridPoints(2, 2, 0.04);
  options.num_captures = 6;
  options.max_tilt_rad = 0.2;
  const TestScene scene = MakeTestScene(8, options);
  const std::vector<std::string> few = AdviceFor(scene, {});
  TestSceneOptions more_options = options;
  more_options.num_captures = 60;
  more_options.max_tilt_rad = 0.6;
  const std::vector<std::string> many = AdviceFor(MakeTestScene(8, more_options), {});
  EXPECT_GT(few.size(), many.size());
}

TEST(AdviceTest, SpeaksOfANoisyRobotThatIsTakenAsExact) {
  for (const bool is_noisy : {false, true}) {
    TestSceneOptions options;
    options.noise_px = 0.1;
    options.num_captures = 20;
    options.robot_translation_m = is_noisy ? 5e-4 : 0;
    options.robot_rotation_rad = is_noisy ? 1e-3 : 0;
    const TestScene scene = MakeTestScene(5, options);
    const Solved solved = SolveWithHeldCamera(scene, options);
    const std::string advice = AdviseOnRobot(solved.problem, solved.solution, solved.free);
    EXPECT_EQ(advice.find("refine.robot_noise: auto") != std::string::npos, is_noisy) << advice;
  }
}

// Neither pixels nor a noisy robot pass for a bent or stretched target, and neither hides one.
TEST(AdviceTest, SpeaksOfATargetThatIsNotAsDesigned) {
  for (const bool is_noisy : {false, true}) {
    for (const bool is_made_well : {false, true}) {
      TestSceneOptions options;
      options.noise_px = 0.1;
      options.num_captures = 20;
      options.robot_translation_m = is_noisy ? 2e-4 : 0;
      options.robot_rotation_rad = is_noisy ? 4e-4 : 0;
      if (!is_made_well) options.shape = {1.001, 1.001, 5e-4, 0};
      for (uint64_t seed = 1; seed <= 10; ++seed) {
        const TestScene scene = MakeTestScene(seed, options);
        const Solved solved = SolveWithHeldCamera(scene, options);
        const TargetAdvice about_target = AdviseOnTarget(solved.problem, solved.solution, solved.free);
        const std::string& advice = about_target.sentence;
        EXPECT_EQ(advice.empty(), is_made_well) << advice;
        // Beside the shape nothing speaks of the robot unless it is noisy.
        EXPECT_EQ(AdviseOnRobot(solved.problem, solved.solution, about_target.free).empty(), !is_noisy);
        if (!is_made_well && !is_noisy) {
          EXPECT_THAT(advice, testing::HasSubstr("refine.target_shape: [scale, bend]"));
        }
      }
    }
  }
}

}  // namespace
}  // namespace heba
