#include "tools/config/capture_section.h"

#include <algorithm>
#include <functional>
#include <map>
#include <numeric>
#include <set>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/data/pose_stream.h"
#include "heba/io/pixel_records.h"
#include "heba/io/pose_file.h"
#include "heba/io/pose_folder.h"
#include "heba/io/pose_source.h"
#include "heba/robot/ur_kinematics.h"
#include "tools/config/common_keys.h"
#include "tools/config/image_list.h"
#include "tools/config/stream_section.h"
#include "tools/files/detection_file.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The measurements of one capture, without the robot's pose.
struct Seen {
  std::string name;
  fs::path image;  // Empty if there is no image.
  std::optional<Rigid3d> camera_from_target;
  std::optional<CaptureDetection> detection;
  std::optional<double> time_s = {};  // When it was taken, if its file says so.
};

// A source of measurements also keeps the files that it was read from, other than images.
struct SeenSource {
  std::vector<Seen> seen;
  std::vector<fs::path> files = {};
  std::optional<ImportedSet> imported = {};
};

SeenSource SeenInImages(const ConfigValue& value, MapReader& reader) {
  const std::vector<fs::path> images = FindImages(value);
  reader.Record("images", ImagesNode(value, images));
  std::vector<Seen> seen;
  for (const fs::path& image : images) seen.push_back({image.filename().string(), image, {}, {}});
  return {std::move(seen)};
}

SeenSource SeenByOthers(const ConfigValue& /*value*/, MapReader& reader) {
  PoseSource source = ReadPoseSource(reader, "target_poses");
  std::optional<MapReader>& mapping = source.mapping;
  PoseFormat format = *FindPoseFormat("ros");
  bool is_inverse = false;
  if (mapping) {
    if (const std::optional<ConfigValue> value = mapping->Find("pose_format")) format = ReadPoseFormat(value->Top());
    mapping->Record("pose_format", PoseFormatNode(format));
    is_inverse = mapping->Choice("poses_are", {"camera_from_target", "target_from_camera"}, "camera_from_target") ==
                 "target_from_camera";
    mapping->Finish();
    reader.Record("target_poses", mapping->used());
  }
  std::vector<Seen> seen;
  for (const PoseRow& row : ReadPoses(source.path, format, {}, source.paths)) {
    seen.push_back({row.image.empty() ? "sample_" + std::to_string(seen.size()) : row.image,
                    {},
                    is_inverse ? Inverse(row.pose) : row.pose,
                    {},
                    row.time_s});
  }
  return {std::move(seen), {source.path}};
}

// Reads points that another detector found, in the order of the target's points, from records.
SeenSource SeenInRecords(const ConfigValue& value, MapReader& reader) {
  MapReader mapping(value.DownTo({"file"}));
  const fs::path file = mapping.InputPath("file");
  const std::string pixels = mapping.Text("pixels");
  const std::string images = mapping.Text("image", "");
  mapping.Finish();
  reader.Record("detections", mapping.used());
  std::vector<Seen> seen;
  for (const PixelRecord& record : ReadPixelRecords(file, pixels, images)) {
    CaptureDetection detection;
    detection.detection.pixels = record.pixels;
    for (size_t k = 0; k < record.pixels.size(); ++k) detection.detection.ids.push_back(static_cast<int>(k));
    seen.push_back(
        {record.image.empty() ? "sample_" + std::to_string(seen.size()) : record.image, {}, {}, std::move(detection)});
  }
  return {std::move(seen), {file}};
}

SeenSource SeenBefore(const ConfigValue& value, MapReader& reader) {
  if (value.IsMap()) return SeenInRecords(value, reader);
  const fs::path file = reader.InputPath("detections");
  std::vector<Seen> seen;
  for (auto& [name, detection] : ReadDetections(file)) seen.push_back({name, {}, {}, std::move(detection)});
  return {std::move(seen), {file}};
}

