#include "heba/bundle_adjustment.h"

#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/pair_calibration.h"
#include "heba/pair_cross_validation.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/refine/fit.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/robot_noise.h"
#include "tests/support/linearised_views.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

HandEye Disturbed(const HandEye& hand_eye, double rotation_rad, double translation_m, uint64_t seed) {
  Rng rng(seed);
  const auto disturb = [&](const Rigid3d& pose) {
    Tangent6 tangent;
    tangent << translation_m * rng.Direction3(), rotation_rad * rng.Direction3();
    return Retract(pose, tangent);
  };
  return {disturb(hand_eye.camera_mount_from_camera), disturb(hand_eye.target_mount_from_target)};
}

// All camera models, setups and smooth losses.
class ExactDataTest : public testing::TestWithParam<std::tuple<std::string, Setup, std::string>> {};

TEST_P(ExactDataTest, IsRecovered) {
  const auto& [model, setup, loss] = GetParam();
  TestSceneOptions scene_options;
  scene_options.camera = TestCamera(model);
  scene_options.setup = setup;
  const TestScene scene = MakeTestScene(21, scene_options);
  BundleOptions options;
  options.loss = *FindLossKind(loss);
  options.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint};
  Camera start_camera = scene.camera;
  start_camera.params[0] *= 1.01;
  start_camera.params[3] += 5;
  const Outcome<PairSolution> solution =
      RefineHandEye({start_camera, scene.views}, Disturbed(scene.hand_eye, 0.05, 0.02, 1), options);
  ASSERT_TRUE(solution.ok()) << solution.reason();
  constexpr double kRoundOff = 1e-8;  // rad and m
  EXPECT_THAT(solution->hand_eye.camera_mount_from_camera,
              IsNearPose(scene.hand_eye.camera_mount_from_camera, kRoundOff, kRoundOff));
  EXPECT_THAT(solution->hand_eye.target_mount_from_target,
              IsNearPose(scene.hand_eye.target_mount_from_target, kRoundOff, kRoundOff));
  EXPECT_NEAR(solution->camera.params[0], scene.camera.params[0], 1e-4);
}

INSTANTIATE_TEST_SUITE_P(, ExactDataTest,
                         testing::Combine(testing::ValuesIn(CameraModelNames()),
                                          testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                                          testing::Values("none", "huber", "cauchy")),
                         [](const auto& test) {
                           return std::get<0>(test.param) + "_" + std::string(SetupName(std::get<1>(test.param))) +
                                  "_" + std::get<2>(test.param);
                         });

// All setups and smooth losses.
class NoisyDataTest : public testing::TestWithParam<std::tuple<Setup, std::string>> {};

// Each error, whitened by its own covariance, is chi-square distributed with as many degrees of freedom as there are
// parameters. Over 60 seeds with 16 parameters each (also with Huber's loss) the sum has 960 degrees of freedom, a
// mean of 960 and a standard deviation of 44: the interval [820, 1100] is 3.2 sigma wide on either side.
TEST_P(NoisyDataTest, ErrorsAgreeWithTheCovariance) {
  const auto& [setup, loss] = GetParam();
  double sum = 0;
  constexpr int kSeeds = 60;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    TestSceneOptions scene_options;
    scene_options.setup = setup;
    scene_options.noise_px = 0.3;
    const TestScene scene = MakeTestScene(seed, scene_options);
    BundleOptions options;
    options.loss = *FindLossKind(loss);
    options.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint};
    const Outcome<PairSolution> solution = RefineHandEye({scene.camera, scene.views}, scene.hand_eye, options);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    Eigen::VectorXd error(16);
    error.head<6>() =
        LocalCoordinates(scene.hand_eye.camera_mount_from_camera, solution->hand_eye.camera_mount_from_camera);
    error.segment<6>(6) =
        LocalCoordinates(scene.hand_eye.target_mount_from_target, solution->hand_eye.target_mount_from_target);
    for (size_t i = 0; i < 4; ++i)
      error[12 + static_cast<int>(i)] = solution->camera.params[i] - scene.camera.params[i];
    ASSERT_EQ(solution->covariance.layout.size(), 16);
    sum += MahalanobisSquare(error, solution->covariance.matrix);
    EXPECT_NEAR(solution->pixel_sigma_px, 0.3, 0.03);  // 4.5 sigma for 1440 coordinates; Huber's loss adds to it.
  }
  EXPECT_GT(sum, 820);
  EXPECT_LT(sum, 1100);
}

