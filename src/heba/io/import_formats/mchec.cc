// Multi-Camera-Hand-Eye-Calibration: CalibrationInfo.yaml and cameraN/{image/0000.png, pose/0000.csv,
// intrinsic_pars_file.yaml}. The source is either this folder, whose first camera is read, or the folder of one camera
// in it. Poses are 4 x 4 (m), the gripper in the base. calibration_setup 0 is eye-in-hand.
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the folder with CalibrationInfo.yaml, which is this one or its parent; empty if neither contains it.
fs::path RootOf(const fs::path& source) {
  std::error_code error;
  const fs::path here = fs::absolute(source, error).lexically_normal();
  if (fs::exists(here / "CalibrationInfo.yaml", error)) return here;
  const fs::path above = (here.has_filename() ? here : here.parent_path()).parent_path();
  return fs::exists(above / "CalibrationInfo.yaml", error) ? above : fs::path();
}

bool Matches(const fs::path& source) {
  std::error_code error;
  return fs::is_directory(source, error) && !RootOf(source).empty();
}

Camera ReadCamera(const fs::path& file) {
  MapReader reader(ReadYamlFile(file));
  Camera camera{"pinhole", 0, 0, {}};
  for (const char* key : {"fx", "fy", "cx", "cy"}) camera.params.push_back(reader.Number(key));
  constexpr IntRange kSizes = {1, 100000};
  camera.width_px = reader.Int("img_width", kSizes);
  camera.height_px = reader.Int("img_height", kSizes);
  if (reader.Int("has_dist_coeff", {0, 1}, 0) == 0) return camera;
  camera.model = "rational8";
  for (const char* key : {"dist_k0", "dist_k1", "dist_px", "dist_py", "dist_k2", "dist_k3", "dist_k4", "dist_k5"}) {
    camera.params.push_back(reader.Number(key, 0.0));
  }
  const std::optional<Camera> simpler = ConvertCamera(camera, "brown5");
  return simpler ? *simpler : camera;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const fs::path root = RootOf(source);
  if (root.empty()) {
    throw InputError(source.string() + ": contains no CalibrationInfo.yaml, and neither does its parent folder");
  }
  const fs::path info = root / "CalibrationInfo.yaml";
  set.files.push_back(info);
  MapReader reader(ReadYamlFile(info));
  set.setup = reader.Int("calibration_setup", {0, 1}) == 0 ? Setup::kEyeInHand : Setup::kEyeToHand;
  constexpr IntRange kCounts = {2, 1000};
  const std::string pattern = reader.Text("pattern_type", "checkerboard");
  if (pattern == "checkerboard") {
    set.target = ChessboardYaml(reader.Int("number_of_rows", kCounts), reader.Int("number_of_columns", kCounts),
                                reader.Number("size"));
  } else {
    set.remarks.push_back("the pattern, " + Quoted(pattern) + ", is unknown; name the target in the config");
  }
  const int num_cameras = reader.Int("number_of_cameras", {1, 1000}, 1);
  const bool is_root = fs::equivalent(root, source);
  const fs::path camera = is_root ? root / (reader.Text("camera_folder_prefix", "camera") + "1") : fs::path(source);
  if (is_root && num_cameras > 1) {
    set.remarks.push_back("of " + std::to_string(num_cameras) +
                          " cameras the first one is read; name a camera's folder for another");
  }
  const fs::path intrinsics = camera / "intrinsic_pars_file.yaml";
  if (fs::exists(intrinsics)) {
    set.camera = ReadCamera(intrinsics);
    set.files.push_back(intrinsics);
  }
  for (const fs::path& image : ImagesOf(camera / "image")) {
    const fs::path pose = camera / "pose" / (image.stem().string() + ".csv");
    if (!fs::exists(pose)) continue;
    set.files.push_back(pose);
    ImportedCapture capture = CaptureOf(image, 0);
    capture.base_from_gripper = PoseOfMatrix(NumbersOfFile(pose), 1, pose.string());
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_mchec() { return {Matches, Read}; }

}  // namespace heba
