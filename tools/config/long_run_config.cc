#include "tools/config/long_run_config.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <set>
#include <tuple>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/data/loss_kind.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_folder.h"
#include "heba/io/pose_source.h"
#include "heba/run.h"
#include "solvers/residuals/loss.h"
#include "tools/config/capture_section.h"
#include "tools/config/common_keys.h"
#include "tools/config/given_detections.h"
#include "tools/config/image_list.h"
#include "tools/config/long_form.h"
#include "tools/config/robot_noise_config.h"
#include "tools/config/robot_section.h"
#include "tools/config/stream_section.h"
#include "tools/config/target_shape_key.h"
#include "tools/run/time_offset.h"
#include "tools/text/arm_keys.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The rows of one arm's poses file, with base_from_gripper for a pose.
struct ArmRows {
  std::string name;
  std::string section;
  fs::path file;
  PoseReading reading;
  std::vector<PoseRow> rows;
  std::optional<RobotArm> robot;            // Its kinematics, if the config names them.
  std::vector<std::vector<double>> joints;  // One list per row; empty if they are not recorded.
  bool joints_are_deg = false;
  std::optional<double> scale_sigma;  // Dataset::robot_scale_sigmas.
  std::optional<PoseStream> stream;   // The poses are those of this stream at the times of the images.
  std::vector<fs::path> data_files;   // All files that these are read from.
};

std::string CaptureName(const PoseRow& row, size_t index) {
  if (!row.image.empty()) return row.image;
  char name[32];
  std::snprintf(name, sizeof(name), "capture_%03zu", index);
  return name;
}

// Returns the arm with its kinematics, which are among the keys of `reader`.
ArmRows WithKinematics(ArmRows arm, MapReader& reader) {
  ArmOfFiles read = ReadRobotArm(reader);
  arm.robot = std::move(read.robot);
  arm.data_files.insert(arm.data_files.end(), read.files.begin(), read.files.end());
  return arm;
}

// Returns the arm with its joints: `joints` with `joint_angle` of `reader`, or those that its poses are. `key` is the
// one that names the arm.
ArmRows WithJoints(ArmRows arm, MapReader& reader, const std::string& key) {
  if (reader.Has("joints")) {
    if (!arm.robot) reader.Get("joints").Fail("needs an arm (" + key + ")");
    const fs::path file = reader.InputPath("joints");
    arm.data_files.push_back(file);
    std::vector<std::string> names;
    for (size_t i = 0; i < arm.rows.size(); ++i) names.push_back(CaptureName(arm.rows[i], i));
    arm.joints_are_deg = ReadJointsAreDeg(reader);
    arm.joints = ReadJoints(arm.robot->arm, file, arm.joints_are_deg, names);
  } else if (reader.Has("joint_angle")) {
    reader.Get("joint_angle").Fail("needs a file of joints (" + arm.section + ".joints)");
  }
  if (arm.robot && arm.joints.empty() && IsOfJoints(arm.reading.format, arm.robot->arm)) {
    for (const PoseRow& row : arm.rows) {
      arm.joints.push_back(JointsOfNumbers(arm.robot->arm, arm.reading.format, row.numbers));
    }
  }
  return arm;
}

// Reads the poses of an arm, a row for each capture.
ArmRows ReadRows(MapReader& reader, const std::string& section, const std::vector<std::string>& cameras) {
  const PoseSource poses = ReadPoseSource(reader, "poses");
  if (poses.mapping) {
    poses.mapping->Finish();
    reader.Record("poses", poses.mapping->used());
  }
  ArmRows arm;
  arm.section = section;
  arm.file = poses.path;
  arm.reading = ReadPoseReading(reader);
  arm.rows = ReadPoses(arm.file, arm.reading.format, cameras, poses.paths);
  for (PoseRow& row : arm.rows) row.pose = BaseFromGripper(arm.reading, row.pose);
  std::error_code error;
  arm.data_files = fs::is_directory(arm.file, error) ? PoseFilesOf(arm.file) : std::vector<fs::path>{arm.file};
  return arm;
}