INSTANTIATE_TEST_SUITE_P(, NoisyDataTest,
                         testing::Combine(testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                                          testing::Values("none", "huber", "cauchy")),
                         [](const auto& test) {
                           return std::string(SetupName(std::get<0>(test.param))) + "_" + std::get<1>(test.param);
                         });

class LossTest : public testing::TestWithParam<std::string> {};

// The refinement reuses products that it has already computed; the covariance must be the same as from a new
// linearisation at the solution.
TEST_P(LossTest, CovarianceIsTheInverseInformationAtTheSolution) {
  const std::string& loss = GetParam();
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.3;
  scene_options.points = GridPoints(4, 3, 0.05);
  const TestScene scene = MakeTestScene(8, scene_options);
  BundleOptions options;
  options.loss = *FindLossKind(loss);
  options.free_intrinsics = {ParameterGroup::kFocal};
  const PairProblem problem{scene.camera, scene.views};
  const Outcome<PairSolution> solution = RefineHandEye(problem, scene.hand_eye, options);
  ASSERT_TRUE(solution.ok()) << solution.reason();
  PairProblem kept = problem;
  for (size_t i = 0; i < kept.views.size(); ++i) {
    const std::vector<int>& rejected = solution->views[i].rejected_ids;
    std::vector<bool> keep;
    for (const int id : kept.views[i].observations.ids) {
      keep.push_back(std::find(rejected.begin(), rejected.end(), id) == rejected.end());
    }
    kept.views[i].observations = KeepPoints(kept.views[i].observations, keep);
  }
  const Solution at = ProblemSolution(*solution);
  const std::optional<std::vector<LinearisedView>> views = LineariseEachCapture(
      WeightedAs(at, HandEyeProblem(kept, options)), StateOf(at), NoiseOf(at), LossOf(OfInliers(options.loss)));
  ASSERT_TRUE(views.has_value());
  const Eigen::MatrixXd information =
      MarginalInformation(*views, CorrectionVariances({}), LossOf(OfInliers(options.loss)).covariance_factor());
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(information.rows(), information.cols());
  const Eigen::MatrixXd product =
      scale.cwiseInverse().asDiagonal() * solution->covariance.matrix * information * scale.asDiagonal();
  EXPECT_LT((product - identity).cwiseAbs().maxCoeff(), 1e-6);
  // A second refinement from the solution has nothing left to improve.
  const Outcome<PairSolution> again = RefineHandEye({solution->camera, scene.views}, solution->hand_eye, options);
  ASSERT_TRUE(again.ok()) << again.reason();
  const Tangent6 moved =
      LocalCoordinates(solution->hand_eye.camera_mount_from_camera, again->hand_eye.camera_mount_from_camera);
  EXPECT_LT(moved.cwiseQuotient(scale.head<6>()).cwiseAbs().maxCoeff(), 1e-3);
  const bool is_plain = options.loss == LossKind::kNone;
  EXPECT_LE(again->convergence.iterations, is_plain ? 0 : 30);
}

INSTANTIATE_TEST_SUITE_P(, LossTest, testing::Values("none", "huber", "truncated"),
                         [](const auto& test) { return test.param; });

