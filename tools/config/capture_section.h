// Reads the section `captures` of a config: the measurements and the robot's poses.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/io/pose_records.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads the keys pose_format, robot, base_link, tip_link, joint_angles, units and poses_are of `captures`.
PoseReading ReadPoseReading(MapReader& captures);
// Reads `joint_angle` of `captures`: whether recorded joints are in degrees.
bool ReadJointsAreDeg(MapReader& captures);

// Returns the section with the poses of an arm in the config next to the result of a run: `captures`, or robots.NAME of
// an arm with this name. Returns nothing if there is none.
std::optional<ConfigValue> FindPoseSection(const std::filesystem::path& run, const std::string& arm);

// A file or folder of poses, and where in it they are.
struct PoseSource {
  std::filesystem::path path;
  RecordPaths paths;
  // The mapping that names them, which the caller finishes after its own keys; nothing if the key is a path.
  std::optional<MapReader> mapping;
};
// Reads a key of poses: a path, or {file: PATH, pose: records[].pose, image: records[].image}.
PoseSource ReadPoseSource(MapReader& reader, const std::string& key);

// Returns the places of captures in the order of their times; in their own order unless every capture has a time.
std::vector<size_t> OrderOfTimes(const std::vector<std::optional<double>>& times_s);

// The section of a config of one camera and one arm. Members that a Dataset or a RunConfig also has are theirs.
struct CaptureSection {
  std::vector<Recording> captures;
  std::vector<TargetDetection> given_detections;
  std::vector<Rigid3d> target_poses;
  std::optional<PoseStream> stream;
  std::vector<LeftOutImages> left_out;
  PosesFileOfArm arm;
  std::vector<std::filesystem::path> data_files;  // The first is that of the measurements, unless they are images.
  size_t num_images = 0;
  std::vector<std::string> images_without_pose;
  std::vector<std::string> poses_without_image;
  std::optional<ImportedSet> imported;
  std::string detections_source = Dataset().detections_source;
  std::filesystem::path joints_file;  // The recorded joints; empty if there are none.
  // Whether the ids of given detections are places in the list of the target's points.
  bool are_points_in_order = false;
  YAML::Node used;  // The section as used.
};
// Reads the captures of a config of one camera and one arm from images (`images`), another project's data set
// (`data`, `format`), or earlier measurements (`detections`, as in a run's folder, or `target_poses`: poses of the
// target in the camera, in the form `ros` or another that they state).
CaptureSection ReadCaptures(const ConfigValue& captures);

}  // namespace heba
