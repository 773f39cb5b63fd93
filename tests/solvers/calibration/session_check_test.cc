#include "heba/session_check.h"

#include <cstdio>
#include <random>

#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/bundle_adjustment.h"
#include "heba/data/hand_eye.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr size_t kNumCalibrated = 15;

// A calibration from the first captures of a scene, and a later session from the others.
struct TwoSessions {
  Setup setup = Setup::kEyeToHand;
  HandEye truth;
  PairSolution solution;
  std::vector<View> later;
};

TwoSessions MakeSessions(uint64_t seed, Setup setup, int num_later) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = static_cast<int>(kNumCalibrated) + num_later;
  options.points = GridPoints(5, 4, 0.04);
  options.noise_px = 0.1;
  options.robot_translation_m = 2e-4;
  options.robot_rotation_rad = 3e-4;
  const TestScene scene = MakeTestScene(seed, options);
  BundleOptions bundle;
  bundle.loss = LossKind::kNone;
  bundle.free_intrinsics = {};
  bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  const std::vector<View> first(scene.views.begin(), scene.views.begin() + kNumCalibrated);
  const Outcome<PairSolution> solution =
      RefineHandEye({scene.camera, first, setup, DesignedShape(options.points)}, scene.hand_eye, bundle);
  EXPECT_TRUE(solution.ok()) << solution.reason();
  TwoSessions sessions{setup, scene.hand_eye, *solution, {}};
  sessions.later.assign(scene.views.begin() + kNumCalibrated, scene.views.end());
  sessions.solution.views.clear();
  return sessions;
}

// Moves the camera in its mount, or the target, before the later session: its images are those of the robot poses at
// which they look the same.
void MoveCamera(const Tangent6& step, TwoSessions* sessions) {
  const Rigid3d& x = sessions->truth.camera_mount_from_camera;
  for (View& view : sessions->later) {
    view.camera_mount_from_target_mount = Retract(x, step) * Inverse(x) * view.camera_mount_from_target_mount;
  }
}
void MoveTarget(const Tangent6& step, TwoSessions* sessions) {
  const Rigid3d& z = sessions->truth.target_mount_from_target;
  for (View& view : sessions->later) {
    view.camera_mount_from_target_mount = view.camera_mount_from_target_mount * z * Inverse(Retract(z, step));
  }
}

// Changes the focal length of the camera before the later session.
void Magnify(double factor, TwoSessions* sessions) {
  const Eigen::Vector2d centre(sessions->solution.camera.params[2], sessions->solution.camera.params[3]);
  for (View& view : sessions->later) {
    Points2& pixels = view.observations.pixels;
    pixels = (factor * (pixels.colwise() - centre)).colwise() + centre;
  }
}

Outcome<SessionCheck> Check(const TwoSessions& sessions, bool is_in_place, double wobble_rad = 0) {
  const BundleOptions bundle;  // The lens may have changed, too.
  Problem problem =
      HandEyeProblem({sessions.solution.camera, sessions.later, sessions.setup, sessions.solution.shape}, bundle);
  problem.targets[0].free_shape = {TargetShapeGroup::kScale};
  SessionOptions options;
  options.is_target_in_place = is_in_place;
  options.wobble = {0, wobble_rad, 0};
  return CheckSession(problem, ProblemSolution(sessions.solution), options);
}

// Turns what the gripper carries before the later session, as its mount does by itself.
void Wobble(double sigma_rad, std::mt19937_64* random, TwoSessions* sessions) {
  std::normal_distribution<double> normal(0, sigma_rad);
  Tangent6 step = Tangent6::Zero();
  for (Eigen::Index i = 3; i < 6; ++i) step[i] = normal(*random);
  (sessions->setup == Setup::kEyeInHand ? MoveCamera : MoveTarget)(step, sessions);
}

Tangent6 RandomStep(bool is_rotation, double size, std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  const Eigen::Vector3d direction{normal(*random), normal(*random), normal(*random)};
  Tangent6 step = Tangent6::Zero();
  step.segment<3>(is_rotation ? 3 : 0) = size * direction.normalized();
  return step;
}

