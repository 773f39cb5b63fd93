// K. Koide's st_handeye_graph: NNN_image.jpg with NNN_pose.csv (4 x 4, m, the gripper in the base), camera_matrix.csv
// and distortion.csv. The setup is eye-in-hand. Images without a pose are ignored.
#include "heba/io/camera_format.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) { return !NumberedFiles(source, {""}, {"_pose.csv"}).empty(); }

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.setup = Setup::kEyeInHand;
  const std::map<int, fs::path> images = NumberedFiles(source, {""}, {"_image.jpg", "_image.png"});
  for (const auto& [number, file] : NumberedFiles(source, {""}, {"_pose.csv"})) {
    set.files.push_back(file);
    ImportedCapture capture = CaptureOf(images, number);
    capture.base_from_gripper = PoseOfMatrix(NumbersOfFile(file), 1, file.string());
    set.captures.push_back(std::move(capture));
  }
  const fs::path matrix = source / "camera_matrix.csv";
  const fs::path distortion = source / "distortion.csv";
  if (fs::exists(matrix) && fs::exists(distortion)) {
    const Outcome<std::vector<double>> pinhole = PinholeFromMatrix(NumbersOfFile(matrix));
    if (!pinhole) throw InputError(matrix.string() + ": " + pinhole.reason());
    const Outcome<Camera> camera = CameraFromCoefficients(*pinhole, NumbersOfFile(distortion), Lens::kPolynomial);
    if (!camera) throw InputError(distortion.string() + ": " + camera.reason());
    set.camera = *camera;
    set.files.insert(set.files.end(), {matrix, distortion});
  }
  return set;
}

}  // namespace

ImportReader ImportReader_koide() { return {Matches, Read}; }

}  // namespace heba
