#include "tools/pipeline/scene_captures.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/input_error.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {

// The same cell in both forms, without a motion.
struct Form {
  const char* name;
  std::string scene;
  std::string of_camera;  // The end of the keys of its camera, for one more.
};

const Form kForms[] = {{"Short",
                        "setup: eye_to_hand\n"
                        "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}\n"
                        "hand_eye: {translation: [500 mm, 0 mm, 900 mm], rpy: [180 deg, 0 deg, 0 deg]}\n"
                        "board: {translation: [0 mm, 0 mm, 50 mm]}\n"
                        "camera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}\n",
                        ""},
                       {"Named",
                        "targets: {plate: {mount: gripper, pose: {translation: [0 mm, 0 mm, 50 mm]}, "
                        "target: {type: chessboard, rows: 5, columns: 8, square: 20 mm}}}\n"
                        "cameras:\n"
                        "  left:\n"
                        "    mount: world\n"
                        "    pose: {translation: [500 mm, 0 mm, 900 mm], rpy: [180 deg, 0 deg, 0 deg]}\n"
                        "    camera: {model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}\n",
                        "    "}};

class SceneCapturesTest : public testing::TestWithParam<Form> {
 protected:
  static SceneCaptures Draw(const std::string& of_camera, const std::string& more) {
    const std::string key = of_camera.empty() ? "" : GetParam().of_camera + of_camera;
    const Outcome<SceneCaptures> drawn =
        DrawSceneCaptures(ReadScene(ParseYaml(GetParam().scene + key + more, "scene.yaml")));
    EXPECT_TRUE(drawn) << drawn.reason();
    return drawn ? *drawn : SceneCaptures();
  }
};

TEST_P(SceneCapturesTest, RepeatsHaveOnePoseOfTheArm) {
  const std::string noise = "robot_noise: {translation: 1 mm}\nimage: {noise: 1 grey}\n";
  const SceneCaptures once = Draw("", noise + "motion: {captures: 3, distance: 600 mm}\n");
  const SceneCaptures twice = Draw("", noise + "motion: {captures: 3, distance: 600 mm, repeats: 2}\n");
  ASSERT_EQ(once.captures.size(), 3U);
  ASSERT_EQ(twice.captures.size(), 6U);
  for (size_t i = 0; i < twice.captures.size(); ++i) {
    const SceneCapture& capture = once.captures[i / 2];
    EXPECT_THAT(twice.captures[i].reported[0], IsNearPose(capture.reported[0], 1e-12, 1e-12));
    EXPECT_THAT(twice.captures[i].camera_from_target[0][0], IsNearPose(capture.camera_from_target[0][0], 1e-12, 1e-12));
  }
}

TEST_P(SceneCapturesTest, AMovedCameraSeesTheTargetFromElsewhere) {
  const std::string motion = "motion: {captures: 4, distance: 600 mm}\n";
  const SceneCaptures still = Draw("", motion);
  const SceneCaptures moved = Draw("moved: {from: 2, by: {translation: [4 mm, 0 mm, 0 mm]}}\n", motion);
  ASSERT_EQ(moved.captures.size(), 4U);
  for (size_t i = 0; i < moved.captures.size(); ++i) {
    Rigid3d expected = still.captures[i].camera_from_target[0][0];
    if (i >= 2) expected.translation.x() -= 0.004;
    EXPECT_THAT(moved.captures[i].camera_from_target[0][0], IsNearPose(expected, 1e-12, 1e-12));
    EXPECT_THAT(moved.captures[i].reported[0], IsNearPose(still.captures[i].reported[0], 1e-12, 1e-12));
  }
}

TEST_P(SceneCapturesTest, AnArmWithErrorsReportsItsJoints) {
  const SceneCaptures drawn =
      Draw("", "motion: {captures: 3, distance: 600 mm}\nrobot: {model: ur10e, offsets: 0.1 deg}\n");
  ASSERT_EQ(drawn.captures.size(), 3U);
  ASSERT_EQ(drawn.arm_errors.size(), 1U);
  EXPECT_GT(drawn.arm_errors[0].norm(), 0);
  for (const SceneCapture& capture : drawn.captures) EXPECT_EQ(capture.joints[0].size(), 6);
}

INSTANTIATE_TEST_SUITE_P(Forms, SceneCapturesTest, testing::ValuesIn(kForms),
                         [](const auto& form) { return std::string(form.param.name); });

}  // namespace
}  // namespace heba
