// ViSP's hand-eye tools: pose_rPe_N.yaml (the effector in the robot's frame) with pose_cPo_N.yaml (the object in the
// camera's) or pictures image-N.*; poses are 6 x 1: tx ty tz (m) and theta u (rad). camera.xml is ViSP's own and is not
// read.
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) { return !NumberedFiles(source, {"pose_rPe_"}, {".yaml"}).empty(); }

// `rows: 6`, `cols: 1` and `data:`, a list whose items may stand in lists of their own.
Rigid3d ReadPose(const fs::path& file) {
  MapReader reader(ReadYamlFile(file));
  return PoseOf("ur", FlatNumbers(reader.Get("data")), file.string());
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const std::map<int, fs::path> seen = NumberedFiles(source, {"pose_cPo_"}, {".yaml"});
  const std::map<int, fs::path> pictures = NumberedFiles(source, {"image-"}, {".png", ".jpg", ".jpeg", ".pgm", ".ppm"});
  for (const auto& [number, file] : NumberedFiles(source, {"pose_rPe_"}, {".yaml"})) {
    ImportedCapture capture = CaptureOf(pictures, number);
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
