// Tests that bad points, wrong captures and bad initial guesses are found, named and harmless. Errors are compared
// with those of the oracle: the estimate that is told which points and captures are good and starts at the truth.
#include <algorithm>
#include <cmath>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/pair_calibration.h"
#include "solvers/calibration/multi_start.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/residuals/inliers.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kNoisePx = 0.2;

TestScene SceneOf(uint64_t seed, Setup setup, const Points3& points) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = 20;
  options.noise_px = kNoisePx;
  options.points = points;
  return MakeTestScene(seed, options);
}

PairCalibrationOptions OptionsFor(const TestScene& scene, Setup setup) {
  PairCalibrationOptions options;
  options.setup = setup;
  options.camera = scene.camera;
  options.bundle.free_intrinsics = {};
  return options;
}

double ErrorM(const TestScene& scene, const HandEye& hand_eye) {
  return DistanceM(hand_eye.camera_mount_from_camera, scene.hand_eye.camera_mount_from_camera);
}

HandEye OracleFit(const TestScene& scene, Setup setup, const std::vector<View>& good) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {};
  return RefineHandEye({scene.camera, good, setup}, scene.hand_eye, options)->hand_eye;
}

std::set<std::string> NamesOfUnused(const PairCalibration& calibration) {
  std::set<std::string> names;
  for (const UnusedView& unused : calibration.unused) names.insert(unused.name);
  return names;
}

// Sums over the seeds of the squared errors of the calibration and of the oracle. Value() is the ratio of the RMS
// errors.
struct Ratio {
  double found_m2 = 0;
  double oracle_m2 = 0;
  double Value() const { return std::sqrt(found_m2 / oracle_m2); }
};

// Displaces each point with a probability of 0.25, by up to 40 px along each axis. Returns the view with only the other
// points.
View DisplaceAQuarterOfPoints(View* view, Rng& rng) {
  std::vector<bool> keep;
  for (Eigen::Index i = 0; i < view->observations.size(); ++i) {
    keep.push_back(rng.Uniform() >= 0.25);
    if (keep.back()) continue;
    view->observations.pixels.col(i) += Eigen::Vector2d{rng.Uniform(-40, 40), rng.Uniform(-40, 40)};
  }
  View good = *view;
  good.observations = KeepPoints(view->observations, keep);
  return good;
}

struct Case {
  const char* name;
  heba::Setup setup;
  int columns;
  int rows;
  double spacing_m;
};
void PrintTo(const Case& c, std::ostream* stream) { *stream << c.name; }

class RobustnessTest : public testing::TestWithParam<Case> {
 protected:
  heba::Setup setup() const { return GetParam().setup; }
  TestScene Scene(int seed) const {
    return SceneOf(static_cast<uint64_t>(seed), setup(),
                   GridPoints(GetParam().columns, GetParam().rows, GetParam().spacing_m));
  }
};

TEST_P(RobustnessTest, RejectsTwoSwappedCaptures) {
  constexpr int kSeeds = 200;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    TestScene scene = Scene(seed);
    std::vector<View> good(scene.views.begin(), scene.views.end() - 2);
    std::swap(scene.views[18].observations, scene.views[19].observations);
    PairCalibrationOptions options = OptionsFor(scene, setup());
    // The model is that of the oracle; the choice of the model has tests of its own.
    options.choose = {};
    const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
    ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
    EXPECT_THAT(NamesOfUnused(*calibration), testing::IsSupersetOf({"view_18", "view_19"}));
    const HandEye without = OracleFit(scene, setup(), good);
    const Tangent6 difference =
        LocalCoordinates(without.camera_mount_from_camera, calibration->refined->hand_eye.camera_mount_from_camera);
    for (Eigen::Index k = 0; k < 6; ++k) {
      EXPECT_LT(std::abs(difference[k]), std::sqrt(calibration->refined->covariance.matrix(k, k))) << k;
    }
  }
}

TEST_P(RobustnessTest, RejectsAlmostNothingFromCleanData) {
  constexpr int kSeeds = 200;
  Ratio ratio;
  int num_with_false_alarm = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const TestScene scene = Scene(seed);
    const Outcome<PairCalibration> calibration = CalibratePair(scene.views, OptionsFor(scene, setup()));
    ASSERT_TRUE(calibration.ok() && calibration->refined.ok()) << seed;
    num_with_false_alarm += calibration->unused.empty() ? 0 : 1;
    ratio.found_m2 += std::pow(ErrorM(scene, calibration->refined->hand_eye), 2);
    ratio.oracle_m2 += std::pow(ErrorM(scene, OracleFit(scene, setup(), scene.views)), 2);
  }
  RecordProperty("ratio", std::to_string(ratio.Value()));
  RecordProperty("false_alarms", num_with_false_alarm);
  EXPECT_LT(ratio.Value(), 1.08);
  // 1 % of the seeds, which is two, are expected to have a false alarm; nine or more occur less than once in 10^3
  // runs.
  EXPECT_LT(num_with_false_alarm, 9);
}