// Takes the poses of the only arm from a stream, at the times of the images.
ArmRows ReadRowsOfStream(MapReader& reader, const std::string& section, const std::vector<std::string>& cameras) {
  if (!reader.Has("poses")) {
    reader.Get("stream").Fail("list the times of all images in a table with the columns image and time (poses)");
  }
  ArmRows arm;
  arm.section = section;
  arm.file = reader.InputPath("stream");
  const fs::path times = reader.InputPath("poses");
  arm.data_files = {arm.file, times};
  arm.stream = ReadStream(arm.file, ReadPoseReading(reader));
  arm.rows = RowsAtTimes(*arm.stream, arm.file, ReadTimes(times, cameras));
  arm.reading.format = *FindPoseFormat("ros");
  return arm;
}

// Reads the poses and the joints of the only arm, in `captures`, and its kinematics, in the section `robot` of `root`.
ArmRows ReadOnlyArm(MapReader& captures, const std::vector<std::string>& cameras, MapReader& root) {
  ArmRows arm = captures.Has("stream") ? ReadRowsOfStream(captures, "captures", cameras)
                                       : ReadRows(captures, "captures", cameras);
  arm.name = kOnlyArm;
  if (root.Has("robot")) {
    MapReader robot(root.Get("robot"));
    arm.scale_sigma = ReadRobotScale(robot);
    if (!NamesNoArm(robot.value())) arm = WithKinematics(std::move(arm), robot);
    robot.Finish();
    root.Record("robot", robot.used());
  } else if (captures.Has("model")) {
    captures.Get("model").Fail("the kinematics of the only arm are in a section of their own: robot.model");
  }
  return WithJoints(std::move(arm), captures, "robot.model");
}

// Reads the poses, the joints and the kinematics of one of several arms.
ArmRows ReadNamedArm(MapReader& reader, const std::string& name, const std::vector<std::string>& cameras) {
  if (reader.Has("stream")) {
    reader.Get("stream").Fail("a stream of poses is for configs of one arm (captures.stream)");
  }
  ArmRows arm = ReadRows(reader, "robots." + name, cameras);
  arm.name = name;
  arm.scale_sigma = ReadRobotScale(reader);
  if (reader.Has("model")) arm = WithKinematics(std::move(arm), reader);
  return WithJoints(std::move(arm), reader, "robots." + name + ".model");
}

// The images of one camera.
struct CameraImages {
  ConfigValue value;
  std::vector<fs::path> images;
};

// The image of a camera for each row, empty if there is none, and the images that belong to no row.
struct PairedImages {
  std::vector<fs::path> of_rows;
  std::vector<LeftOutImages> left_out = {};
};
PairedImages PairImages(const ArmRows& arm, const CameraImages& camera, size_t camera_index, const std::string& name,
                        size_t num_cameras) {
  std::map<std::string, fs::path> image_of;
  for (const fs::path& image : camera.images) {
    if (!image_of.emplace(image.filename().string(), image).second) {
      camera.value.Fail("two images are named " + image.filename().string() +
                        "; images are found by file name, so names must differ");
    }
  }
  const bool has_columns = !arm.rows.front().images.empty();
  if (!has_columns && arm.rows.front().image.empty()) {
    if (camera.images.size() != arm.rows.size()) {
      camera.value.Fail(
          "has " + std::to_string(camera.images.size()) + " images for the " + std::to_string(arm.rows.size()) +
          " rows of " + arm.file.string() +
          ", which do not name their images; the counts must agree, or name them (columns image or image." + name +
          ")");
    }
    return {camera.images};
  }
  PairedImages paired{std::vector<fs::path>(arm.rows.size())};
  std::set<std::string> used;
  for (size_t i = 0; i < arm.rows.size(); ++i) {
    const std::string& wanted = has_columns ? arm.rows[i].images[camera_index] : arm.rows[i].image;
    const auto found = image_of.find(wanted);
    if (found != image_of.end()) {
      paired.of_rows[i] = found->second;
      used.insert(wanted);
    } else if (has_columns && !wanted.empty()) {
      throw InputError(arm.file.string() + ":" + std::to_string(arm.rows[i].line) + ": column 'image." + name +
                       "': there is no image " + wanted + " among those of camera " + name);
    }
  }
  if (used.empty()) camera.value.Fail("none of the images is named in " + arm.file.string());
  for (const auto& [file_name, path] : image_of) {
    if (used.contains(file_name)) continue;
    LeftOutImages& entry = paired.left_out.emplace_back();
    entry.name = name + "/" + file_name;
    entry.reason = arm.stream
                       ? "it is not in the table of times, or the stream of the robot's poses does not reach its time"
                       : "the robot's pose is not in the poses file";
    entry.images.resize(num_cameras);
    entry.images[camera_index] = path;
  }
  return paired;
}

