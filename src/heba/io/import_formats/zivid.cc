// Zivid's robot poses: posN.yaml, each an OpenCV FileStorage file with a 4 x 4 matrix PoseState (mm), the gripper in
// the base. Images imgN with the same numbers are used; Zivid's own point clouds (.zdf) are not read.
#include "heba/base/error.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::map<int, fs::path> PoseFiles(const fs::path& source) {
  return NumberedFiles(source, {"pos", "pose", "robot_pose_"}, {".yaml"});
}

bool Matches(const fs::path& source) {
  const std::map<int, fs::path> files = PoseFiles(source);
  return !files.empty() && BeginningOf(files.begin()->second).find("PoseState") != std::string::npos;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const std::map<int, fs::path> images = NumberedFiles(source, {"img", "image", "image_"}, {".png", ".jpg"});
  for (const auto& [number, file] : PoseFiles(source)) {
    const std::map<std::string, std::vector<double>> values = FileStorageNumbers(file);
    const auto matrix = values.find("PoseState");
    if (matrix == values.end()) throw InputError(file.string() + ": 'PoseState' is missing");
    set.files.push_back(file);
    ImportedCapture capture = CaptureOf(images, number);
    capture.base_from_gripper = PoseOfMatrix(matrix->second, 1e-3, file.string() + ": PoseState");
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_zivid() { return {Matches, Read}; }

}  // namespace heba