TwoSessions Session(int trial, int num_later, double wobble_rad) {
  TwoSessions sessions =
      MakeSessions(static_cast<uint64_t>(trial), trial % 2 == 0 ? Setup::kEyeToHand : Setup::kEyeInHand, num_later);
  std::mt19937_64 random(static_cast<uint64_t>(trial));
  if (wobble_rad > 0) Wobble(wobble_rad, &random, &sessions);
  return sessions;
}

// The share that is found of so many trials differs by less from 0.95 with a chance of 0.99.
double Tolerance(int num_trials) { return 2.6 * std::sqrt(0.95 * 0.05 / num_trials); }

// A session without any change is accepted in 95 %, with one image and with several, wherever the target is, also if
// what the gripper carries wobbles.
void ExpectAccepted(int num_trials, double wobble_rad) {
  for (const auto& [num_later, is_in_place] : {std::pair(1, true), std::pair(6, true), std::pair(6, false)}) {
    int num_accepted = 0;
    for (int trial = 0; trial < num_trials; ++trial) {
      const Outcome<SessionCheck> check = Check(Session(trial, num_later, wobble_rad), is_in_place, wobble_rad);
      ASSERT_TRUE(check.ok()) << check.reason();
      num_accepted += check->has_changed ? 0 : 1;
    }
    std::printf("%d images, target %s, wobble %.2f deg: %d of %d accepted\n", num_later,
                is_in_place ? "in place" : "moved", RadToDeg(wobble_rad), num_accepted, num_trials);
    EXPECT_NEAR(num_accepted / static_cast<double>(num_trials), 0.95, Tolerance(num_trials)) << num_later << " images";
  }
}

TEST(SessionCheckTest, AcceptsWhatHasNotChanged) { ExpectAccepted(20, 0); }

TEST(SessionCheckNightly, AcceptsWhatHasNotChanged) {
  ExpectAccepted(200, 0);
  ExpectAccepted(200, DegToRad(0.03));
}

// Changes of the size that is said to be seen are found in 95 %, on both sides, of position and of orientation.
TEST(SessionCheckNightly, FindsChangesOfTheSizeThatItStates) {
  constexpr int kNumTrials = 60;
  for (const double wobble_rad : {0.0, DegToRad(0.03)}) {
    for (const bool is_rotation : {false, true}) {
      int num_found_camera = 0;
      int num_found_target = 0;
      for (int trial = 0; trial < kNumTrials; ++trial) {
        std::mt19937_64 random(static_cast<uint64_t>(trial));
        const TwoSessions still = Session(trial, 4, wobble_rad);
        const Outcome<SessionCheck> check = Check(still, true, wobble_rad);
        ASSERT_TRUE(check.ok()) << check.reason();
        for (const SessionChange& change : check->changes) {
          if (!IsMoved(change.part)) continue;
          TwoSessions moved = still;
          const Tangent6 step = RandomStep(is_rotation, is_rotation ? *change.seen_rad : *change.seen_m, &random);
          (change.part == ChangedPart::kCamera ? MoveCamera : MoveTarget)(step, &moved);
          const Outcome<SessionCheck> of_moved = Check(moved, true, wobble_rad);
          ASSERT_TRUE(of_moved.ok()) << of_moved.reason();
          (change.part == ChangedPart::kCamera ? num_found_camera : num_found_target) += of_moved->has_changed ? 1 : 0;
        }
      }
      std::printf("wobble %.2f deg, %s: camera %d, target %d of %d found\n", RadToDeg(wobble_rad),
                  is_rotation ? "rotations" : "translations", num_found_camera, num_found_target, kNumTrials);
      for (const int num_found : {num_found_camera, num_found_target}) {
        EXPECT_NEAR(num_found / static_cast<double>(kNumTrials), 0.95, Tolerance(kNumTrials));
      }
    }
  }
}