// Names the captures by the images that belong to them, as people know them: by the name of the file if that is the
// same for all cameras, and with the camera otherwise.
std::vector<std::string> CaptureNames(const ArmRows& first, const std::vector<std::string>& cameras,
                                      const std::vector<std::vector<fs::path>>& images_of_cameras) {
  std::vector<std::string> names;
  std::set<std::string> known;
  for (size_t i = 0; i < first.rows.size(); ++i) {
    std::set<std::string> files;
    std::string with_camera;
    for (size_t c = 0; c < cameras.size(); ++c) {
      const fs::path& image = images_of_cameras[c][i];
      if (image.empty()) continue;
      files.insert(image.filename());
      if (with_camera.empty()) with_camera = cameras[c] + "/" + image.filename().string();
    }
    std::string name = files.size() == 1 ? *files.begin() : with_camera;
    if (!first.rows[i].image.empty() || name.empty() || known.contains(name)) name = CaptureName(first.rows[i], i);
    known.insert(name);
    names.push_back(std::move(name));
  }
  return names;
}

// Returns where a row is.
std::string RowName(const fs::path& file, const PoseRow& row) {
  return row.line > 0 ? file.string() + ":" + std::to_string(row.line) : (file / row.image).string();
}

// A key identifies a row of poses: rows of two arms belong together if they have the same text at one position, and
// different texts at none. An empty text identifies nothing.
using RowKeys = std::vector<std::string>;

// Returns what identifies each row of `other`, and each capture, a row of `first` with `files`, the images of each
// camera: the column `image` if both files have it, the images of the cameras if `other` names them, or the order.
std::pair<std::vector<RowKeys>, std::vector<RowKeys>> KeysOf(const ArmRows& first, const ArmRows& other,
                                                             const std::vector<std::vector<fs::path>>& files) {
  const bool has_columns = !other.rows.front().images.empty();
  const bool is_by_name = !first.rows.front().image.empty() && !other.rows.front().image.empty();
  const bool is_by_order = !has_columns && other.rows.front().image.empty();
  if (is_by_order && first.rows.size() != other.rows.size()) {
    throw InputError(other.file.string() + ": has " + std::to_string(other.rows.size()) + " rows, but " +
                     first.file.string() + " has " + std::to_string(first.rows.size()) +
                     "; rows without a column image belong together by order");
  }
  std::vector<RowKeys> of_captures;
  for (size_t i = 0; i < first.rows.size(); ++i) {
    RowKeys& keys = of_captures.emplace_back();
    keys.push_back(is_by_order ? std::to_string(i) : is_by_name ? first.rows[i].image : "");
    for (const std::vector<fs::path>& of_camera : files) keys.push_back(of_camera[i].filename().string());
  }
  std::vector<RowKeys> of_rows;
  for (size_t j = 0; j < other.rows.size(); ++j) {
    const PoseRow& row = other.rows[j];
    RowKeys& keys = of_rows.emplace_back();
    keys.push_back(is_by_order ? std::to_string(j) : is_by_name ? row.image : "");
    for (size_t c = 0; c < files.size(); ++c) {
      keys.push_back(has_columns ? row.images[c] : is_by_name ? "" : row.image);
    }
  }
  return {std::move(of_rows), std::move(of_captures)};
}

