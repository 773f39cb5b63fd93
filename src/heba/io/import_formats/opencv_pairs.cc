// handeye_calib_camodocal's pairs: an OpenCV FileStorage file with frameCount, T1_0, T2_0, T1_1, ... T1 is the pose of
// the arm's tip in the base, and T2 the pose of the target in the camera, both 4 x 4 (m).
#include <cmath>

#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) {
  const std::string text = BeginningOf(source);
  return text.find("frameCount") != std::string::npos && text.find("T1_0") != std::string::npos;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  const std::map<std::string, std::vector<double>> values = FileStorageNumbers(source);
  const auto get = [&](const std::string& key) -> const std::vector<double>& {
    const auto found = values.find(key);
    if (found == values.end()) throw InputError(source.string() + ": '" + key + "' is missing");
    return found->second;
  };
  const double count = get("frameCount").front();
  constexpr double kMost = 100000;
  if (!(count >= 0 && count <= kMost && count == std::floor(count))) {
    throw InputError(source.string() + ": frameCount: a whole number up to 100000 is needed");
  }
  for (int i = 0; i < static_cast<int>(count); ++i) {
    const std::string number = std::to_string(i);
    ImportedCapture capture;
    capture.name = "frame_" + number;
    capture.base_from_gripper = PoseOfMatrix(get("T1_" + number), 1, source.string() + ": T1_" + number);
    capture.camera_from_target = PoseOfMatrix(get("T2_" + number), 1, source.string() + ": T2_" + number);
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_opencv_pairs() { return {Matches, Read}; }

}  // namespace heba
