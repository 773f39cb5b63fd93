// Zivid's robot poses: posN.yaml, each an OpenCV FileStorage file with a 4 x 4 matrix PoseState (mm), the gripper in
// the base. Pictures imgN of the same numbers are taken along; Zivid's own point clouds (.zdf) are not read.
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::map<int, fs::path> PoseFiles(const fs::path& source) {
  std::map<int, fs::path> files;
  for (const char* prefix : {"pos", "pose", "robot_pose_"}) {
    for (const auto& [number, file] : NumberedFiles(source, prefix, ".yaml")) files.emplace(number, file);
  }
  return files;
}

bool Matches(const fs::path& source) {
  const std::map<int, fs::path> files = PoseFiles(source);
  return !files.empty() && BeginningOf(files.begin()->second).find("PoseState") != std::string::npos;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  std::map<int, fs::path> pictures;
  for (const char* prefix : {"img", "image", "image_"}) {
    for (const char* suffix : {".png", ".jpg"}) {
      for (const auto& [number, file] : NumberedFiles(source, prefix, suffix)) pictures.emplace(number, file);
    }
  }
  for (const auto& [number, file] : PoseFiles(source)) {
    const std::map<std::string, std::vector<double>> values = FileStorageNumbers(file);
    const auto matrix = values.find("PoseState");
    if (matrix == values.end()) throw InputError(file.string() + ": 'PoseState' is missing");
    set.files.push_back(file);
    ImportedCapture capture;
    capture.base_from_gripper = PoseOfMatrix(matrix->second, 1e-3, file.string() + ": PoseState");
    if (const auto found = pictures.find(number); found != pictures.end()) capture.image = found->second;
    capture.name = capture.image.empty() ? "pose_" + std::to_string(number) : capture.image.filename().string();
    set.captures.push_back(std::move(capture));
  }
  set.remarks.emplace_back("the files do not say where the camera is: set setup");
  return set;
}

}  // namespace

ImportReader ImportReader_zivid() { return {Matches, Read}; }

}  // namespace heba
