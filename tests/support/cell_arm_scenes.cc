#include "tests/support/cell_arm_scenes.h"

#include <memory>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/robot/arm_table.h"
#include "tests/support/scene_rng.h"

namespace heba {

CellScene ReachableCell(uint64_t seed, const CellSceneSetting& setting) {
  Rng rng = SceneRng(seed);
  CellScene scene = OneArmScene();
  const Mount base{0, Mount::Part::kBase};
  const Mount gripper{0, Mount::Part::kGripper};
  AddLeftAndRight(setting, rng, &scene);
  AddCamera("wrist", gripper, Rigid3d{ExpRotation(0.5 * rng.Direction3()), 0.1 * rng.Direction3()}, setting, &scene);
  AddTarget("plate", gripper, Rigid3d{ExpRotation(2 * rng.Direction3()), 0.1 * rng.Direction3()}, &scene);
  // The front of a target is on the side of its negative z axis.
  AddTarget("floor", base, Rigid3d(ExpRotation({kPi, 0, 0}), {0.6, -0.3, 0.1}), &scene);
  return scene;
}

CellArmScene WithArms(CellScene rig, const CellSceneSetting& setting, const ArmErrorSigmas& sigmas, uint64_t seed) {
  Rng rng = SceneRng(seed);
  CellArmScene scene{std::move(rig), {}, {}};
  for (size_t r = 0; r < scene.rig.problem.robots.size(); ++r) {
    const Arm nominal = *FindArm("ur10e");
    const Rigid3d tip_from_gripper{ExpRotation(rng.Direction3()), 0.05 * rng.Direction3()};
    scene.arms.push_back(SimulatedArm{nominal, DrawArmErrors(nominal, sigmas, rng), tip_from_gripper, true, 0});
  }
  const SceneOptions options = OptionsOf(setting, scene.arms.size());
  const Outcome<ArmMotion> motion =
      SimulateArmMotion(scene.rig.problem, scene.rig.truth, scene.rig.targets, options, scene.arms, rng);
  CHECK(motion.ok()) << motion.reason();
  scene.joints = motion->joints;
  scene.rig.arms = motion->exact;
  scene.rig.problem.captures =
      SimulateCaptures(scene.rig.problem, scene.rig.truth, scene.rig.targets, *motion, options, rng);
  return scene;
}

std::vector<ArmErrorModels> ErrorsOf(const CellArmScene& scene) {
  std::vector<ArmErrorModels> all;
  for (size_t r = 0; r < scene.arms.size(); ++r) {
    ArmErrorModels& errors = all.emplace_back();
    const SimulatedArm& arm = *scene.arms[r];
    for (const ArmErrorModel model : {ArmErrorModel::kOffsets, ArmErrorModel::kGeometry}) {
      errors.models.push_back(std::make_shared<const SharedEffects>(ArmErrors(arm.nominal, model)));
    }
    errors.effects_of_captures.emplace_back();
    for (const std::vector<Eigen::VectorXd>& joints : scene.joints) {
      errors.effects_of_captures.back().push_back(MakeArmEffect(arm.nominal, joints[r], arm.tip_from_gripper));
    }
  }
  return all;
}

}  // namespace heba
