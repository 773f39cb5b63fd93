#include "tests/support/cell_scenes.h"

#include <utility>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "tests/support/scene_rng.h"

namespace heba {

void PoseErrorSums::Add(const Rigid3d& pose, const Rigid3d& truth, const Eigen::Matrix<double, 6, 6>& covariance) {
  const Tangent6 error = LocalCoordinates(pose, truth);
  chi2 += MahalanobisSquare(error, covariance);
  squares_m2 += error.head<3>().squaredNorm();
  ++num_poses;
}

const std::vector<ParameterGroup>& AllIntrinsics() {
  static const std::vector<ParameterGroup> all = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                                  ParameterGroup::kDistortion};
  return all;
}

Rigid3d LookingAt(const Eigen::Vector3d& place, const Eigen::Vector3d& middle, double spin_rad) {
  const Eigen::Quaterniond to_sight = RotationOnto(Eigen::Vector3d::UnitZ(), (middle - place).normalized());
  return {to_sight * ExpRotation({0, 0, spin_rad}), place};
}

void AddCamera(const std::string& name, const Mount& mount, const Rigid3d& mount_from_camera,
               const CellSceneSetting& setting, CellScene* scene) {
  scene->problem.cameras.push_back({name, mount, TestCamera()});
  if (setting.has_free_intrinsics) scene->problem.cameras.back().free_intrinsics = AllIntrinsics();
  scene->truth.mount_from_camera.push_back(mount_from_camera);
}

void AddTarget(const std::string& name, const Mount& mount, const Rigid3d& mount_from_target, CellScene* scene) {
  SimulatedTarget target{GridPoints(8, 6, 0.02), false};
  scene->problem.targets.push_back({name, mount, DesignedShape(target.points_in_target)});
  scene->targets.push_back(std::move(target));
  scene->truth.mount_from_target.push_back(mount_from_target);
}

SceneOptions OptionsOf(const CellSceneSetting& setting, size_t num_arms) {
  SceneOptions options;
  options.motion.num_captures = setting.num_captures;
  options.motion.distance_m = 0.7;
  options.motion.max_tilt_rad = 0.6;
  options.noise_px = setting.noise_px;
  options.robot_noise = setting.robot_noise;
  options.homes.assign(num_arms, Rigid3d(Eigen::Quaterniond::Identity(), {0.4, 0, 0.4}));
  return options;
}

void Simulate(const CellSceneSetting& setting, Rng& rng, CellScene* scene) {
  const SceneOptions options = OptionsOf(setting, scene->problem.robots.size());
  const Outcome<std::vector<ArmPoses>> arms =
      SimulateArmPoses(scene->problem, scene->truth, scene->targets, options, rng);
  CHECK(arms.ok()) << arms.reason();
  scene->arms = *arms;
  scene->problem.captures = SimulateCaptures(scene->problem, scene->truth, scene->targets, *arms, options, rng);
}

namespace {
const Eigen::Vector3d kWorkPlace(0.5, 0, 0.4);
}  // namespace

CellScene OneArmScene() {
  CellScene scene;
  scene.problem.robots = {"arm"};
  scene.truth.world_from_base = {Rigid3d()};
  return scene;
}

void AddLeftAndRight(const CellSceneSetting& setting, Rng& rng, CellScene* scene) {
  const Mount base{0, Mount::Part::kBase};
  AddCamera("left", base, LookingAt({0.5, 0.6, 0.7}, kWorkPlace, rng.Uniform(-1, 1)), setting, scene);
  AddCamera("right", base, LookingAt({0.6, 0.55, 0.55}, kWorkPlace, rng.Uniform(-1, 1)), setting, scene);
}

void AddSmoothErrors(const RobotNoise& sigma, const SmoothLengths& lengths, uint64_t seed, CellScene* scene) {
  Rng rng(seed);
  for (size_t r = 0; r < scene->problem.robots.size(); ++r) {
    std::vector<Rigid3d> poses;
    for (const ProblemCapture& capture : scene->problem.captures) poses.push_back(capture.base_from_gripper[r]);
    const SmoothErrors errors(poses, lengths);
    Eigen::VectorXd effects(errors.effects().size());
    for (Eigen::Index i = 0; i < effects.size(); ++i) {
      const bool is_rotation = errors.effects().effects[static_cast<size_t>(i)].group == 1;
      effects[i] = rng.Normal() * (is_rotation ? sigma.rotation_rad : sigma.translation_m);
    }
    for (size_t i = 0; i < poses.size(); ++i) {
      Rigid3d& reported = scene->problem.captures[i].base_from_gripper[r];
      reported = reported * Inverse(errors.EffectAt(poses[i])->Evaluate(effects, nullptr));
    }
  }
}

CellScene MixedCell(uint64_t seed, const CellSceneSetting& setting) {
  Rng rng = SceneRng(seed);
  CellScene scene = OneArmScene();
  const Mount base{0, Mount::Part::kBase};
  const Mount gripper{0, Mount::Part::kGripper};
  AddLeftAndRight(setting, rng, &scene);
  AddCamera("wrist", gripper, Rigid3d{ExpRotation(rng.Direction3()), 0.1 * rng.Direction3()}, setting, &scene);
  AddTarget("plate", gripper, Rigid3d{ExpRotation(2 * rng.Direction3()), 0.1 * rng.Direction3()}, &scene);
  AddTarget("wall", base, Rigid3d(ExpRotation(rng.Direction3()), {0.8, -0.3, 0.2}), &scene);
  Simulate(setting, rng, &scene);
  return scene;
}

CellScene FourCameraCell(uint64_t seed, const CellSceneSetting& setting) {
  Rng rng = SceneRng(seed);
  CellScene scene = OneArmScene();
  const Mount base{0, Mount::Part::kBase};
  for (int c = 0; c < 4; ++c) {
    const double angle = 0.35 * c;
    const Eigen::Vector3d place = kWorkPlace + 0.7 * Eigen::Vector3d(0.5 * std::sin(angle), std::cos(angle), 0.5);
    AddCamera("camera" + std::to_string(c + 1), base, LookingAt(place, kWorkPlace, rng.Uniform(-1, 1)), setting,
              &scene);
  }
  AddTarget("plate", {0, Mount::Part::kGripper}, Rigid3d{ExpRotation(2 * rng.Direction3()), 0.1 * rng.Direction3()},
            &scene);
  Simulate(setting, rng, &scene);
  return scene;
}

CellScene TwoArmCell(uint64_t seed, const CellSceneSetting& setting) {
  Rng rng = SceneRng(seed);
  CellScene scene;
  scene.problem.robots = {"left", "right"};
  scene.truth.world_from_base = {Rigid3d(), Rigid3d(ExpRotation({0.05, -0.02, 3.0}), {1.1, 0.1, 0.02})};
  AddCamera("top", {0, Mount::Part::kBase}, LookingAt({0.5, 0.1, 1.2}, {0.55, 0, 0.4}, rng.Uniform(-1, 1)), setting,
            &scene);
  for (size_t r = 0; r < 2; ++r) {
    AddTarget(r == 0 ? "plate" : "disk", {r, Mount::Part::kGripper},
              Rigid3d{ExpRotation(2 * rng.Direction3()), 0.1 * rng.Direction3()}, &scene);
  }
  Simulate(setting, rng, &scene);
  return scene;
}

}  // namespace heba
