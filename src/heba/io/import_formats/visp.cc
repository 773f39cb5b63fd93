// ViSP's hand-eye tools: pose_rPe_N.yaml (the effector in the robot's frame) with pose_cPo_N.yaml (the object in the
// camera's frame) or images image-N.*. All names may begin with the same word, as in franka_pose_rPe_1.yaml. Poses are
// 6 x 1: tx ty tz (m) and theta u (rad). camera.xml, in ViSP's own format, is not read.
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr std::string_view kEffector = "pose_rPe_";

// Returns the common prefix of the data set's file names; nothing if there are no such files.
std::optional<std::string> PrefixOf(const fs::path& source) {
  std::optional<std::string> prefix;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(source, error)) {
    const std::string name = entry.path().filename().string();
    const size_t at = name.find(kEffector);
    if (at == std::string::npos || entry.path().extension() != ".yaml") continue;
    // The first prefix in alphabetical order is used, so that the result does not depend on the order of the folder.
    if (!prefix || name.substr(0, at) < *prefix) prefix = name.substr(0, at);
  }
  return prefix;
}

bool Matches(const fs::path& source) {
  const std::optional<std::string> prefix = PrefixOf(source);
  return prefix && !NumberedFiles(source, {*prefix + std::string(kEffector)}, {".yaml"}).empty();
}

// Reads a file with `rows: 6`, `cols: 1` and `data:`, a list whose items may be lists.
Rigid3d ReadPose(const fs::path& file) {
  MapReader reader(ReadYamlFile(file));
  return PoseOf("ur", FlatNumbers(reader.Get("data")), file.string());
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const std::string prefix = PrefixOf(source).value_or("");
  const std::map<int, fs::path> seen = NumberedFiles(source, {prefix + "pose_cPo_"}, {".yaml"});
  const std::map<int, fs::path> images =
      NumberedFiles(source, {prefix + "image-"}, {".png", ".jpg", ".jpeg", ".pgm", ".ppm"});
  for (const auto& [number, file] : NumberedFiles(source, {prefix + std::string(kEffector)}, {".yaml"})) {
    ImportedCapture capture = CaptureOf(images, number);
    capture.base_from_gripper = ReadPose(file);
    set.files.push_back(file);
    if (const auto found = seen.find(number); found != seen.end()) {
      capture.camera_from_target = ReadPose(found->second);
      set.files.push_back(found->second);
    }
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_visp() { return {Matches, Read}; }

}  // namespace heba