// Each name in the covariance belongs to the parameter at its index: a step of parameter i changes the cost by the
// diagonal element i of the information matrix.
TEST(InformationTest, NamesMatchTheParameters) {
  const TestScene scene = MakeTestScene(31);
  const PairProblem problem{scene.camera, scene.views};
  BundleOptions options;
  options.free_intrinsics = {ParameterGroup::kFocal};
  const std::vector<LinearisedView> views = LineariseViews(problem, scene.hand_eye, options, 1.0);
  const Information information{UnknownsOf(HandEyeProblem(problem, options)),
                                MarginalInformation(views, CorrectionVariances({}), 1.0)};
  ASSERT_EQ(information.layout.Name(2), "hand_eye.tz_m");
  ASSERT_EQ(information.layout.Name(9), "board.rx_rad");
  ASSERT_EQ(information.layout.Name(13), "camera.fy");
  const auto cost = [&](const HandEye& hand_eye, const Camera& camera) {
    return ReprojectionErrors(hand_eye, camera, scene.views)->sum_px2;
  };
  // The data are exact, so a small step h of parameter i has a cost of h^2 times the diagonal element i of the
  // information matrix.
  constexpr double kStep = 1e-6;
  HandEye moved = scene.hand_eye;
  moved.camera_mount_from_camera = Retract(moved.camera_mount_from_camera, kStep * Tangent6::Unit(2));
  EXPECT_NEAR(cost(moved, scene.camera) / (kStep * kStep) / information.matrix(2, 2), 1.0, 1e-3);
  moved = scene.hand_eye;
  moved.target_mount_from_target = Retract(moved.target_mount_from_target, kStep * Tangent6::Unit(3));
  EXPECT_NEAR(cost(moved, scene.camera) / (kStep * kStep) / information.matrix(9, 9), 1.0, 1e-3);
  Camera camera = scene.camera;
  camera.params[1] += 1e-3;
  EXPECT_NEAR(cost(scene.hand_eye, camera) / 1e-6 / information.matrix(13, 13), 1.0, 1e-3);
}

TEST(BundleAdjustmentTest, RefusesDegenerateMotion) {
  const TestScene scene = MakeTestScene(41);
  BundleOptions options;
  options.free_intrinsics = {};
  PairProblem two{scene.camera, {scene.views[0], scene.views[1]}};
  EXPECT_EQ(RefineHandEye(two, scene.hand_eye, options).failure().code, "few_captures");

  const auto with_turns = [&](double max_turn_rad) {
    Rng rng(3);
    PairProblem problem{scene.camera, {}};
    for (int i = 0; i < 12; ++i) {
      const Rigid3d camera_from_target =
          scene.pairs[0].camera_from_target *
          Rigid3d{ExpRotation({0, 0, rng.Uniform(-1, 1) * max_turn_rad}), 0.02 * rng.NormalVector3()};
      problem.views.push_back(*SimulateView("v", scene.camera, scene.hand_eye,
                                            CameraMountFromTargetMount(scene.hand_eye, camera_from_target),
                                            GridPoints(8, 6, 0.03), 0.1, rng));
    }
    return problem;
  };
  EXPECT_EQ(RefineHandEye(with_turns(0.5), scene.hand_eye, options).failure().code, "one_axis");
  EXPECT_EQ(RefineHandEye(with_turns(0.0), scene.hand_eye, options).failure().code, "no_rotation");
}

// Returns captures at one distance with rotations by this angle about the centre of the target.
PairProblem TurnedAtOneDistance(const TestScene& scene, const Points3& points, double turn_rad) {
  Rng rng(5);
  PairProblem problem{scene.camera, {}};
  for (int i = 0; i < 10; ++i) {
    const Rigid3d camera_from_target(ExpRotation(turn_rad * rng.Direction3()), Eigen::Vector3d(0, 0, 0.7));
    problem.views.push_back(*SimulateView("v", scene.camera, scene.hand_eye,
                                          CameraMountFromTargetMount(scene.hand_eye, camera_from_target), points, 0.3,
                                          rng));
  }
  return problem;
}

// With little tilt, the focal length and the principal point cannot be separated from distance and orientation.
TEST(BundleAdjustmentTest, RefusesUnobservableIntrinsics) {
  const TestScene scene = MakeTestScene(42);
  BundleOptions options;
  options.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint};
  const Outcome<PairSolution> solution =
      RefineHandEye(TurnedAtOneDistance(scene, GridPoints(2, 2, 0.02), 0.06), scene.hand_eye, options);
  ASSERT_FALSE(solution.ok());
  EXPECT_THAT(solution.reason(), testing::HasSubstr("undetermined (of_camera camera, unknown camera."));
}

// With more tilt, they hardly can. What is known badly is a result, and its sigma says so.
TEST(BundleAdjustmentTest, StatesTheSigmaOfIntrinsicsThatAreKnownBadly) {
  const TestScene scene = MakeTestScene(42);
  BundleOptions options;
  options.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint};
  const Outcome<PairSolution> solution =
      RefineHandEye(TurnedAtOneDistance(scene, GridPoints(4, 4, 0.02), 0.2), scene.hand_eye, options);
  ASSERT_TRUE(solution.ok()) << solution.reason();
  EXPECT_GT(*SigmaOf(solution->covariance, "camera.fx"), 0.01 * scene.camera.params[0]);
}