TEST_P(RobustnessTest, ToleratesAQuarterOfOutlierPoints) {
  constexpr int kSeeds = 60;
  Ratio ratio;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    TestScene scene = Scene(seed);
    Rng rng(static_cast<uint64_t>(seed), 7);
    std::vector<View> good;
    for (View& view : scene.views) good.push_back(DisplaceAQuarterOfPoints(&view, rng));
    const Outcome<PairCalibration> calibration = CalibratePair(scene.views, OptionsFor(scene, setup()));
    ASSERT_TRUE(calibration.ok()) << seed << calibration.reason();
    ASSERT_TRUE(calibration->refined.ok()) << seed << calibration->refined.reason();
    ratio.found_m2 += std::pow(ErrorM(scene, calibration->refined->hand_eye), 2);
    ratio.oracle_m2 += std::pow(ErrorM(scene, OracleFit(scene, setup(), good)), 2);
  }
  RecordProperty("ratio", std::to_string(ratio.Value()));
  EXPECT_LT(ratio.Value(), 1.25);
}

TEST_P(RobustnessTest, ToleratesATenthOfWrongPoses) {
  constexpr int kSeeds = 60;
  Ratio ratio;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    TestScene scene = Scene(seed);
    Rng rng(static_cast<uint64_t>(seed), 8);
    std::vector<View> good;
    std::vector<std::string> wrong;
    for (View& view : scene.views) {
      if (rng.Uniform() >= 0.1) {
        good.push_back(view);
        continue;
      }
      wrong.push_back(view.name);
      const Rigid3d stated =
          WithRobotNoise(BaseFromGripper(setup(), view.camera_mount_from_target_mount), 0.02, 0.005, rng);
      view.camera_mount_from_target_mount = CameraMountFromTargetMount(setup(), stated);
    }
    const Outcome<PairCalibration> calibration = CalibratePair(scene.views, OptionsFor(scene, setup()));
    ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
    EXPECT_THAT(NamesOfUnused(*calibration), testing::IsSupersetOf(wrong));
    ratio.found_m2 += std::pow(ErrorM(scene, calibration->refined->hand_eye), 2);
    ratio.oracle_m2 += std::pow(ErrorM(scene, OracleFit(scene, setup(), good)), 2);
  }
  RecordProperty("ratio", std::to_string(ratio.Value()));
  EXPECT_LT(ratio.Value(), 1.15);
}

// The initial guesses of hand-eye pose and board pose are rotated by 120 deg and moved by 300 mm. The refinement
// alone converges to the solution in a third of the cases.
TEST_P(RobustnessTest, ConvergesFromADistantInitialGuess) {
  constexpr int kSeeds = 100;
  int num_alone = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const TestScene scene = Scene(seed);
    Rng rng(static_cast<uint64_t>(seed), 9);
    const auto far_off = [&](const Rigid3d& pose) {
      Tangent6 tangent;
      tangent << 0.3 * rng.Direction3(), DegToRad(120) * rng.Direction3();
      return Retract(pose, tangent);
    };
    const HandEye start{far_off(scene.hand_eye.camera_mount_from_camera),
                        far_off(scene.hand_eye.target_mount_from_target)};
    BundleOptions options;
    options.free_intrinsics = {};
    const Outcome<PairSolution> alone = RefineHandEye({scene.camera, scene.views, setup()}, start, options);
    constexpr double kRightM = 0.05;
    if (alone && ErrorM(scene, alone->hand_eye) < kRightM) ++num_alone;
    const MultiStartSolution started =
        RefineFromMultipleStarts({scene.camera, scene.views, setup()}, scene.pairs, {{"far off", start}}, options);
    ASSERT_TRUE(started.solution.ok()) << started.solution.reason();
    EXPECT_LT(ErrorM(scene, started.solution->hand_eye), kRightM) << started.seed;
  }
  RecordProperty("right_alone", num_alone);
  EXPECT_LT(num_alone, 80);
}

INSTANTIATE_TEST_SUITE_P(Boards, RobustnessTest,
                         testing::Values(Case{"small_board_eye_to_hand", Setup::kEyeToHand, 2, 2, 0.04},
                                         Case{"small_board_eye_in_hand", Setup::kEyeInHand, 2, 2, 0.04},
                                         Case{"large_board_eye_to_hand", Setup::kEyeToHand, 8, 6, 0.03}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace heba