// Returns the row of `other` that belongs to each capture; nothing if there is none. `files`: as in KeysOf.
std::vector<std::optional<size_t>> MatchRows(const ArmRows& first, const ArmRows& other,
                                             const std::vector<std::vector<fs::path>>& files) {
  const auto [of_rows, of_captures] = KeysOf(first, other, files);
  std::map<std::pair<size_t, std::string>, size_t> row_of;
  for (size_t j = 0; j < of_rows.size(); ++j) {
    for (size_t k = 0; k < of_rows[j].size(); ++k) {
      if (of_rows[j][k].empty()) continue;
      const auto [known, is_new] = row_of.emplace(std::pair(k, of_rows[j][k]), j);
      if (is_new) continue;
      throw InputError(RowName(other.file, other.rows[j]) + ": names the image " + of_rows[j][k] + " again, after " +
                       RowName(other.file, other.rows[known->second]));
    }
  }
  std::vector<std::optional<size_t>> places;
  for (size_t i = 0; i < of_captures.size(); ++i) {
    const RowKeys& keys = of_captures[i];
    std::optional<size_t>& place = places.emplace_back();
    for (size_t k = 0; k < keys.size() && !place; ++k) {
      const auto found = row_of.find({k, keys[k]});
      if (found != row_of.end()) place = found->second;
    }
    for (size_t k = 0; k < keys.size() && place; ++k) {
      const std::string& named = of_rows[*place][k];
      if (keys[k].empty() || named.empty() || keys[k] == named) continue;
      throw InputError(RowName(other.file, other.rows[*place]) + ": names the image " + named +
                       ", but the capture of " + RowName(first.file, first.rows[i]) + " has " + keys[k]);
    }
  }
  return places;
}

// Reads the arms: `robots`, or the short form in `captures`.
std::vector<ArmRows> ReadArms(MapReader& root, const std::vector<std::string>& cameras) {
  std::vector<ArmRows> arms;
  if (!root.Has("robots")) {
    MapReader captures(root.Get("captures"));
    arms.push_back(ReadOnlyArm(captures, cameras, root));
    captures.Find("exclude");
    if (captures.Has("detections")) captures.InputPath("detections");
    captures.Finish();
    root.Record("captures", captures.used());
    return arms;
  }
  MapReader section(root.Get("robots"));
  for (const std::string& name : NamesIn(section, "left")) {
    MapReader reader(section.Get(name));
    arms.push_back(ReadNamedArm(reader, name, cameras));
    reader.Finish();
    section.Record(name, reader.used());
  }
  section.Finish();
  root.Record("robots", section.used());
  return arms;
}

// Reads the images of a camera, or takes those in which `given` were detected before.
CameraImages ReadImages(MapReader& reader, const std::string& camera, const std::vector<GivenDetections>& given) {
  if (given.empty()) {
    const ConfigValue value = reader.Get("images");
    CameraImages images{value, FindImages(value)};
    reader.Record("images", ImagesNode(value, images.images));
    return images;
  }
  if (reader.Has("images")) reader.Get("images").Fail("leave it out: captures.detections has the points of all images");
  CameraImages images{reader.value(), ImagesOf(camera, given)};
  if (images.images.empty()) reader.value().Fail("captures.detections has no file " + camera + ".TARGET.json");
  return images;
}

// The section `cameras`.
struct CameraSection {
  std::vector<ProblemCamera> cameras;
  std::vector<bool> has_camera;      // Dataset::has_camera.
  std::vector<std::string> sources;  // Dataset::camera_sources.
  std::vector<CameraImages> images;
};

CameraSection ReadCameras(MapReader& root, const std::vector<GivenDetections>& given,
                          const std::vector<std::string>& robots) {
  CameraSection cameras;
  MapReader refine_all = root.Section("refine");
  const std::vector<ParameterGroup> free = ReadFreeIntrinsics(refine_all, BundleOptions().free_intrinsics);
  const std::string prior_of_all = refine_all.Choice("intrinsics_prior", {"none", "file"}, "");
  bool has_sigmas = false;
  MapReader section(root.Get("cameras"));
  for (const std::string& name : CameraNamesIn(section)) {
    MapReader reader(section.Get(name));
    ProblemCamera camera;
    camera.name = name;
    std::tie(camera.mount, camera.mount_name) = ReadMount(reader, robots);
    cameras.images.push_back(ReadImages(reader, name, given));
    CameraKeys keys = ReadCameraKeys(reader);
    cameras.has_camera.push_back(keys.camera.has_value());
    cameras.sources.push_back(keys.camera ? keys.source : name);
    camera.camera = keys.camera ? *keys.camera : Camera{keys.model, 0, 0, {}};
    reader.Record("model", YAML::Node(camera.camera.model.empty() ? "auto" : camera.camera.model));
    MapReader refine = reader.Section("refine");
    camera.free_intrinsics = ReadFreeIntrinsics(refine, free);
    const bool may_have_prior = keys.camera && !camera.free_intrinsics.empty();
    has_sigmas = has_sigmas || (prior_of_all == "file" && may_have_prior && ReadCameraSigmas(keys.source));
    camera.prior = ReadIntrinsicsPrior(refine, keys, camera.free_intrinsics, "cameras." + name + ".intrinsics",
                                       prior_of_all == "none");
    refine.Finish();
    reader.Record("refine", refine.used());
    reader.Finish();
    section.Record(name, reader.used());
    cameras.cameras.push_back(std::move(camera));
  }
  section.Finish();
  root.Record("cameras", section.used());
  if (prior_of_all == "file" && !has_sigmas) {
    refine_all.Get("intrinsics_prior")
        .Fail("no file of a camera with free intrinsics has sigmas (std), which only heba's own form can have");
  }
  return cameras;
}

