#include "solvers/calibration/model_choice.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/pair_calibration.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

using Robot = BundleOptions::Robot;
using Group = TargetShapeGroup;

struct TrueModel {
  const char* name;
  double robot_m;
  double robot_rad;
  std::array<double, TargetShape::kNumParams> shape;
  ErrorModel model;
};
void PrintTo(const TrueModel& truth, std::ostream* stream) { *stream << truth.name; }

class ModelChoiceTest : public testing::TestWithParam<TrueModel> {
 protected:
  TestSceneOptions Options() const {
    TestSceneOptions options;
    options.noise_px = 0.1;
    options.num_captures = 20;
    options.robot_translation_m = GetParam().robot_m;
    options.robot_rotation_rad = GetParam().robot_rad;
    options.shape = GetParam().shape;
    return options;
  }
};

// The right model is rejected with a probability of 1 %: three or more rejections in 20 seeds occur once in 1,000
// runs.
TEST_P(ModelChoiceTest, ChoosesTheRightModelAndCoversTheTruth) {
  int num_right = 0;
  constexpr int kSeeds = 20;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const TestScene scene = MakeTestScene(seed, Options());
    PairCalibrationOptions options;
    options.setup = Options().setup;
    options.camera = scene.camera;
    options.shape = DesignedShape(Options().points);
    const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
    ASSERT_TRUE(calibration.ok() && calibration->refined.ok()) << seed;
    EXPECT_THAT(calibration->unused, testing::SizeIs(testing::Le(1U))) << seed;
    num_right +=
        calibration->bundle.robot == GetParam().model.robot && calibration->bundle.free_shape == GetParam().model.shape
            ? 1
            : 0;
    const Tangent6 error = LocalCoordinates(scene.hand_eye.camera_mount_from_camera,
                                            calibration->refined->hand_eye.camera_mount_from_camera);
    // Chi-square with 6 degrees of freedom exceeds 32.1 once in 60,000 draws.
    const Eigen::Matrix<double, 6, 6> covariance = calibration->refined->covariance.matrix.topLeftCorner<6, 6>();
    EXPECT_LT(MahalanobisSquare(error, covariance), 32.1) << seed;
  }
  EXPECT_GE(num_right, kSeeds - 2);
}

constexpr std::array<double, TargetShape::kNumParams> kDesigned = {1, 1, 0, 0};
INSTANTIATE_TEST_SUITE_P(
    Truths, ModelChoiceTest,
    testing::Values(TrueModel{"exact", 0, 0, kDesigned, {Robot::kExact, {}}},
                    TrueModel{"noisy", 1e-4, 3e-4, kDesigned, {Robot::kEstimatedNoise, {}}},
                    TrueModel{"bent", 0, 0, {1, 1, 2e-3, 1e-3}, {Robot::kExact, {Group::kBend}}},
                    TrueModel{"twisted", 0, 0, {1, 1, 0, 0, 1e-3}, {Robot::kExact, {Group::kTwist}}},
                    TrueModel{"stretched", 0, 0, {1.002, 1.001, 0, 0}, {Robot::kExact, {Group::kScale}}},
                    TrueModel{"noisy_bent", 1e-4, 3e-4, {1, 1, 2e-3, 1e-3}, {Robot::kEstimatedNoise, {Group::kBend}}},
                    TrueModel{"noisy_bent_stretched",
                              1e-4,
                              3e-4,
                              {1.002, 1.001, 2e-3, 1e-3},
                              {Robot::kEstimatedNoise, {Group::kScale, Group::kBend}}}),
    [](const auto& test) { return test.param.name; });

// Returns the options of a scene in which the robot noise is larger than the pixel noise.
TestSceneOptions NoisyRobot(int num_captures) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  options.num_captures = num_captures;
  options.robot_translation_m = 3e-4;
  options.robot_rotation_rad = 5e-4;
  return options;
}