// Motions that say nothing about a direction are refused, whatever the noise of the robot: the same rotation
// throughout, rotations about one axis, two captures.
TEST(BundleAdjustmentTest, RefusesSingularMotionsWithNoisyRobots) {
  const TestScene scene = MakeTestScene(44);
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    for (const double robot_m : {0.0, 5e-5, 5e-4}) {
      for (const int motion : {0, 1, 2}) {
        Rng rng(seed, static_cast<uint64_t>(motion));
        PairProblem problem{scene.camera, {}};
        for (int i = 0; i < (motion == 2 ? 2 : 12); ++i) {
          const Eigen::Vector3d turn = motion == 0   ? Eigen::Vector3d(0, 0, 0)
                                       : motion == 1 ? Eigen::Vector3d(0, 0, rng.Uniform(-0.5, 0.5))
                                                     : Eigen::Vector3d(0.3 * rng.Direction3());
          const Rigid3d camera_from_target =
              scene.pairs[0].camera_from_target * Rigid3d(ExpRotation(turn), 0.02 * rng.NormalVector3());
          problem.views.push_back(*SimulateView("v", scene.camera, scene.hand_eye,
                                                CameraMountFromTargetMount(scene.hand_eye, camera_from_target),
                                                GridPoints(8, 6, 0.03), 0.1, rng));
          // A robot that errs by 0.5 mm errs by 0.05 deg.
          Rigid3d& pose = problem.views.back().camera_mount_from_target_mount;
          pose = pose * Rigid3d{ExpRotation(robot_m / 5e-4 * DegToRad(0.05) * rng.NormalVector3()),
                                robot_m * rng.NormalVector3()};
        }
        for (const BundleOptions::Robot robot : {BundleOptions::Robot::kExact, BundleOptions::Robot::kEstimatedNoise}) {
          BundleOptions options;
          options.free_intrinsics = {};
          options.robot = robot;
          EXPECT_FALSE(RefineHandEye(problem, scene.hand_eye, options).ok()) << seed << " " << robot_m << " " << motion;
        }
      }
    }
  }
}

TEST(BundleAdjustmentTest, NamesTheCaptureWithATargetBehindTheCamera) {
  const TestScene scene = MakeTestScene(43);
  HandEye wrong = scene.hand_eye;
  wrong.camera_mount_from_camera.rotation = wrong.camera_mount_from_camera.rotation * ExpRotation({kPi, 0, 0});
  const Outcome<PairSolution> solution = RefineHandEye({scene.camera, scene.views}, wrong, {});
  ASSERT_FALSE(solution.ok());
  EXPECT_THAT(solution.reason(), testing::HasSubstr("hidden_at_start (capture view_"));
}

// The parameter says if the captures contain little information about the focal length: rotations about the tool point
// alone do not separate it from the distance.
class CameraPriorTest : public testing::TestWithParam<bool> {};