// Returns the config with the section `targets`.
RunConfig WithTargets(RunConfig config, MapReader& root) {
  Dataset& data = config.data;
  MapReader section(root.Get("targets"));
  for (const std::string& name : NamesIn(section, "plate")) {
    MapReader reader(section.Get(name));
    ProblemTarget target;
    target.name = name;
    std::tie(target.mount, target.mount_name) = ReadMount(reader, data.rig.robots);
    data.targets.push_back(ReadTarget(reader, "target"));
    config.targets_used.push_back(YAML::Dump(reader.used()["target"]));
    config.has_target_keys.push_back(HoldsTargetKeys(reader, "target"));
    reader.Finish();
    section.Record(name, reader.used());
    data.rig.targets.push_back(std::move(target));
  }
  section.Finish();
  root.Record("targets", section.used());
  const std::string faults = WhyNotToldApart(data);
  if (!faults.empty()) section.value().Fail(faults);
  return config;
}

// Returns the names of the bodies that `refine.drift` may list. The base of the first arm is the world, in which the
// others move.
std::vector<std::pair<std::string, DriftBody>> BodiesThatDrift(const Problem& rig) {
  std::vector<std::pair<std::string, DriftBody>> bodies;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    bodies.emplace_back(rig.cameras[c].name, DriftBody{DriftBody::Kind::kCamera, c});
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    bodies.emplace_back(rig.targets[t].name, DriftBody{DriftBody::Kind::kTarget, t});
  }
  for (size_t r = 1; r < rig.robots.size(); ++r) {
    bodies.emplace_back(MountText(rig.robots, {r, Mount::Part::kBase}), DriftBody{DriftBody::Kind::kBase, r});
  }
  return bodies;
}

// Returns the config with the section `refine`.
RunConfig WithRefine(RunConfig config, MapReader& root) {
  MapReader reader = root.Section("refine");
  // ReadCameras gives these to the cameras.
  ReadFreeIntrinsics(reader, BundleOptions().free_intrinsics);
  if (reader.Has("intrinsics_prior")) reader.Choice("intrinsics_prior", {"none", "file"});
  config = WithTargetShape(std::move(config), reader);
  Dataset& data = config.data;
  RunOptions& options = config.options;
  std::vector<Arm> arms;
  for (const std::optional<RobotArm>& robot : data.arms) {
    if (robot) arms.push_back(robot->arm);
  }
  options.kinematics = ReadKinematics(reader, arms, root.Has("robots") ? "robots.NAME.model" : "robot.model");
  options = WithRobotErrors(std::move(options), reader, data);
  options.calibration.adjustment.pixel_noise_px = ReadPixelNoise(reader);
  options.calibration.adjustment.loss = *FindLossKind(reader.Choice("loss", LossNames(), "truncated"));
  options.drift = ReadDrift(reader, BodiesThatDrift(data.rig));
  const std::optional<double> time_offset_s = ReadTimeOffset(reader, data.stream.has_value());
  options.estimates_time_offset = !time_offset_s;
  if (time_offset_s) data = WithPosesAt(std::move(data), *time_offset_s);
  reader.Finish();
  root.Record("refine", reader.used());
  return config;
}

// Reads the key `captures.detections`; returns nothing if there is none.
std::optional<fs::path> ReadDetectionsFolder(MapReader& root) {
  if (!root.Has("captures")) return std::nullopt;
  MapReader captures(root.Get("captures"));
  return captures.Has("detections") ? std::optional(captures.InputPath("detections")) : std::nullopt;
}