PairCalibrationOptions WithHeldCamera(const TestScene& scene) {
  PairCalibrationOptions options;
  options.camera = scene.camera;
  options.bundle.free_intrinsics = {};
  return options;
}

// The models with more parameters than the chosen one are not fitted, but for the largest.
TEST(ModelChoiceTest, ReportsTheModelsThatWereComparedAndTheLargestFitsBest) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.1;
  scene_options.shape = {1, 1, 2e-3, 0};
  const TestScene scene = MakeTestScene(4, scene_options);
  BundleOptions options;
  options.loss = LossKind::kNone;
  const Outcome<ModelChoice> choice =
      ChooseModel({scene.camera, scene.views, scene_options.setup, DesignedShape(scene_options.points)}, scene.hand_eye,
                  options, {true, true});
  ASSERT_TRUE(choice.ok()) << choice.reason();
  ASSERT_EQ(choice->alternatives.size(), 6U);
  EXPECT_FALSE(choice->alternatives.back().p.has_value());
  for (const ModelAlternative& smaller : choice->alternatives) {
    EXPECT_GE(choice->alternatives.back().log_likelihood, smaller.log_likelihood - 0.01) << NameOf(smaller.model);
  }
  EXPECT_EQ(NameOf(choice->alternatives[choice->chosen].model), "exact robot, target bent");
  EXPECT_LT(*choice->alternatives.front().p, 1e-10);
}

// A lens of the true model, of a target that is bent: with the target as designed, a larger lens would take up the
// bend.
TEST(ModelChoiceTest, ABentTargetIsNoReasonForALargerLens) {
  int num_right = 0;
  constexpr int kSeeds = 8;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    TestSceneOptions scene_options;
    scene_options.noise_px = 0.1;
    scene_options.num_captures = 20;
    scene_options.shape = {1, 1, 1e-3, 7e-4};
    scene_options.robot_translation_m = 1e-4;
    scene_options.robot_rotation_rad = 3e-4;
    scene_options.camera = {"brown4", 1600, 1200, {900, 902, 805, 595, -0.2, 0.1, 1e-3, -5e-4}};
    const TestScene scene = MakeTestScene(seed, scene_options);
    PairCalibrationOptions options;
    options.setup = scene_options.setup;
    options.shape = DesignedShape(scene_options.points);
    options.width_px = 1600;
    options.height_px = 1200;
    options.choose_camera_model = true;
    const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
    ASSERT_TRUE(calibration.ok() && calibration->refined.ok()) << seed;
    num_right += calibration->refined->camera.model == "brown4" ? 1 : 0;
    // The parts of the shape that are held are as designed, whatever the fits of the lenses made of them.
    const std::vector<Group>& free = calibration->bundle.free_shape;
    const bool is_scale_free = std::find(free.begin(), free.end(), Group::kScale) != free.end();
    if (!is_scale_free) {
      EXPECT_EQ(calibration->refined->shape.params[0], 1);
      EXPECT_EQ(calibration->refined->shape.params[1], 1);
    }
    EXPECT_GE(calibration->camera_alternatives.size(), 3U);
  }
  EXPECT_GE(num_right, kSeeds - 1);
}

// Few captures of few points in the middle of the image do not determine a rational lens: a smaller one is estimated,
// and the calibration says so.
TEST(ModelChoiceTest, StepsDownFromALensThatIsNotDetermined) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.1;
  scene_options.num_captures = 8;
  scene_options.points = GridPoints(4, 3, 0.01);
  const TestScene scene = MakeTestScene(3, scene_options);
  PairCalibrationOptions options;
  options.setup = scene_options.setup;
  options.shape = DesignedShape(scene_options.points);
  options.width_px = scene_options.camera.width_px;
  options.height_px = scene_options.camera.height_px;
  options.camera_model = "rational8";
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
  ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
  EXPECT_NE(calibration->refined->camera.model, "rational8");
  EXPECT_FALSE(calibration->reduced_camera.empty());
  bool is_said = false;
  for (const Finding& finding : Advise(*calibration, options).findings) {
    is_said = is_said || (finding.code == "camera_reduced" && finding.Name("wanted") == "rational8");
  }
  EXPECT_TRUE(is_said);
}

