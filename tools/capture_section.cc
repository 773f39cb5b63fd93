#include "tools/capture_section.h"

#include <algorithm>
#include <map>

#include <glob.h>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/pose_file.h"
#include "heba/robot/ur_kinematics.h"
#include "tools/detection_file.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::vector<fs::path> ListFolder(const ConfigValue& value, const fs::path& folder) {
  std::vector<fs::path> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && HasImageSuffix(entry.path())) images.push_back(entry.path());
  }
  if (images.empty()) value.Fail("the folder " + folder.string() + " holds no pictures");
  return images;
}

std::vector<fs::path> ExpandGlob(const ConfigValue& value, const fs::path& pattern) {
  glob_t found;
  std::vector<fs::path> images;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) images.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  if (images.empty()) value.Fail("no file matches " + pattern.string());
  return images;
}

// A folder, a glob or a list, sorted by name unless it is a list.
std::vector<fs::path> FindImages(const ConfigValue& value) {
  std::vector<fs::path> images;
  if (value.IsList()) {
    for (const ConfigValue& item : value.AsList()) {
      const fs::path path = item.AsPath();
      if (!fs::is_regular_file(path)) item.Fail("there is no picture " + path.string());
      images.push_back(path);
    }
    if (images.empty()) value.Fail("the list is empty; pictures are needed");
    return images;
  }
  const fs::path path = value.AsPath();
  if (fs::is_directory(path)) {
    images = ListFolder(value, path);
  } else if (path.string().find_first_of("*?[") != std::string::npos) {
    images = ExpandGlob(value, path);
  } else {
    value.Fail("there is no folder " + path.string() + "; a folder, a glob such as images/*.png, or a list is needed");
  }
  std::sort(images.begin(), images.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return images;
}

// What there is of one capture but for the robot's pose.
struct Seen {
  std::string name;
  fs::path image;  // Empty: there is no picture.
  std::optional<Rigid3d> camera_from_target;
  std::optional<CaptureDetection> detection;
};

std::vector<Seen> SeenInPictures(const ConfigValue& value, MapReader* reader) {
  const std::vector<fs::path> images = FindImages(value);
  if (value.IsList()) {
    YAML::Node list;
    for (const fs::path& image : images) list.push_back(fs::absolute(image).lexically_normal().string());
    reader->Record("images", list);
  } else {
    reader->Record("images", YAML::Node(fs::absolute(value.AsPath()).lexically_normal().string()));
  }
  std::vector<Seen> seen;
  for (const fs::path& image : images) seen.push_back({image.filename().string(), image, {}, {}});
  return seen;
}

std::vector<Seen> SeenByOthers(MapReader* reader, RunConfig* config) {
  const fs::path file = reader->Path("target_poses");
  config->data_files.push_back(file);
  std::vector<Seen> seen;
  for (const PoseRow& row : ReadPoseFile(file, *FindPoseFormat("ros"))) {
    seen.push_back({row.image.empty() ? "sample_" + std::to_string(seen.size()) : row.image, {}, row.pose, {}});
  }
  return seen;
}

std::vector<Seen> SeenBefore(MapReader* reader, RunConfig* config) {
  const fs::path file = reader->Path("detections");
  config->data_files.push_back(file);
  std::vector<Seen> seen;
  for (auto& [name, detection] : ReadDetections(file)) seen.push_back({name, {}, {}, std::move(detection)});
  return seen;
}

// A data set of another project. Its pictures count more than what was found in them.
std::vector<Seen> SeenInDataSet(MapReader* reader, RunConfig* config) {
  const fs::path source = reader->Path("data");
  std::vector<std::string> formats = ImportFormatNames();
  formats.insert(formats.begin(), "auto");
  const std::string format = reader->Choice("format", formats, "auto");
  config->imported = ImportDataSet(source, format == "auto" ? "" : format);
  reader->Record("format", YAML::Node(config->imported->format));
  config->data_files = config->imported->files;
  const std::vector<ImportedCapture>& captures = config->imported->captures;
  const auto all_have = [&](const auto& has) { return std::all_of(captures.begin(), captures.end(), has); };
  const bool have_images = all_have([](const ImportedCapture& capture) { return !capture.image.empty(); });
  const bool have_corners = std::any_of(captures.begin(), captures.end(),
                                        [](const ImportedCapture& capture) { return !capture.ids.empty(); });
  std::vector<Seen> seen;
  for (const ImportedCapture& capture : captures) {
    Seen entry{capture.name, capture.image, {}, {}};
    if (!have_images) entry.image.clear();
    if (have_corners) {
      entry.detection = CaptureDetection{};
      entry.detection->detection.ids = capture.ids;
      entry.detection->detection.pixels = capture.pixels;
    } else if (!have_images) {
      entry.camera_from_target = capture.camera_from_target;
    }
    seen.push_back(std::move(entry));
  }
  return seen;
}

struct Source {
  const char* key;
  std::vector<Seen> (*read)(const ConfigValue& value, MapReader* reader, RunConfig* config);
};
constexpr Source kSources[] = {
    {"images", [](const ConfigValue& value, MapReader* reader, RunConfig*) { return SeenInPictures(value, reader); }},
    {"target_poses",
     [](const ConfigValue&, MapReader* reader, RunConfig* config) { return SeenByOthers(reader, config); }},
    {"detections", [](const ConfigValue&, MapReader* reader, RunConfig* config) { return SeenBefore(reader, config); }},
    {"data", [](const ConfigValue&, MapReader* reader, RunConfig* config) { return SeenInDataSet(reader, config); }}};

// The poses as the data set has them, as rows of a file in the form `ros`.
std::vector<PoseRow> RowsOf(const ConfigValue& data, const ImportedSet& set) {
  std::vector<PoseRow> rows;
  for (const ImportedCapture& capture : set.captures) {
    if (!capture.base_from_gripper) {
      data.Fail("a data set in the form " + set.format + " has no poses of the robot; give them (poses)");
    }
    rows.push_back({capture.name, "", *capture.base_from_gripper, 0,
                    NumbersFromPose(*FindPoseFormat("ros"), *capture.base_from_gripper)});
  }
  return rows;
}

void AddCapture(const Seen& seen, const PoseRow& row, RunConfig* config) {
  Capture capture;
  capture.name = seen.name;
  capture.image = seen.image;
  capture.role = row.role;
  capture.base_from_gripper = BaseFromGripper(config->pose_reading, row.pose);
  config->captures.push_back(capture);
  config->pose_numbers.push_back(row.numbers);
  if (seen.camera_from_target) config->target_poses.push_back(*seen.camera_from_target);
  if (seen.detection) config->given_detections.push_back(*seen.detection);
}

}  // namespace

