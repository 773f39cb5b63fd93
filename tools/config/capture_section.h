// The section `captures` of a config: what was seen, and the robot's poses for it.
#pragma once

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config.h"

namespace heba {

// From the keys of `captures`: pose_format, robot, joint_angles, units, poses_are.
PoseReading ReadPoseReading(MapReader& captures);
Rigid3d BaseFromGripper(const PoseReading& reading, const Rigid3d& pose);

// Fills in what RunConfig has of the captures, from pictures (images), another project's data set (data, format), or
// what was found in pictures before (detections, as in a run's folder, or target_poses: poses in the camera, in the
// form `ros`). The section as used.
YAML::Node ReadCaptures(const ConfigValue& captures, RunConfig* config);

}  // namespace heba