// Reads a data set of another project. Its images take precedence over the corners that it contains.
SeenSource SeenInDataSet(const ConfigValue& /*value*/, MapReader& reader) {
  const fs::path source = reader.InputPath("data");
  std::vector<std::string> formats = DataSetFormatNames();
  formats.insert(formats.begin(), "auto");
  const std::string format = reader.Choice("format", formats, "auto");
  ImportedSet set = ImportDataSet(source, format == "auto" ? "" : format);
  reader.Record("format", YAML::Node(set.format));
  const std::vector<ImportedCapture>& captures = set.captures;
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
  return {std::move(seen), set.files, std::move(set)};
}

// `value` is that of the key.
struct Source {
  const char* key;
  SeenSource (*read)(const ConfigValue& value, MapReader& reader);
};
constexpr Source kSources[] = {
    {"images", SeenInImages}, {"target_poses", SeenByOthers}, {"detections", SeenBefore}, {"data", SeenInDataSet}};

// Returns the time that the name of an image states: its last number, which may have a fraction.
std::optional<double> TimeInName(const std::string& name) {
  const std::string stem = fs::path(name).stem().string();
  constexpr std::string_view kDigits = "0123456789";
  const size_t end = stem.find_last_of(kDigits);
  if (end == std::string::npos) return std::nullopt;
  size_t first = stem.find_last_not_of("0123456789.", end);
  first = stem.find_first_of(kDigits, first == std::string::npos ? 0 : first);
  double time = 0;
  if (!ParseDouble(stem.substr(first, end + 1 - first), &time)) return std::nullopt;
  return SecondsOf(time);
}

// Returns the times of images: the column `time` of `table`, which names the images, or those in their names if there
// is no table.
std::map<std::string, double> ImageTimes(MapReader& reader, const std::vector<Seen>& seen,
                                         const std::optional<fs::path>& table) {
  std::map<std::string, double> times_s;
  if (table) {
    for (const PoseRow& row : ReadTimes(*table, {})) times_s[row.image] = *row.time_s;
    return times_s;
  }
  for (const Seen& entry : seen) {
    const std::optional<double> time_s = entry.time_s ? entry.time_s : TimeInName(entry.name);
    if (!time_s) {
      reader.Get("stream").Fail("the image " + entry.name +
                                " has no time in its name; list the times of all images in a table with the columns "
                                "image and time (poses)");
    }
    times_s[entry.name] = *time_s;
  }
  return times_s;
}

// The poses of the robot as their file, or folder of files, has them.
struct RobotPoses {
  fs::path file;
  PoseReading reading = {*FindPoseFormat("ros")};
  std::vector<PoseRow> rows;
  std::optional<PoseStream> stream;  // The poses are those of this stream at the times of the images.
  std::vector<fs::path> data_files;  // All files that they are read from.
};

// Takes the poses of the captures from a stream: rows in the form `ros`, for the images that were taken within it.
RobotPoses PosesOfStream(MapReader& reader, const std::vector<Seen>& seen) {
  RobotPoses poses;
  poses.file = reader.InputPath("stream");
  poses.data_files = {poses.file};
  poses.stream = ReadStream(poses.file, ReadPoseReading(reader));
  std::optional<fs::path> table;
  if (reader.Has("poses")) table = poses.data_files.emplace_back(reader.InputPath("poses"));
  std::vector<PoseRow> timed;
  for (const auto& [image, time_s] : ImageTimes(reader, seen, table)) {
    PoseRow& row = timed.emplace_back();
    row.image = image;
    row.time_s = time_s;
  }
  poses.rows = RowsAtTimes(*poses.stream, poses.file, std::move(timed));
  return poses;
}

// Returns the data set's poses as rows of a file in the form `ros`.
std::vector<PoseRow> RowsOf(const ConfigValue& data, const ImportedSet& set) {
  std::vector<PoseRow> rows;
  for (const ImportedCapture& capture : set.captures) {
    if (!capture.base_from_gripper) {
      data.Fail("a data set in the form " + set.format + " has no robot poses; provide them (poses)");
    }
    rows.push_back({capture.name, CaptureRole::kNone, *capture.base_from_gripper, 0,
                    NumbersFromPose(*FindPoseFormat("ros"), *capture.base_from_gripper)});
  }
  return rows;
}