TEST(SessionCheckTest, NamesWhatHasMoved) {
  for (const heba::Setup setup : {heba::Setup::kEyeToHand, heba::Setup::kEyeInHand}) {
    Tangent6 step = Tangent6::Zero();
    step << 1e-3, -2e-3, 1e-3, 2e-3, 0, -1e-3;
    TwoSessions with_camera = MakeSessions(7, setup, 8);
    MoveCamera(step, &with_camera);
    const Outcome<SessionCheck> of_camera = Check(with_camera, true);
    ASSERT_TRUE(of_camera.ok()) << of_camera.reason();
    EXPECT_TRUE(of_camera->has_changed);
    EXPECT_EQ(of_camera->changes.front().part, ChangedPart::kCamera);
    for (Eigen::Index i = 0; i < 6; ++i) {
      constexpr double kSigmas = 5;
      EXPECT_NEAR(of_camera->changes.front().change[i], step[i],
                  kSigmas * std::sqrt(of_camera->changes.front().covariance(i, i)));
    }
    TwoSessions with_target = MakeSessions(8, setup, 8);
    MoveTarget(step, &with_target);
    const Outcome<SessionCheck> of_target = Check(with_target, true);
    ASSERT_TRUE(of_target.ok()) << of_target.reason();
    EXPECT_EQ(of_target->changes.front().part, ChangedPart::kTarget);
    // A target that may have moved tells nothing.
    const Outcome<SessionCheck> of_moved = Check(with_target, false);
    ASSERT_TRUE(of_moved.ok()) << of_moved.reason();
    EXPECT_FALSE(of_moved->has_changed);
  }
}

// Large changes are not linear: they are fitted, and a target that was mounted anew is found where it is.
TEST(SessionCheckTest, LargeChangesAreFitted) {
  for (const heba::Setup setup : {heba::Setup::kEyeToHand, heba::Setup::kEyeInHand}) {
    Tangent6 step = Tangent6::Zero();
    step << 0.05, -0.02, 0.03, 0.1, -0.05, 0.02;
    TwoSessions with_camera = MakeSessions(11, setup, 8);
    MoveCamera(step, &with_camera);
    const Outcome<SessionCheck> of_camera = Check(with_camera, true);
    ASSERT_TRUE(of_camera.ok()) << of_camera.reason();
    const SessionChange& change = of_camera->changes.front();
    EXPECT_EQ(change.part, ChangedPart::kCamera);
    const Tangent6 expected = LocalCoordinates(Rigid3d(), Retract(Rigid3d(), step));
    for (Eigen::Index i = 0; i < 6; ++i) {
      constexpr double kSigmas = 5;
      EXPECT_NEAR(change.change[i], expected[i], kSigmas * std::sqrt(change.covariance(i, i)));
    }
    TwoSessions with_target = MakeSessions(12, setup, 8);
    step << 0.03, 0.05, 0.01, 0.1, 0.1, 1.2;
    MoveTarget(step, &with_target);
    const Outcome<SessionCheck> of_target = Check(with_target, false);
    ASSERT_TRUE(of_target.ok()) << of_target.reason();
    EXPECT_FALSE(of_target->has_changed);
    EXPECT_GT(of_target->scatter_p_value, 1e-4);
  }
}

// Poses that belong to other images are no change of a part.
TEST(SessionCheckTest, NoChangeExplainsExchangedPoses) {
  TwoSessions sessions = MakeSessions(13, Setup::kEyeToHand, 6);
  std::swap(sessions.later[0].camera_mount_from_target_mount, sessions.later[1].camera_mount_from_target_mount);
  const Outcome<SessionCheck> check = Check(sessions, true);
  ASSERT_TRUE(check.ok()) << check.reason();
  EXPECT_TRUE(check->has_changed);
  EXPECT_LT(check->unexplained_p_value, 1e-6);
  EXPECT_GT(check->unexplained_ratio, 5);
}

TEST(SessionCheckTest, NamesALensThatWasRefocused) {
  TwoSessions sessions = MakeSessions(10, Setup::kEyeInHand, 6);
  Magnify(1.01, &sessions);
  const Outcome<SessionCheck> check = Check(sessions, true);
  ASSERT_TRUE(check.ok()) << check.reason();
  EXPECT_TRUE(check->has_changed);
  EXPECT_EQ(check->changes.front().part, ChangedPart::kLens);
  EXPECT_NEAR(check->changes.front().change[0], 0.01 * sessions.solution.camera.params[0],
              0.1 * 0.01 * sessions.solution.camera.params[0]);
}