namespace {

// `robot`: an arm of the table, or a URDF with the links between which the joints are.
PoseFormat ReadJointFormat(MapReader& reader) {
  const std::string robot = reader.Get("robot").AsText();
  const bool is_urdf = robot.ends_with(".urdf");
  if (!is_urdf) {
    reader.Choice("robot", UrRobotNames());
    return JointFormat(robot, reader.Choice("joint_angles", {"rad", "deg"}, "rad"));
  }
  const fs::path file = reader.Path("robot");
  const std::string base_link = reader.Text("base_link", "");
  const std::string tip_link = reader.Text("tip_link", "");
  return JointFormat(file.string(), UrdfArm::Read(file, base_link, tip_link),
                     reader.Choice("joint_angles", {"rad", "deg"}, "rad"));
}

}  // namespace

PoseReading ReadPoseReading(MapReader& reader) {
  PoseFormat format = *FindPoseFormat("ros");
  const std::optional<ConfigValue> format_value = reader.Find("pose_format");
  const bool has_joints = format_value && format_value->IsText() && format_value->AsText() == "joints";
  if (has_joints) {
    format = ReadJointFormat(reader);
  } else if (format_value) {
    format = ReadPoseFormat(format_value->Top());
  }
  reader.Record("pose_format", PoseFormatNode(format));
  if (const std::optional<ConfigValue> units = reader.Find("units")) {
    format = WithUnits(format, *units);
    reader.Record("units", units->node());
  }
  const std::string direction =
      reader.Choice("poses_are", {"base_from_gripper", "gripper_from_base"}, "base_from_gripper");
  return {format, direction == "base_from_gripper"};
}

Rigid3d BaseFromGripper(const PoseReading& reading, const Rigid3d& pose) {
  return reading.is_base_from_gripper ? pose : Inverse(pose);
}

YAML::Node ReadCaptures(const ConfigValue& captures, RunConfig* config) {
  MapReader reader(captures);
  const Source* source = nullptr;
  for (const Source& known : kSources) {
    if (!reader.Has(known.key)) continue;
    if (source != nullptr) reader.Get(known.key).Fail("only one of this and '" + std::string(source->key) + "' can be");
    source = &known;
  }
  if (source == nullptr) source = &kSources[0];  // Its absence is the error.
  const ConfigValue seen_value = reader.Get(source->key);
  const std::vector<Seen> seen = source->read(seen_value, &reader, config);
  std::vector<PoseRow> rows;
  if (config->imported && !reader.Has("poses")) {
    config->pose_reading.format = *FindPoseFormat("ros");
    rows = RowsOf(seen_value, *config->imported);
  } else {
    config->poses_file = reader.Path("poses");
    config->pose_reading = ReadPoseReading(reader);
    if (config->pose_reading.format.arm) config->data_files.emplace_back(config->pose_reading.format.robot);
    rows = ReadPoseFile(config->poses_file, config->pose_reading.format);
  }
  reader.Finish();

  std::map<std::string, const Seen*> by_name;
  for (const Seen& entry : seen) {
    if (!by_name.emplace(entry.name, &entry).second) {
      seen_value.Fail("two pictures are called " + entry.name + "; poses are found by file name, so names must differ");
    }
  }
  const bool has_names = !rows.empty() && !rows.front().image.empty();
  if (!has_names && rows.size() != seen.size()) {
    throw InputError(config->poses_file.string() + ": has " + std::to_string(rows.size()) +
                     " rows without an image column for " + std::to_string(seen.size()) +
                     " pictures; the counts must agree, or name the pictures");
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!has_names) {
      AddCapture(seen[i], rows[i], config);
      continue;
    }
    const auto found = by_name.find(rows[i].image);
    if (found == by_name.end()) {
      std::vector<std::string> names;
      for (const auto& entry : by_name) names.push_back(entry.first);
      throw InputError(config->poses_file.string() + ":" + std::to_string(rows[i].line) + ": the picture " +
                       rows[i].image + " is not among those of " + seen_value.key() + DidYouMean(rows[i].image, names));
    }
    AddCapture(*found->second, rows[i], config);
    by_name.erase(found);
  }
  if (has_names) {
    for (const auto& entry : by_name) config->images_without_pose.push_back(entry.first);
  }
  const bool has_pictures = std::all_of(config->captures.begin(), config->captures.end(),
                                        [](const Capture& capture) { return !capture.image.empty(); });
  if (!has_pictures && config->given_detections.empty() && config->target_poses.size() != config->captures.size()) {
    seen_value.Fail(
        "neither pictures nor corners nor poses of the target belong to these poses; name the pictures "
        "(images)");
  }
  return reader.used();
}

}  // namespace heba
