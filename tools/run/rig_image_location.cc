#include "tools/run/rig_image_location.h"

#include <algorithm>
#include <utility>

#include "heba/base/error.h"
#include "heba/detection.h"

namespace heba {

std::vector<RigTargetLocation> LocateTargetsInRig(const RigResult& result,
                                                  const std::vector<std::shared_ptr<const Target>>& targets,
                                                  const std::vector<RigSighting>& sightings,
                                                  const std::vector<Rigid3d>& base_from_gripper,
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
      Outcome<std::vector<RigLocation>> located =
          LocateTargetInRig(result.rig, result.solution, t, seen, base_from_gripper);
      if (located) {
        location.possible = std::move(*located);
      } else {
        location.undetermined = located.reason();
      }
    }
    std::vector<Rigid3d> poses;
    for (const RigLocation& possible : location.possible) poses.push_back(possible.world_from_target);
    const std::optional<Rigid3d> rough = near.empty() ? std::nullopt : near[t];
    if (rough && !poses.empty()) location.near = CompareToRough(poses, *rough);
    location.chosen = ChoosePose(poses, rough);
    locations.push_back(std::move(location));
  }
  return locations;
}

std::vector<Rigid3d> PosesForCameras(const RigProblem& rig, const std::vector<size_t>& cameras,
                                     const std::vector<std::optional<Rigid3d>>& base_from_gripper,
                                     const std::string& what) {
  std::vector<Rigid3d> poses;
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const auto carrier = std::find_if(cameras.begin(), cameras.end(), [&](size_t camera) {
      return rig.cameras[camera].mount == Mount{r, Mount::Part::kGripper};
    });
    if (carrier != cameras.end() && !base_from_gripper[r]) {
      throw InputError(what + ": camera " + rig.cameras[*carrier].name + " is carried by the arm " + rig.robots[r] +
                       ", whose pose is needed");
    }
    if (carrier == cameras.end() && base_from_gripper[r]) {
      throw InputError(what + ": the arm " + rig.robots[r] + " carries none of the cameras; leave its pose out");
    }
    poses.push_back(base_from_gripper[r].value_or(Rigid3d()));
  }
  return poses;
}

}  // namespace heba