// Another target of the same kind, mounted elsewhere, has its points farther apart.
TEST(SessionCheckTest, NamesATargetThatWasExchanged) {
  for (const bool is_in_place : {true, false}) {
    TwoSessions sessions = MakeSessions(14, Setup::kEyeToHand, 6);
    Tangent6 step = Tangent6::Zero();
    step << 2e-3, -1e-3, 0, 0, 0, 0.01;
    MoveTarget(step, &sessions);
    for (View& view : sessions.later) view.observations.points_in_target /= 1.04;
    const Outcome<SessionCheck> check = Check(sessions, is_in_place);
    ASSERT_TRUE(check.ok()) << check.reason();
    EXPECT_TRUE(check->has_changed);
    const SessionChange& likely = check->changes.front();
    EXPECT_EQ(likely.part, ChangedPart::kExchangedTarget);
    ASSERT_EQ(likely.change.size(), 2);
    for (Eigen::Index i = 0; i < 2; ++i) {
      constexpr double kSigmas = 5;
      EXPECT_NEAR(likely.change[i], 0.04, kSigmas * std::sqrt(likely.covariance(i, i)));
    }
    EXPECT_GT(check->unexplained_p_value, 1e-4);
  }
}

TEST(SessionCheckTest, NamesACameraThatWasExchanged) {
  TwoSessions sessions = MakeSessions(15, Setup::kEyeToHand, 6);
  Tangent6 step = Tangent6::Zero();
  step << 2e-3, -1e-3, 1e-3, 5e-3, 0, 2e-3;
  MoveCamera(step, &sessions);
  Magnify(1.03, &sessions);
  const Outcome<SessionCheck> check = Check(sessions, true);
  ASSERT_TRUE(check.ok()) << check.reason();
  EXPECT_TRUE(check->has_changed);
  EXPECT_EQ(check->changes.front().part, ChangedPart::kExchangedCamera);
}

// One image at a wrong pose is named, and is no change of a part.
TEST(SessionCheckTest, NamesTheCaptureThatContradictsTheOthers) {
  for (const bool is_in_place : {true, false}) {
    TwoSessions sessions = MakeSessions(17, Setup::kEyeToHand, 6);
    Tangent6 step = Tangent6::Zero();
    step << 5e-3, -3e-3, 2e-3, 0.01, 0, -0.02;
    Rigid3d& pose = sessions.later[3].camera_mount_from_target_mount;
    pose = Retract(pose, step);
    const Outcome<SessionCheck> check = Check(sessions, is_in_place);
    ASSERT_TRUE(check.ok()) << check.reason();
    EXPECT_TRUE(check->has_changed);
    EXPECT_EQ(check->contradicting, std::optional<size_t>(3));
  }
  TwoSessions moved = MakeSessions(17, Setup::kEyeToHand, 6);
  Tangent6 step = Tangent6::Zero();
  step << 1e-3, -2e-3, 1e-3, 2e-3, 0, -1e-3;
  MoveCamera(step, &moved);
  const Outcome<SessionCheck> check = Check(moved, true);
  ASSERT_TRUE(check.ok()) << check.reason();
  EXPECT_FALSE(check->contradicting.has_value());
}

// A calibration rejects a few points that were misread, and so does a check.
TEST(SessionCheckTest, AFewMisreadPointsAreNoChange) {
  for (const bool is_in_place : {true, false}) {
    TwoSessions sessions = MakeSessions(16, Setup::kEyeInHand, 6);
    const Outcome<SessionCheck> before = Check(sessions, is_in_place);
    sessions.later[2].observations.pixels.col(0) += Eigen::Vector2d(4, -3);
    sessions.later[2].observations.pixels.col(11) += Eigen::Vector2d(-2, 5);
    sessions.later[4].observations.pixels.col(7) += Eigen::Vector2d(30, 0);
    const Outcome<SessionCheck> check = Check(sessions, is_in_place);
    ASSERT_TRUE(before && check);
    EXPECT_EQ(check->has_changed, before->has_changed);
    EXPECT_GT(check->scatter_p_value, 1e-3);
    EXPECT_NEAR(check->scatter_ratio, before->scatter_ratio, 0.1);
  }
}

TEST(SessionCheckTest, FailsWithoutEvidence) {
  TwoSessions sessions = MakeSessions(9, Setup::kEyeToHand, 1);
  // Any pose of the camera explains a single image of a target that was moved.
  EXPECT_EQ(Check(sessions, false).failure().code, "no_part_told");
  sessions.later.front().observations = Observations();
  EXPECT_EQ(Check(sessions, true).failure().code, "no_target");
}

}  // namespace
}  // namespace heba
