// Reads the section `captures` of a config: the measurements and the robot's poses.
#pragma once

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config.h"

namespace heba {

// Reads the keys pose_format, robot, base_link, tip_link, joint_angles, units and poses_are of `captures`.
PoseReading ReadPoseReading(MapReader& captures);
Rigid3d BaseFromGripper(const PoseReading& reading, const Rigid3d& pose);

// Fills in the captures of a RunConfig from images (`images`), another project's data set (`data`, `format`), or
// earlier measurements (`detections`, as in a run's folder, or `target_poses`: poses of the target in the camera, in
// the form `ros`). Returns the section as used.
YAML::Node ReadCaptures(const ConfigValue& captures, RunConfig* config);

}  // namespace heba
