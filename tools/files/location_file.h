// Writes located targets and pixels as JSON, for other programs.
#pragma once

#include <string>
#include <vector>

#include "tools/run/image_location.h"

namespace heba {

// Returns one JSON document. A figure that does not exist is null.
//
// A single camera has {"schema": "heba/locations/1", "heba", "name", "setup", "camera_mount", "covariance_dof",
// "images": [...]}. `camera_mount` is null for a stationary camera, otherwise an ARM. An image has {"image", "located",
// "reason", "points", "target_points", "rms_px", "poses", "chosen", "command", "commands", "command_reason", "gripper",
// "pixels"}. `gripper` is null or, with a tool or a grasp, {"pose": POSE, "grasp_sigma_mm": [x, y, z]}. `poses` are all
// poses of the target that fit, each {"base_from_target": POSE, "near_deg", "near_mm", "sigma": SIGMAS, "postures":
// POSTURES}; `chosen` is the index of the one that is meant, or null. A pixel has {"pixel": [u, v], "in_base_m": [x, y,
// z], "sigma", "postures"}. `command` is the pose to command in the configuration of the captures, `commands` those in
// all configurations, or null: {"configuration", "reason", "base_from_gripper": POSE, "joints":
// [{"name", "value", "unit"}], "from_target_mm", "from_target_deg", "extrapolated", "sigma"}.
//
// Several cameras have {"schema": "heba/rig_locations/1", "heba", "name", "covariance_dof", "reason", "robots": {NAME:
// ARM}} of the arms that carry one of the cameras, with "targets", with "point": {"in_world_m", "rms_px", "warning",
// "sigma"}, or with "points": [{"camera", "pixel", "in_world_m", "sigma", "postures"}]. `reason` is why there is none
// of them. A target has {"target", "cameras", "located", "reason", "points", "target_points", "pose", "rms_px",
// "chance", "symmetries", "sigma", "poses", "chosen", "reach"}: `chance` is LocatedTarget::p_value; `poses` are all
// poses that fit, each {"pose", "near_deg", "near_mm", "sigma", "sigma_in_world": SIGMAS, "postures"}, and `pose` and
// `sigma` are those of the one that is meant. `sigma` is along and about the axes of the target's frame: {"total":
// {"mm", "deg"}, "calibration", "image", "robot"}. `postures` and `reach`, which has the members of an image's
// commands, are objects by the names of the arms.
//
// ARM: {"stated": POSE, "corrected": POSE or null, "arm", "reason"}: the pose base_from_gripper of the images, the same
// corrected by the estimated errors of the arm, its model, and why it was not corrected. POSE: {"parent", "child",
// "translation_m", "quaternion_xyzw", "matrix"}; the matrix has 4 x 4 numbers, its translation in m. SIGMAS: one sigma
// along (and about) the world's x, y, z, {"total_mm", "calibration_mm", "image_mm", "robot_mm"} of the target's centre,
// of a pixel's position, or of the gripper against the target; for a pose of the target also "total_deg" and so on.
// POSTURES: null without --robot, otherwise {"arm", "reason", "joints": [{"name", "unit"}], "postures": [{"joints":
// [...], "singularity"}]}.
std::string LocationsToJson(const LocationRequest& request, const std::vector<ImageLocation>& locations);

// Returns why the pixels of one point do not show one; empty if they may.
std::string PointWarning(const LocatedPoint& point);

}  // namespace heba