// Reads the names of captures that are to be left out.
std::set<std::string> ReadExcluded(MapReader& reader, const std::vector<Seen>& seen, const std::vector<PoseRow>& rows) {
  std::set<std::string> excluded;
  const std::optional<ConfigValue> list = reader.Find("exclude");
  if (!list) return excluded;
  std::vector<std::string> names;
  for (const Seen& entry : seen) names.push_back(entry.name);
  for (const PoseRow& row : rows) names.push_back(row.image);
  for (const ConfigValue& item : list->AsList()) {
    const std::string name = item.AsText();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      item.Fail("there is no capture " + Quoted(name) + DidYouMean(name, names));
    }
    excluded.insert(name);
  }
  reader.Record("exclude", list->node());
  return excluded;
}

// Indexes the names by `part_of`. Returns nothing if two names have the same part, or if one has none.
template <typename Part>
std::optional<std::map<Part, size_t>> PlacesBy(const std::vector<std::string>& names,
                                               const std::function<std::optional<Part>(const std::string&)>& part_of) {
  std::map<Part, size_t> places;
  for (size_t i = 0; i < names.size(); ++i) {
    const std::optional<Part> part = part_of(names[i]);
    if (!part || !places.emplace(*part, i).second) return std::nullopt;
  }
  return places;
}

std::string StemOf(const std::string& name) { return fs::path(name).stem().string(); }

// Pairs files of one pose each with images: by their names without suffix, or else by the numbers in them.
std::vector<std::optional<size_t>> PairFiles(const std::vector<PoseRow>& rows, const std::vector<Seen>& seen,
                                             const fs::path& folder) {
  std::vector<std::string> image_stems;
  for (const Seen& entry : seen) image_stems.push_back(StemOf(entry.name));
  std::vector<std::optional<size_t>> pairs(rows.size());
  bool any = false;
  for (size_t i = 0; i < rows.size(); ++i) {
    const auto found = std::find(image_stems.begin(), image_stems.end(), rows[i].image);
    if (found != image_stems.end()) pairs[i] = found - image_stems.begin();
    any = any || pairs[i];
  }
  if (any) return pairs;
  const auto places = PlacesBy<long>(image_stems, NumberInName);
  std::set<long> numbers;
  for (const PoseRow& row : rows) {
    if (const std::optional<long> number = NumberInName(row.image)) numbers.insert(*number);
  }
  if (!places || numbers.size() != rows.size()) {
    throw InputError(folder.string() +
                     ": its files and the images cannot be paired by their names or by single numbers in them; name "
                     "them alike, such as 007.txt and 007.png");
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    const auto found = places->find(*NumberInName(rows[i].image));
    if (found != places->end()) pairs[i] = found->second;
  }
  return pairs;
}

// Pairs images with more rows than there are images, by the numbers in the images' names, which count the rows from 0
// or from 1. Returns nothing if the names do not tell which.
std::optional<std::vector<std::optional<size_t>>> PairByNumber(size_t num_rows, const std::vector<Seen>& seen) {
  std::vector<std::string> stems;
  for (const Seen& entry : seen) stems.push_back(StemOf(entry.name));
  const auto places = PlacesBy<long>(stems, NumberInName);
  if (!places || places->empty() || seen.size() > num_rows) return std::nullopt;
  const auto last_row = static_cast<long>(num_rows) - 1;
  const long first_number = places->begin()->first;
  const long last_number = places->rbegin()->first;
  const bool counts_from_0 = first_number == 0 && last_number <= last_row;
  const bool counts_from_1 = first_number > 0 && last_number == last_row + 1;
  if (!counts_from_0 && !counts_from_1) return std::nullopt;
  std::vector<std::optional<size_t>> pairs(num_rows);
  for (const auto& [number, place] : *places) pairs[static_cast<size_t>(number - (counts_from_1 ? 1 : 0))] = place;
  return pairs;
}

// Suggests an image without a pose that the row may mean: one with a similar name and the same number in it.
std::string ImageMeant(const std::string& name, const std::vector<std::string>& without_row) {
  std::vector<std::string> likely;
  for (const std::string& other : without_row) {
    if (NumberInName(StemOf(other)) == NumberInName(StemOf(name))) likely.push_back(other);
  }
  return DidYouMean(name, likely);
}