// Six poses do not determine two variances: a prior from industrial arms becomes part of the model, and a finding
// reports it.
TEST(ModelChoiceTest, UsesANoisePriorForFewPoses) {
  const TestScene scene = MakeTestScene(2, NoisyRobot(6));
  const PairCalibrationOptions options = WithHeldCamera(scene);
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
  ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
  EXPECT_TRUE(calibration->bundle.robot_noise_prior.has_value());
  EXPECT_GT(calibration->refined->robot_noise->translation_m, 1e-5);
  EXPECT_GT(calibration->refined->robot_noise->rotation_rad, 1e-5);
  bool is_said = false;
  for (const Finding& finding : Advise(*calibration, options).findings)
    is_said = is_said || finding.code == "few_captures_prior";
  EXPECT_TRUE(is_said);
}

void AddNoise(double sigma_px, Rng& rng, Points2* pixels) {
  for (Eigen::Index i = 0; i < pixels->size(); ++i) pixels->data()[i] += sigma_px * rng.Normal();
}

// Eight images at each of twelve poses contain no more information about the robot than twelve images.
TEST(ModelChoiceTest, RepeatedPosesDoNotReduceSigma) {
  const TestScene scene = MakeTestScene(7, NoisyRobot(12));
  std::vector<View> repeated;
  Rng rng(1);
  for (int repeat = 0; repeat < 8; ++repeat) {
    for (const View& view : scene.views) {
      repeated.push_back(view);
      repeated.back().name += "_" + std::to_string(repeat);
      AddNoise(0.1, rng, &repeated.back().observations.pixels);
    }
  }
  const PairCalibrationOptions options = WithHeldCamera(scene);
  const auto sigma_m = [&](const std::vector<View>& views) {
    const Outcome<PairCalibration> calibration = CalibratePair(views, options);
    EXPECT_TRUE(calibration.ok() && calibration->refined.ok());
    EXPECT_EQ(calibration->bundle.robot, Robot::kEstimatedNoise);
    return std::sqrt(calibration->refined->covariance.matrix.topLeftCorner<3, 3>().trace());
  };
  // The robot noise dominates: with eight times as many images the sigma stays the same instead of falling to about a
  // third.
  EXPECT_GT(sigma_m(repeated), 0.85 * sigma_m(scene.views));
}

// Odds are computed for models that only they can reject.
TEST(OddsAgainstTest, NeedAPossibleModelWithEffects) {
  const auto effects = std::make_shared<const SharedEffects>();
  const ErrorModel largest{BundleOptions::Robot::kEstimatedNoise, {}, effects};
  int num_computed = 0;
  std::optional<double> at_least = 98;
  const auto log_likelihood_at_least = [&](const SharedEffects& smaller) {
    EXPECT_EQ(&smaller, effects.get());
    ++num_computed;
    return at_least;
  };
  ModelAlternative smaller{largest, 100, {}, 2, kModelRejected};
  EXPECT_DOUBLE_EQ(*OddsAgainst(largest, smaller, log_likelihood_at_least), std::exp(2));
  EXPECT_EQ(num_computed, 1);
  at_least = std::nullopt;
  EXPECT_FALSE(OddsAgainst(largest, smaller, log_likelihood_at_least).has_value());
  EXPECT_EQ(num_computed, 2);
  smaller.p = 0.9 * kModelRejected;
  EXPECT_FALSE(OddsAgainst(largest, smaller, log_likelihood_at_least).has_value());
  smaller.p = 0.5;
  smaller.model.effects = nullptr;
  EXPECT_FALSE(OddsAgainst(largest, smaller, log_likelihood_at_least).has_value());
  EXPECT_EQ(num_computed, 2);
}

}  // namespace
}  // namespace heba