// The estimate stays close to the prior if the captures do not determine it, and the covariance shows the uncertainty.
// Captures that contain more information than the prior override it.
TEST_P(CameraPriorTest, DeterminesWhatTheCapturesDoNot) {
  const bool is_weak = GetParam();
  double chi2 = 0;
  constexpr int kSeeds = 40;
  double focal_squares = 0;
  double sigma_squares = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    TestSceneOptions scene_options;
    scene_options.noise_px = 0.1;
    if (is_weak) {
      scene_options.motion = TestSceneOptions::Motion::kTwoStep;
      scene_options.points = GridPoints(2, 2, 0.04);
    }
    const TestScene scene = MakeTestScene(static_cast<uint64_t>(seed), scene_options);
    BundleOptions options;
    options.loss = LossKind::kNone;
    options.free_intrinsics = {ParameterGroup::kFocal};
    // The prior is a calibration of the camera with a sigma of 3 px.
    Rng rng(static_cast<uint64_t>(seed), 5);
    constexpr double kSigmaPx = 3;
    Camera camera = scene.camera;
    for (const size_t i : {0, 1}) camera.params[i] += kSigmaPx * rng.Normal();
    options.camera_prior =
        CameraPrior{camera.params, std::vector<double>(camera.params.size(), std::numeric_limits<double>::infinity())};
    options.camera_prior->sigmas[0] = kSigmaPx;
    options.camera_prior->sigmas[1] = kSigmaPx;
    const Outcome<PairSolution> solution = RefineHandEye({camera, scene.views}, scene.hand_eye, options);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    Eigen::Matrix<double, 14, 1> error;
    error << LocalCoordinates(scene.hand_eye.camera_mount_from_camera, solution->hand_eye.camera_mount_from_camera),
        LocalCoordinates(scene.hand_eye.target_mount_from_target, solution->hand_eye.target_mount_from_target),
        solution->camera.params[0] - scene.camera.params[0], solution->camera.params[1] - scene.camera.params[1];
    chi2 += MahalanobisSquare(error, solution->covariance.matrix);
    focal_squares += error[12] * error[12];
    sigma_squares += solution->covariance.matrix(12, 12);
  }
  // The chi-square has 14 degrees of freedom per seed; the tolerance is four sigma of the sum, plus 2 % for the
  // estimated noise.
  const double dof = 14.0 * kSeeds;
  EXPECT_NEAR(chi2, dof, 4 * std::sqrt(2 * dof) + 0.02 * dof);
  if (is_weak) {
    EXPECT_GT(std::sqrt(sigma_squares / kSeeds), 1.5);
  } else {
    EXPECT_LT(std::sqrt(focal_squares / kSeeds), 1.5);
  }
}

INSTANTIATE_TEST_SUITE_P(, CameraPriorTest, testing::Bool(),
                         [](const auto& test) { return test.param ? "weak_captures" : "informative_captures"; });

TEST(IntrinsicsSeedTest, EstimatesTheCameraFromViewsAlone) {
  for (const std::string& model : CameraModelNames()) {
    TestSceneOptions options;
    options.camera = TestCamera(model);
    options.noise_px = 0.05;
    options.num_captures = 20;
    const TestScene scene = MakeTestScene(51, options);
    const Outcome<Camera> camera = EstimateIntrinsics(scene.views, model, 1600, 1200);
    ASSERT_TRUE(camera.ok()) << model << ": " << camera.reason();
    // Noise of 0.05 px causes errors of about 1 px in the focal length and 2 px in the principal point.
    EXPECT_NEAR(AxialFocalLength(*camera, 0), AxialFocalLength(scene.camera, 0), 6) << model;
    EXPECT_NEAR(camera->params[2], scene.camera.params[2], 10) << model;
  }
}

TEST(IntrinsicsSeedTest, ConvergesToTheSameCameraFromAnInitialGuess) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  const TestScene scene = MakeTestScene(53, options);
  Camera start = scene.camera;
  start.params[0] *= 1.01;
  start.params[4] += 0.02;
  const Outcome<Camera> found = EstimateIntrinsics(scene.views, "brown5", 1600, 1200);
  const Outcome<Camera> from_start = EstimateIntrinsics(scene.views, "brown5", 1600, 1200, start);
  ASSERT_TRUE(found.ok() && from_start.ok());
  for (size_t i = 0; i < start.params.size(); ++i) {
    EXPECT_NEAR(from_start->params[i], found->params[i], 1e-4 * std::abs(found->params[i]) + 1e-4) << i;
  }
}

// These views have too few points for distortion: the distortion of the initial guess was estimated from other
// captures and is dropped.
TEST(IntrinsicsSeedTest, DropsTheDistortionOfTheInitialGuess) {
  TestSceneOptions options;
  options.noise_px = 0.02;
  options.num_captures = 10;
  options.points = GridPoints(2, 2, 0.12);
  const TestScene scene = MakeTestScene(54, options);
  const Outcome<Camera> found = EstimateIntrinsics(scene.views, "brown5", 1600, 1200);
  const Outcome<Camera> from_start = EstimateIntrinsics(scene.views, "brown5", 1600, 1200, scene.camera);
  ASSERT_TRUE(found.ok()) << found.reason();
  ASSERT_TRUE(from_start.ok()) << from_start.reason();
  EXPECT_EQ(from_start->params, found->params);
}