// Returns the image that belongs to each row; nothing if there is none.
std::vector<std::optional<size_t>> PairRows(const std::vector<PoseRow>& rows, const std::vector<Seen>& seen,
                                            const std::set<std::string>& excluded, const ConfigValue& seen_value,
                                            const fs::path& poses_file) {
  std::map<std::string, size_t> place_of;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!place_of.emplace(seen[i].name, i).second) {
      seen_value.Fail("two images are named " + seen[i].name + "; poses are found by file name, so names must differ");
    }
  }
  std::vector<std::optional<size_t>> pairs(rows.size());
  if (rows.empty() || rows.front().image.empty()) {
    if (rows.size() != seen.size()) {
      if (auto by_number = PairByNumber(rows.size(), seen)) return *std::move(by_number);
      throw InputError(poses_file.string() + ": has " + std::to_string(rows.size()) +
                       " rows without an image column for " + std::to_string(seen.size()) +
                       " images; the counts must agree, or name the image of each row");
    }
    for (size_t i = 0; i < rows.size(); ++i) pairs[i] = i;
    return pairs;
  }
  std::error_code error;
  if (fs::is_directory(poses_file, error)) {
    pairs = PairFiles(rows, seen, poses_file);
  } else {
    for (size_t i = 0; i < rows.size(); ++i) {
      const auto found = place_of.find(rows[i].image);
      if (found != place_of.end()) pairs[i] = found->second;
    }
  }
  std::map<size_t, size_t> row_of;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!pairs[i]) continue;
    const auto [other, is_new] = row_of.emplace(*pairs[i], i);
    if (!is_new) {
      throw InputError(poses_file.string() + ": " + rows[other->second].image + " and " + rows[i].image +
                       " both belong to the image " + seen[*pairs[i]].name);
    }
  }
  std::vector<std::string> without_row;
  for (const auto& [name, place] : place_of) {
    if (std::find(pairs.begin(), pairs.end(), place) == pairs.end()) without_row.push_back(name);
  }
  const bool any = std::any_of(pairs.begin(), pairs.end(), [](const auto& pair) { return pair.has_value(); });
  for (size_t i = 0; i < rows.size(); ++i) {
    if (pairs[i] || excluded.count(rows[i].image) > 0) continue;
    // A row whose image was removed is left out; a row whose image has a similar name is a mistake.
    const std::string meant = ImageMeant(rows[i].image, without_row);
    if (any && meant.empty()) continue;
    const std::string where =
        rows[i].line > 0 ? poses_file.string() + ":" + std::to_string(rows[i].line) : poses_file.string();
    throw InputError(where + ": the image " + rows[i].image + " is not among those of " + seen_value.key() +
                     (meant.empty() ? "; nor is that of any other row" : meant));
  }
  return pairs;
}

