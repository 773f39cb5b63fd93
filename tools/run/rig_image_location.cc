#include "tools/run/rig_image_location.h"

#include <algorithm>
#include <utility>

#include "heba/base/error.h"
#include "heba/detection.h"
#include "heba/evaluation/arm_uncertainty.h"

namespace heba {

std::vector<RigTargetLocation> LocateTargetsInRig(const RigResult& result,
                                                  const std::vector<std::shared_ptr<const Target>>& targets,
                                                  const std::vector<RigSighting>& sightings,
                                                  const std::vector<StatedPose>& base_from_gripper,
                                                  const std::vector<std::optional<Rigid3d>>& near) {
  constexpr size_t kFewestPoints = 4;
  std::vector<RigTargetLocation> locations;
  for (size_t t = 0; t < targets.size(); ++t) {
    std::vector<CameraObservations> seen;
    RigTargetLocation location;
    location.target = t;
    for (const RigSighting& sighting : sightings) {
      if (sighting.target != t || sighting.detection.ids.size() < kFewestPoints) continue;
      seen.push_back({sighting.camera, ObservationsOf(*targets[t], sighting.detection)});
      location.cameras.push_back(sighting.camera);
    }
    if (seen.empty()) continue;
    location.contradiction = FindContradiction(result.rig, result.solution, t, seen, base_from_gripper);
    if (!location.contradiction) {
      Outcome<std::vector<LocatedTarget>> located =
          LocateTargetInRig(result.rig, result.solution, t, seen, base_from_gripper);
      if (located) {
        location.possible = std::move(*located);
      } else {
        location.undetermined = located.reason();
      }
    }
    std::vector<Rigid3d> poses;
    for (const LocatedTarget& possible : location.possible) poses.push_back(possible.world_from_target);
    const std::optional<Rigid3d> rough = near.empty() ? std::nullopt : near[t];
    if (rough && !poses.empty()) location.near = CompareToRough(poses, *rough);
    location.chosen = ChoosePose(poses, rough);
    locations.push_back(std::move(location));
  }
  return locations;
}

std::vector<RigArmPose> PosesForCameras(const RigResult& result, const std::vector<size_t>& cameras,
                                        const std::vector<GivenArmPose>& given, const std::string& pose_name,
                                        const std::string& joints_name) {
  const RigProblem& rig = result.rig;
  std::vector<RigArmPose> arms;
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const auto carrier = std::find_if(cameras.begin(), cameras.end(), [&](size_t camera) {
      return rig.cameras[camera].mount == Mount{r, Mount::Part::kGripper};
    });
    RigArmPose& arm = arms.emplace_back();
    arm.carries_camera = carrier != cameras.end();
    if (arm.carries_camera && !given[r].base_from_gripper) {
      throw InputError(pose_name + ": camera " + rig.cameras[*carrier].name + " is carried by the arm " +
                       rig.robots[r] + ", whose pose is needed");
    }
    if (!arm.carries_camera && (given[r].base_from_gripper || given[r].joints)) {
      const bool is_pose = given[r].base_from_gripper.has_value();
      throw InputError((is_pose ? pose_name : joints_name) + ": the arm " + rig.robots[r] +
                       " carries none of the cameras; leave its " + (is_pose ? "pose" : "joints") + " out");
    }
    if (!arm.carries_camera) continue;
    const Outcome<StatedPose> stated =
        WithErrorsOfArm(FindEstimatedArm(result, r), *given[r].base_from_gripper, given[r].joints);
    if (!stated && given[r].joints) {
      throw InputError(joints_name + ": arm " + rig.robots[r] + ": " + stated.reason());
    }
    arm.stated = stated ? *stated : StatedPose(*given[r].base_from_gripper);
    if (!stated) arm.why_not_corrected = stated.reason();
  }
  return arms;
}

std::vector<StatedPose> StatedPosesOf(const std::vector<RigArmPose>& arms) {
  std::vector<StatedPose> poses;
  for (const RigArmPose& arm : arms) poses.push_back(arm.stated);
  return poses;
}

}  // namespace heba
