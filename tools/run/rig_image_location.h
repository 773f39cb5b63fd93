// Locates the targets that images of a rig's cameras, recorded at one pose of the arms, show together.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/rig_evaluation.h"
#include "heba/rig_location.h"
#include "heba/target.h"
#include "tools/run/image_location.h"

namespace heba {

// The detection of one target in the image of one camera.
struct RigSighting {
  size_t camera = 0;
  size_t target = 0;
  Detection detection;
};

struct RigTargetLocation {
  size_t target = 0;
  std::vector<size_t> cameras;          // The cameras that see enough points of it.
  std::vector<LocatedTarget> possible;  // LocateTargetInRig; empty if it is not located.
  std::optional<size_t> chosen;         // The index of the pose that is meant; nothing if none is.
  std::optional<NearPoses> near;        // The distances of the possible poses from the rough one.
  std::optional<RigContradiction> contradiction;
  std::string undetermined;  // Why the points do not determine a pose; empty otherwise.
};

// Returns the location of each target of which a camera sees at least four points. `targets` has those of the result,
// whose symmetries are set, `base_from_gripper` the pose of each arm as it states it, and `near` a rough
// world_from_target of each target or nothing; an empty list stands for none. Images that contradict each other locate
// nothing.
std::vector<RigTargetLocation> LocateTargetsInRig(const RigResult& result,
                                                  const std::vector<std::shared_ptr<const Target>>& targets,
                                                  const std::vector<RigSighting>& sightings,
                                                  const std::vector<StatedPose>& base_from_gripper,
                                                  const std::vector<std::optional<Rigid3d>>& near = {});

// The pose and the joints of an arm at which images were taken, as far as they are given.
struct GivenArmPose {
  std::optional<Rigid3d> base_from_gripper;
  std::optional<Eigen::VectorXd> joints;  // rad or m.
};
// The pose of an arm at which images were taken.
struct RigArmPose {
  bool carries_camera = false;    // Whether it carries one of the cameras.
  StatedPose stated;              // With its errors, if they are estimated and known; the identity if it carries none.
  std::string why_not_corrected;  // If the errors of the arm are estimated, but not those of this pose.
};
// Returns the pose of each arm for images of these cameras. Throws InputError, which begins with `pose_name` or
// `joints_name`, if an arm that carries one of the cameras has no pose, if one that carries none of them has one, or if
// the joints are not those of the arm at its pose.
std::vector<RigArmPose> PosesForCameras(const RigResult& result, const std::vector<size_t>& cameras,
                                        const std::vector<GivenArmPose>& given, const std::string& pose_name,
                                        const std::string& joints_name);
// Returns the stated pose of each arm.
std::vector<StatedPose> StatedPosesOf(const std::vector<RigArmPose>& arms);

}  // namespace heba