TEST(IntrinsicsSeedTest, RefusesTwoViews) {
  const TestScene scene = MakeTestScene(52);
  const Outcome<Camera> camera = EstimateIntrinsics({scene.views[0], scene.views[1]}, "brown5", 1600, 1200);
  ASSERT_FALSE(camera.ok());
  EXPECT_EQ(camera.reason(), "few_captures_of_camera (captures 2)");
}

TEST(CalibrateTest, CalibratesWithoutACameraFile) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.1;
  scene_options.num_captures = 20;
  const TestScene scene = MakeTestScene(61, scene_options);
  PairCalibrationOptions options;
  options.methods = HandEyeMethodNames();
  options.width_px = 1600;
  options.height_px = 1200;
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
  ASSERT_TRUE(calibration.ok()) << calibration.reason();
  ASSERT_TRUE(calibration->refined.ok()) << calibration->refined.reason();
  EXPECT_EQ(calibration->methods.size(), HandEyeMethodNames().size());
  // The tolerance is 4 sigma of the stated covariance in each coordinate.
  const Tangent6 error = LocalCoordinates(scene.hand_eye.camera_mount_from_camera,
                                          calibration->refined->hand_eye.camera_mount_from_camera);
  for (int i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(error[i]), 4 * std::sqrt(calibration->refined->covariance.matrix(i, i))) << i;
  }
}

TEST(CalibrateTest, RejectsSwappedPoints) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.1;
  TestScene scene = MakeTestScene(62, scene_options);
  // Two points are swapped.
  scene.views[4].observations.pixels.col(0).swap(scene.views[4].observations.pixels.col(20));
  PairCalibrationOptions options;
  options.camera = scene.camera;
  // A robust loss rejects only these two points.
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
  ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
  EXPECT_TRUE(calibration->unused.empty());
  for (size_t i = 0; i < calibration->views.size(); ++i) {
    const bool has_swapped = calibration->views[i].name == "view_4";
    EXPECT_EQ(calibration->refined->views[i].rejected_ids, has_swapped ? std::vector<int>({0, 20}) : std::vector<int>())
        << calibration->views[i].name;
  }
  // Without a robust loss all points count, and the capture is rejected.
  options.bundle.loss = LossKind::kNone;
  const Outcome<PairCalibration> without_loss = CalibratePair(scene.views, options);
  ASSERT_TRUE(without_loss.ok()) << without_loss.reason();
  ASSERT_EQ(without_loss->unused.size(), 1U);
  EXPECT_EQ(without_loss->unused[0].name, "view_4");
  EXPECT_THAT(without_loss->unused[0].reason, testing::HasSubstr("misread"));
}

TEST(CrossValidateTest, HoldOutErrorMatchesTheNoiseForAnyNumberOfThreads) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.2;
  const TestScene scene = MakeTestScene(63, scene_options);
  PairCalibrationOptions options;
  options.camera = scene.camera;
  options.methods = {"park", "shah"};
  options.bundle.free_intrinsics = {};
  const Outcome<PairCalibration> full = CalibratePair(scene.views, options);
  ASSERT_TRUE(full.ok()) << full.reason();
  int calls = 0;
  const std::vector<HoldOut> one = CrossValidate(*full, options, 5, 1, [&] { ++calls; });
  const std::vector<HoldOut> two = CrossValidate(*full, options, 5, 2, [] {});
  EXPECT_EQ(calls, 5);
  ASSERT_EQ(one.size(), 4U);  // park, shah, chain and bundle.
  for (size_t i = 0; i < one.size(); ++i) {
    ASSERT_TRUE(one[i].rms_px.has_value()) << one[i].reason.ToString();
    EXPECT_EQ(*one[i].rms_px, *two[i].rms_px);
  }
  // The expected error is sqrt(2) x 0.2 px, with 2 % for the estimate's own error and 4 % (3 sigma) for the noise of
  // 720 points.
  EXPECT_NEAR(*one[3].rms_px, 0.283, 0.02);
  EXPECT_GT(*one[0].rms_px, *one[3].rms_px);
}

}  // namespace
}  // namespace heba
