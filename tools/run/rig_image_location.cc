#include "tools/run/rig_image_location.h"

#include "heba/base/error.h"
#include "heba/data/target_shape.h"
#include "heba/detection.h"

namespace heba {

std::vector<RigTargetLocation> LocateTargetsInRig(const RigResult& result,
                                                  const std::vector<std::shared_ptr<const Target>>& targets,
                                                  const std::vector<RigSighting>& sightings,
                                                  const std::vector<Rigid3d>& base_from_gripper) {
  constexpr size_t kFewestPoints = 4;
  std::vector<RigTargetLocation> locations;
  for (size_t t = 0; t < targets.size(); ++t) {
    std::vector<CameraObservations> seen;
    RigTargetLocation location;
    location.target = t;
    for (const RigSighting& sighting : sightings) {
      if (sighting.target != t || sighting.detection.ids.size() < kFewestPoints) continue;
      seen.push_back(
          {sighting.camera, ApplyShape(ObservationsOf(*targets[t], sighting.detection), result.solution.shapes[t])});
      location.cameras.push_back(sighting.camera);
    }
    if (seen.empty()) continue;
    location.located = LocateInRig(result.rig, result.solution, seen, base_from_gripper);
    locations.push_back(std::move(location));
  }
  return locations;
}

std::vector<Rigid3d> PosesForCameras(const RigProblem& rig, const std::vector<size_t>& cameras,
                                     const std::vector<std::optional<Rigid3d>>& base_from_gripper,
                                     const std::string& what) {
  std::vector<Rigid3d> poses;
  for (const std::optional<Rigid3d>& pose : base_from_gripper) poses.push_back(pose.value_or(Rigid3d()));
  for (const size_t camera : cameras) {
    const Mount& mount = rig.cameras[camera].mount;
    if (mount.part == Mount::Part::kBase || base_from_gripper[mount.robot]) continue;
    throw InputError(what + ": camera " + rig.cameras[camera].name + " is carried by the arm " +
                     rig.robots[mount.robot] + ", whose pose is needed");
  }
  return poses;
}

}  // namespace heba