// Reads the format of joint angles. `robot`: an arm of the built-in table, or a URDF with the links between which the
// joints lie.
PoseFormat ReadJointFormat(MapReader& reader) {
  const std::string robot = reader.Get("robot").AsText();
  const bool is_urdf = robot.ends_with(".urdf");
  if (!is_urdf) {
    reader.Choice("robot", UrRobotNames());
    return JointFormat(robot, reader.Choice("joint_angles", {"rad", "deg"}, "rad"));
  }
  const fs::path file = reader.InputPath("robot");
  const std::string base_link = reader.Text("base_link", "");
  const std::string tip_link = reader.Text("tip_link", "");
  return JointFormat(file.string(), std::make_shared<const UrdfArm>(ReadUrdfArm(file, base_link, tip_link)),
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

bool ReadJointsAreDeg(MapReader& captures) { return captures.Choice("joint_angle", {"rad", "deg"}, "rad") == "deg"; }

std::optional<ConfigValue> FindPoseSection(const fs::path& run, const std::string& arm) {
  const fs::path file = run / "config.yaml";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return std::nullopt;
  MapReader config(ReadYamlFile(file));
  std::optional<ConfigValue> section = config.Find("captures");
  if (!arm.empty() && config.Has("robots")) {
    MapReader robots(config.Get("robots"));
    section = robots.Find(arm);
  }
  return section && section->IsMap() ? section : std::nullopt;
}

PoseSource ReadPoseSource(MapReader& reader, const std::string& key) {
  const ConfigValue value = reader.Get(key);
  if (!value.IsMap()) return {reader.InputPath(key), {}, {}};
  // A mapping replaces the file that a layer below names.
  MapReader mapping(value.DownTo({"file"}));
  PoseSource source{mapping.InputPath("file"), {}, {}};
  source.paths.pose = mapping.Text("pose", "");
  source.paths.image = mapping.Text("image", "");
  source.mapping = std::move(mapping);
  return source;
}

namespace {

// Returns the source of the images that the config names. If it names none, that is the first, whose missing key is
// reported as an error.
const Source& FindSource(MapReader& reader) {
  const Source* source = nullptr;
  for (const Source& known : kSources) {
    if (!reader.Has(known.key)) continue;
    if (source != nullptr) reader.Get(known.key).Fail("cannot be combined with '" + std::string(source->key) + "'");
    source = &known;
  }
  return source == nullptr ? kSources[0] : *source;
}

RobotPoses ReadRobotPoses(MapReader& reader) {
  const PoseSource source = ReadPoseSource(reader, "poses");
  if (source.mapping) {
    source.mapping->Finish();
    reader.Record("poses", source.mapping->used());
  }
  RobotPoses poses;
  poses.file = source.path;
  poses.data_files = {poses.file};
  poses.reading = ReadPoseReading(reader);
  if (poses.reading.format.arm) poses.data_files.emplace_back(poses.reading.format.robot);
  std::error_code error;
  if (fs::is_directory(poses.file, error)) {
    for (const fs::path& file : PoseFilesOf(poses.file)) poses.data_files.push_back(file);
  }
  poses.rows = ReadPoses(poses.file, poses.reading.format, {}, source.paths);
  return poses;
}

// Returns for each image whether it is left out, by its own name or by that of its row.
std::vector<bool> ExcludedImages(const std::vector<Seen>& seen, const std::vector<PoseRow>& rows,
                                 const std::vector<std::optional<size_t>>& image_of_row,
                                 const std::set<std::string>& excluded) {
  std::vector<bool> is_excluded(seen.size(), false);
  for (size_t i = 0; i < seen.size(); ++i) is_excluded[i] = excluded.count(seen[i].name) > 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (image_of_row[i] && excluded.count(rows[i].image) > 0) is_excluded[*image_of_row[i]] = true;
  }
  return is_excluded;
}

// Returns the rows that have no image and are not left out.
std::vector<std::string> PosesWithoutImage(const std::vector<PoseRow>& rows,
                                           const std::vector<std::optional<size_t>>& image_of_row,
                                           const std::set<std::string>& excluded) {
  std::vector<std::string> names;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!image_of_row[i] && excluded.count(rows[i].image) == 0) names.push_back(rows[i].image);
  }
  return names;
}

// Throws InputError at `value` if no captures are left, or if nothing shows the target in them.
void CheckCaptures(const CaptureSection& section, const ConfigValue& value) {
  const std::vector<Recording>& captures = section.captures;
  if (captures.empty()) value.Fail("no capture is left: captures.exclude leaves all of them out");
  const bool has_images = std::all_of(captures.begin(), captures.end(),
                                      [](const Recording& capture) { return !capture.images.front().empty(); });
  if (!has_images && section.given_detections.empty() && section.target_poses.size() != captures.size()) {
    value.Fail(
        "neither images nor corners nor poses of the target belong to these poses; name the images "
        "(images)");
  }
}

}  // namespace

std::vector<size_t> OrderOfTimes(const std::vector<std::optional<double>>& times_s) {
  std::vector<size_t> order(times_s.size());
  std::iota(order.begin(), order.end(), 0);
  if (std::find(times_s.begin(), times_s.end(), std::nullopt) != times_s.end()) return order;
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return *times_s[a] < *times_s[b]; });
  return order;
}