// Returns the names of the captures that are to be left out, of `captures.exclude`.
std::set<std::string> ReadExcluded(MapReader& root, const std::vector<std::string>& names) {
  std::set<std::string> excluded;
  if (!root.Has("captures")) return excluded;
  MapReader captures(root.Get("captures"));
  const std::optional<ConfigValue> list = captures.Find("exclude");
  if (captures.Has("detections")) captures.InputPath("detections");
  if (root.Has("robots")) {
    captures.Finish();
    root.Record("captures", captures.used());
  }
  if (!list) return excluded;
  for (const ConfigValue& item : list->AsList()) {
    const std::string name = item.AsText();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      item.Fail("there is no capture " + Quoted(name) + DidYouMean(name, names));
    }
    excluded.insert(name);
  }
  YAML::Node used = YAML::Clone(root.used()["captures"]);
  used["exclude"] = list->node();
  root.Record("captures", used);
  return excluded;
}

// Refuses keys of configs of one camera and one target, and the key that `robots` replaces.
void RefuseKeysOfOnePair(MapReader& reader) {
  if (reader.Has("robots") && reader.Has("robot")) {
    reader.Get("robot").Fail("with 'robots', the keys of an arm are beside its poses: robots.NAME.model");
  }
  for (const char* key : {"target", "camera", "setup"}) {
    if (reader.Has(key)) {
      reader.Get(key).Fail(
          "belongs to configs of one camera and one target; a rig has 'cameras' and 'targets' with "
          "mounts");
    }
  }
}

// Returns a capture with its images, without the arms.
Recording ImagesOfCapture(const std::string& name, const std::vector<std::vector<fs::path>>& images_of_cameras,
                          size_t index) {
  Recording capture{name, {}, {}};
  for (const std::vector<fs::path>& of_camera : images_of_cameras) capture.images.push_back(of_camera[index]);
  return capture;
}

// Returns the reason why a capture is left out; an empty text if it is not.
std::string WhyLeftOut(const Recording& capture, const std::set<std::string>& excluded) {
  if (excluded.contains(capture.name)) return std::string(kExcludedReason);
  const bool has_none =
      std::all_of(capture.images.begin(), capture.images.end(), [](const fs::path& image) { return image.empty(); });
  return has_none ? "no camera has an image of it" : "";
}

// For each arm the row of each capture; nothing if there is none.
using RowsOfArms = std::vector<std::vector<std::optional<size_t>>>;

// Returns the row of each arm that belongs to a capture, which must have one of every arm.
std::vector<size_t> RowsOfCapture(const std::vector<ArmRows>& arms, const RowsOfArms& rows_of_arms, size_t index,
                                  const std::string& name) {
  std::vector<size_t> rows;
  for (size_t r = 0; r < arms.size(); ++r) {
    if (!rows_of_arms[r][index]) {
      throw InputError(arms[r].file.string() + ": has no row for the capture " + name + " of " +
                       arms.front().file.string());
    }
    rows.push_back(*rows_of_arms[r][index]);
  }
  return rows;
}

// Returns the rows of the arms but the first that belong to no capture.
std::vector<LeftOutImages> RowsWithoutCapture(const std::vector<ArmRows>& arms, const RowsOfArms& rows_of_arms) {
  std::vector<LeftOutImages> left_out;
  for (size_t r = 1; r < arms.size(); ++r) {
    for (size_t j = 0; j < arms[r].rows.size(); ++j) {
      const auto& places = rows_of_arms[r];
      if (std::find(places.begin(), places.end(), std::optional(j)) != places.end()) continue;
      left_out.push_back({RowName(arms[r].file.filename(), arms[r].rows[j]),
                          "the pose belongs to no capture of " + arms.front().file.filename().string(),
                          "",
                          {}});
    }
  }
  return left_out;
}

// Returns the items of a list in this order.
template <class T>
std::vector<T> Ordered(const std::vector<T>& list, const std::vector<size_t>& order) {
  std::vector<T> ordered;
  for (const size_t i : order) ordered.push_back(list[i]);
  return ordered;
}

// Returns the config with its captures in the order of their times, if all have one.
RunConfig OrderedByTime(RunConfig config) {
  std::vector<std::optional<double>> times_s;
  for (const Recording& capture : config.data.captures) times_s.push_back(capture.time_s);
  const std::vector<size_t> order = OrderOfTimes(times_s);
  config.data.captures = Ordered(config.data.captures, order);
  for (PosesFileOfArm& arm : config.arms) arm.numbers = Ordered(arm.numbers, order);
  return config;
}

