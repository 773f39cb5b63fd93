// ROS-Industrial's industrial_calibration: cal_data.yaml lists images and poses (x y z qx qy qz qw, m: the moving mount
// in the base). The setup, camera and target are defined in the config of the program. It is read too if it lies beside
// the data (config.yaml) and has a key static_camera or target_finder. The origin of a circle grid's frame is the
// larger dot, as in heba; the order of the ids does not matter.
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

fs::path DataFile(const fs::path& source) { return fs::is_directory(source) ? source / "cal_data.yaml" : source; }

bool Matches(const fs::path& source) {
  std::error_code error;
  const fs::path file = fs::is_directory(source, error) ? source / "cal_data.yaml" : source;
  const std::string text = BeginningOf(file);
  return text.find("data:") != std::string::npos && text.find("pose:") != std::string::npos &&
         text.find("image:") != std::string::npos;
}

std::string Metres(MapReader& reader, const std::string& key) { return RoundTrip(reader.Number(key)) + " m"; }

// Returns the name of a dictionary from its number in OpenCV's enumeration.
std::string DictionaryName(const ConfigValue& value) {
  const int number = value.AsInt({0, 16});
  const char* const sizes[] = {"4X4", "5X5", "6X6", "7X7"};
  const char* const counts[] = {"50", "100", "250", "1000"};
  if (number == 16) return "DICT_ARUCO_ORIGINAL";
  return std::string("DICT_") + sizes[number / 4] + "_" + counts[number % 4];
}

Remarked<std::string> TargetOf(const ConfigValue& value) {
  MapReader reader(value);
  const std::string type = reader.Text("type", "ModifiedCircleGridTargetFinder");
  constexpr IntRange kCounts = {1, 1000};
  const std::string grid = "rows: " + std::to_string(reader.Int("rows", kCounts)) +
                           "\ncolumns: " + std::to_string(reader.Int("cols", kCounts)) + "\n";
  if (type == "CharucoGridTargetFinder") {
    return {"type: charuco\n" + grid + "square: " + Metres(reader, "chessboard_dim") +
                "\nmarker: " + Metres(reader, "aruco_marker_dim") +
                "\ndictionary: " + DictionaryName(reader.Get("dictionary")) + "\nlegacy_pattern: true\n",
            {"its ChArUco boards are those of OpenCV before 4.6.0 unless they have an odd number of rows: "
             "set legacy_pattern to suit yours"}};
  }
  if (type == "ModifiedCircleGridTargetFinder") {
    return {"type: circle_grid\n" + grid + "spacing: " + Metres(reader, "spacing") + "\nmarker_dot: true\n"};
  }
  return {"", {"the target, " + Quoted(type) + ", is not supported; name a target in the config"}};
}

// Returns the set with what the config of the program defines.
ImportedSet WithConfig(ImportedSet set, const fs::path& file) {
  const ConfigValue root = ReadYamlFile(file);
  if (!root.IsMap()) return set;
  MapReader reader(root);
  set.files.push_back(file);
  if (const std::optional<ConfigValue> fixed = reader.Find("static_camera")) {
    set.setup = fixed->AsBool() ? Setup::kEyeToHand : Setup::kEyeInHand;
  }
  if (const std::optional<ConfigValue> finder = reader.Find("target_finder")) {
    const auto [target, remarks] = TargetOf(*finder);
    set.target = target;
    set.remarks = remarks;
  }
  if (const std::optional<ConfigValue> intrinsics = reader.Find("intrinsics")) {
    MapReader camera(*intrinsics);
    set.camera = Camera{"pinhole", 0, 0, {}};
    for (const char* key : {"fx", "fy", "cx", "cy"}) set.camera->params.push_back(camera.Number(key));
  }
  return set;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const fs::path file = DataFile(source);
  set.files.push_back(file);
  MapReader root(ReadYamlFile(file));
  for (const ConfigValue& entry : root.Get("data").AsList()) {
    MapReader reader(entry);
    ImportedCapture capture;
    capture.image = reader.Path("image");
    capture.name = capture.image.filename().string();
    const fs::path pose_file = reader.Path("pose");
    capture.base_from_gripper = PoseOfMap(ReadYamlFile(pose_file));
    set.files.push_back(pose_file);
    set.captures.push_back(std::move(capture));
  }
  const fs::path config = file.parent_path() / "config.yaml";
  const std::string beginning = BeginningOf(config);
  if (beginning.find("target_finder") != std::string::npos || beginning.find("static_camera") != std::string::npos) {
    set = WithConfig(std::move(set), config);
  }
  return set;
}

}  // namespace

ImportReader ImportReader_industrial_calibration() { return {Matches, Read}; }

}  // namespace heba