namespace {

// Returns the section with the captures, in the order of their times, and with the images that are left out.
CaptureSection WithCaptures(CaptureSection section, const std::vector<Seen>& seen, const std::vector<PoseRow>& rows,
                            const std::vector<std::optional<size_t>>& image_of_row,
                            const std::vector<bool>& is_excluded) {
  std::vector<bool> has_row(seen.size(), false);
  std::vector<std::optional<double>> times_s;
  for (const PoseRow& row : rows) times_s.push_back(row.time_s);
  for (const size_t i : OrderOfTimes(times_s)) {
    if (!image_of_row[i]) continue;
    has_row[*image_of_row[i]] = true;
    if (is_excluded[*image_of_row[i]]) continue;
    // A capture is named after its image, or after its row if the row has another name.
    const Seen& entry = seen[*image_of_row[i]];
    // The image of a given detection is a name only.
    const fs::path image = entry.detection && entry.image.empty() ? fs::path(entry.name) : entry.image;
    if (entry.detection) section.given_detections.push_back({section.captures.size(), 0, 0, *entry.detection});
    if (entry.camera_from_target) section.target_poses.push_back(*entry.camera_from_target);
    const Rigid3d base_from_gripper = BaseFromGripper(section.arm.reading, rows[i].pose);
    section.captures.push_back({entry.name, {base_from_gripper}, {image}, {}, rows[i].role, rows[i].time_s});
    section.arm.numbers.push_back(rows[i].numbers);
  }
  for (size_t i = 0; i < seen.size(); ++i) {
    if (is_excluded[i]) {
      section.left_out.push_back({seen[i].name, std::string(kExcludedReason), "", {}});
    } else if (!has_row[i]) {
      section.images_without_pose.push_back(seen[i].name);
      const std::string reason = section.stream ? "the stream of the robot's poses does not reach its time"
                                                : "the robot's pose is not in the poses file";
      section.left_out.push_back({seen[i].name, reason, "", {}});
    }
  }
  return section;
}

}  // namespace

CaptureSection ReadCaptures(const ConfigValue& captures) {
  CaptureSection section;
  MapReader reader(captures);
  const Source& source = FindSource(reader);
  const ConfigValue seen_value = reader.Get(source.key);
  SeenSource read = source.read(seen_value, reader);
  const std::vector<Seen>& seen = read.seen;
  section.are_points_in_order = source.key == std::string("detections") && seen_value.IsMap();
  section.imported = std::move(read.imported);
  section.data_files = read.files;
  if (!read.files.empty()) section.detections_source = read.files.front().string();
  RobotPoses poses;
  if (reader.Has("stream")) {
    poses = PosesOfStream(reader, seen);
  } else if (section.imported && !reader.Has("poses")) {
    poses.rows = RowsOf(seen_value, *section.imported);
  } else {
    poses = ReadRobotPoses(reader);
  }
  const std::vector<PoseRow>& rows = poses.rows;
  section.data_files.insert(section.data_files.end(), poses.data_files.begin(), poses.data_files.end());
  section.arm = {"captures", poses.file, poses.reading, {}};
  section.stream = std::move(poses.stream);
  if (reader.Has("joints")) {
    section.joints_file = reader.InputPath("joints");
    section.arm.joints_are_deg = ReadJointsAreDeg(reader);
    section.data_files.push_back(section.joints_file);
  }
  const std::set<std::string> excluded = ReadExcluded(reader, seen, rows);
  reader.Finish();
  section.used = reader.used();
  const std::vector<std::optional<size_t>> image_of_row = PairRows(rows, seen, excluded, seen_value, poses.file);
  section.num_images = seen.size();
  section.poses_without_image = PosesWithoutImage(rows, image_of_row, excluded);
  for (const std::string& name : section.poses_without_image) {
    section.left_out.push_back({name, "the image is not among those of " + seen_value.key(), "", {}});
  }
  section =
      WithCaptures(std::move(section), seen, rows, image_of_row, ExcludedImages(seen, rows, image_of_row, excluded));
  CheckCaptures(section, seen_value);
  return section;
}

}  // namespace heba