// Returns a config with the arms, but no poses of them.
RunConfig ConfigOf(const std::vector<ArmRows>& arms) {
  RunConfig config;
  for (const ArmRows& arm : arms) {
    config.data.rig.robots.push_back(arm.name);
    config.data.arms.push_back(arm.robot);
    config.data.robot_scale_sigmas.push_back(arm.scale_sigma);
    config.arms.push_back({arm.section, arm.file, arm.reading, {}, arm.joints_are_deg});
    config.data_files.insert(config.data_files.end(), arm.data_files.begin(), arm.data_files.end());
  }
  config.data.stream = arms.front().stream;
  return config;
}

// Returns the config with the captures, which have these images of each camera, in the order of their times.
RunConfig WithCaptures(RunConfig config, MapReader& root, const std::vector<ArmRows>& arms,
                       const std::vector<std::vector<fs::path>>& images_of_cameras) {
  Dataset& data = config.data;
  std::vector<std::string> cameras;
  for (const ProblemCamera& camera : data.rig.cameras) cameras.push_back(camera.name);
  const std::vector<std::string> names = CaptureNames(arms.front(), cameras, images_of_cameras);
  const std::set<std::string> excluded = ReadExcluded(root, names);
  RowsOfArms rows_of_arms;
  for (const ArmRows& arm : arms) rows_of_arms.push_back(MatchRows(arms.front(), arm, images_of_cameras));
  for (size_t i = 0; i < names.size(); ++i) {
    Recording capture = ImagesOfCapture(names[i], images_of_cameras, i);
    if (const std::string reason = WhyLeftOut(capture, excluded); !reason.empty()) {
      data.left_out.push_back({capture.name, reason, capture.name, capture.images});
      continue;
    }
    const std::vector<size_t> rows = RowsOfCapture(arms, rows_of_arms, i, capture.name);
    for (size_t r = 0; r < arms.size(); ++r) {
      const PoseRow& row = arms[r].rows[rows[r]];
      capture.base_from_gripper.push_back(row.pose);
      capture.joints.push_back(arms[r].joints.empty() ? std::vector<double>() : arms[r].joints[rows[r]]);
      config.arms[r].numbers.push_back(row.numbers);
    }
    capture.time_s = arms.front().rows[rows.front()].time_s;
    data.captures.push_back(std::move(capture));
  }
  for (LeftOutImages& entry : RowsWithoutCapture(arms, rows_of_arms)) data.left_out.push_back(std::move(entry));
  return OrderedByTime(std::move(config));
}

}  // namespace

RunConfig ReadLongForm(MapReader& root, const fs::path& file) {
  RefuseKeysOfOnePair(root);
  MapReader cameras_reader(root.Get("cameras"));
  const std::vector<std::string> names = CameraNamesIn(cameras_reader);
  const std::vector<ArmRows> arms = ReadArms(root, names);
  RunConfig config = ConfigOf(arms);
  Dataset& data = config.data;
  std::vector<GivenDetections> given;
  if (const std::optional<fs::path> folder = ReadDetectionsFolder(root)) {
    data.detections_source = folder->string();
    given = ReadGivenDetections(*folder);
  }
  for (const GivenDetections& of_pair : given) config.data_files.push_back(of_pair.file);
  CameraSection cameras = ReadCameras(root, given, data.rig.robots);
  data.rig.cameras = std::move(cameras.cameras);
  data.has_camera = std::move(cameras.has_camera);
  data.camera_sources = std::move(cameras.sources);
  config = WithTargets(std::move(config), root);
  std::vector<std::vector<fs::path>> images_of_cameras;
  for (size_t c = 0; c < names.size(); ++c) {
    PairedImages paired = PairImages(arms.front(), cameras.images[c], c, names[c], names.size());
    images_of_cameras.push_back(std::move(paired.of_rows));
    data.left_out.insert(data.left_out.end(), paired.left_out.begin(), paired.left_out.end());
  }
  config = WithCaptures(std::move(config), root, arms, images_of_cameras);
  if (data.captures.empty()) throw InputError(file.string() + ": no capture is left");
  if (!given.empty()) data.given_detections = DetectionsOfCaptures(data, given);
  return WithRefine(std::move(config), root);
}

}  // namespace heba
