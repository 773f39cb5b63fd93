// Multi-Camera-Hand-Eye-Calibration, also the form of the METRIC data set: CalibrationInfo.yaml and
// cameraN/{image/0000.png, pose/0000.csv, intrinsic_pars_file.yaml}, and the true poses in gt_camN.csv or
// GT/gt_camN.csv if they are known. The source is either this folder or the folder of one camera in it. Poses are 4 x 4
// (m), the gripper in the base; the true ones are those of the cameras in the base. calibration_setup 0 is eye-in-hand.
// Images and poses belong together by the numbers in their names, and so do the images of all cameras.
#include <algorithm>
#include <map>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"
#include "heba/io/pose_folder.h"

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

// Returns the camera with a principal point that is stated as the exact centre of the image moved to that centre in
// heba's pixels. A lens has never its axis there; simulators do, and count from the image's corner (half its width) or
// from 1 (Gazebo, half a pixel more).
Remarked<Camera> WithStatedCentre(Camera camera, const std::string& where) {
  const Eigen::Vector2d size(camera.width_px, camera.height_px);
  const Eigen::Vector2d stated(camera.params[2], camera.params[3]);
  const Eigen::Vector2d centre = (size.array() - 1) / 2;
  for (const double first : {0.5, 1.0}) {
    if (stated != Eigen::Vector2d(centre.array() + first)) continue;
    camera.params[2] = centre.x();
    camera.params[3] = centre.y();
    return {std::move(camera),
            {where + ": the principal point " + RoundTrip(stated.x()) + ", " + RoundTrip(stated.y()) +
             " is the centre of the image counted from " + (first == 1.0 ? "1" : "the corner") + "; read as " +
             RoundTrip(centre.x()) + ", " + RoundTrip(centre.y()) + " from the centre of the first pixel"}};
  }
  return {std::move(camera)};
}

Remarked<Camera> ReadCamera(const fs::path& file, const std::string& where) {
  MapReader reader(ReadYamlFile(file));
  Camera camera{"pinhole", 0, 0, {}};
  for (const char* key : {"fx", "fy", "cx", "cy"}) camera.params.push_back(reader.Number(key));
  constexpr IntRange kSizes = {1, 100000};
  camera.width_px = reader.Int("img_width", kSizes);
  camera.height_px = reader.Int("img_height", kSizes);
  auto [moved, remarks] = WithStatedCentre(std::move(camera), where);
  if (reader.Int("has_dist_coeff", {0, 1}, 0) == 0) return {moved, remarks};
  moved.model = "rational8";
  for (const char* key : {"dist_k0", "dist_k1", "dist_px", "dist_py", "dist_k2", "dist_k3", "dist_k4", "dist_k5"}) {
    moved.params.push_back(reader.Number(key, 0.0));
  }
  return {ConvertCamera(moved, "brown5").value_or(moved), remarks};
}

// The contents of CalibrationInfo.yaml.
struct Info {
  fs::path file;
  Setup setup = Setup::kEyeToHand;
  std::string target;  // Empty if its type is unknown.
  int num_cameras = 1;
  std::string prefix;  // The cameras' folders begin with it.
  std::vector<std::string> remarks = {};
};

Info ReadInfo(const fs::path& root) {
  Info info;
  info.file = root / "CalibrationInfo.yaml";
  MapReader reader(ReadYamlFile(info.file));
  info.setup = reader.Int("calibration_setup", {0, 1}) == 0 ? Setup::kEyeInHand : Setup::kEyeToHand;
  constexpr IntRange kCounts = {2, 1000};
  const std::string pattern = reader.Text("pattern_type", "checkerboard");
  if (pattern == "checkerboard") {
    info.target = ChessboardYaml(reader.Int("number_of_rows", kCounts), reader.Int("number_of_columns", kCounts),
                                 reader.Number("size"));
  } else {
    info.remarks.push_back("the pattern, " + Quoted(pattern) + ", is unknown; name the target in the config");
  }
  info.num_cameras = reader.Int("number_of_cameras", {1, 1000}, 1);
  info.prefix = reader.Text("camera_folder_prefix", "camera");
  return info;
}

// An image and the file of the pose at which it was taken.
struct ImageWithPose {
  fs::path image;
  fs::path pose;
};

// Returns the images of a camera's folder that have a pose, by their numbers.
Remarked<std::map<long, ImageWithPose>> PosedImagesOf(const fs::path& camera) {
  std::map<long, fs::path> poses;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(camera / "pose", error)) {
    const std::optional<long> number = NumberInName(entry.path().stem().string());
    if (!number || entry.path().extension() != ".csv") continue;
    const auto [other, is_new] = poses.emplace(*number, entry.path());
    if (!is_new) throw InputError(entry.path().string() + ": has the same number as " + other->second.string());
  }
  std::map<long, ImageWithPose> posed;
  int num_without_pose = 0;
  for (const fs::path& image : ImagesOf(camera / "image")) {
    const std::optional<long> number = NumberInName(image.stem().string());
    const auto pose = number ? poses.find(*number) : poses.end();
    if (pose == poses.end()) {
      ++num_without_pose;
      continue;
    }
    const auto [other, is_new] = posed.emplace(*number, ImageWithPose{image, pose->second});
    if (!is_new) throw InputError(image.string() + ": has the same number as " + other->second.image.string());
  }
  if (num_without_pose == 0) return {std::move(posed)};
  return {std::move(posed),
          {std::to_string(num_without_pose) + " images in " + (camera / "image").string() +
           " have no pose of their number and are left out"}};
}

Rigid3d ReadPose(const fs::path& file) { return PoseOfMatrix(NumbersOfFile(file), 1, file.string()); }

fs::path RootOrFail(const fs::path& source) {
  const fs::path root = RootOf(source);
  if (!root.empty()) return root;
  throw InputError(source.string() + ": contains no CalibrationInfo.yaml, and neither does its parent folder");
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  const fs::path root = RootOrFail(source);
  const Info info = ReadInfo(root);
  set.remarks = info.remarks;
  set.files.push_back(info.file);
  set.setup = info.setup;
  set.target = info.target;
  const bool is_root = fs::equivalent(root, source);
  const fs::path camera = is_root ? root / (info.prefix + "1") : fs::path(source);
  if (is_root && info.num_cameras > 1) {
    set.remarks.push_back("of " + std::to_string(info.num_cameras) +
                          " cameras the first one is read; name a camera's folder for another, or 'heba import' all");
  }
  const fs::path intrinsics = camera / "intrinsic_pars_file.yaml";
  if (fs::exists(intrinsics)) {
    const auto [read, remarks] = ReadCamera(intrinsics, "camera");
    set.camera = read;
    set.remarks.insert(set.remarks.end(), remarks.begin(), remarks.end());
    set.files.push_back(intrinsics);
  }
  const auto [images, remarks] = PosedImagesOf(camera);
  set.remarks.insert(set.remarks.end(), remarks.begin(), remarks.end());
  for (const auto& [number, posed] : images) {
    set.files.push_back(posed.pose);
    ImportedCapture capture = CaptureOf(posed.image, 0);
    capture.base_from_gripper = ReadPose(posed.pose);
    set.captures.push_back(std::move(capture));
  }
  return set;
}

// The pose of a capture and the file that states it.
struct CapturePose {
  fs::path file;
  ImportedCellCapture capture;
};

// Returns the captures with the images of the camera with this index in those of their numbers. The cameras' own
// records of a pose may differ by the noise of the arm's encoders; the first one holds.
std::map<long, CapturePose> WithImages(std::map<long, CapturePose> captures,
                                       const std::map<long, ImageWithPose>& images, size_t camera) {
  constexpr double kSameM = 0.1e-3;
  const double same_rad = DegToRad(0.01);
  for (const auto& [number, posed] : images) {
    const Rigid3d pose = ReadPose(posed.pose);
    const auto [found, is_new] = captures.emplace(number, CapturePose{posed.pose, {pose, {}}});
    const Rigid3d& other = found->second.capture.base_from_gripper;
    const double distance_m = DistanceM(other, pose);
    const double angle_rad = AngleRad(other, pose);
    if (distance_m > kSameM || angle_rad > same_rad) {
      throw InputError(posed.pose.string() + ": is " + Significant(1000 * distance_m, 2) + " mm and " +
                       Significant(RadToDeg(angle_rad), 2) + " deg from " + found->second.file.string() +
                       ", but images of one number belong to one pose of the robot; import the cameras one by one");
    }
    std::vector<std::string>& names = found->second.capture.images;
    names.resize(std::max(names.size(), camera + 1));
    names[camera] = posed.image.filename().string();
  }
  return captures;
}

// Returns the file with the true pose of a camera; empty if there is none.
fs::path TruthOf(const fs::path& root, int number) {
  const std::string name = "gt_cam" + std::to_string(number) + ".csv";
  std::error_code error;
  for (const fs::path& file : {root / name, root / "GT" / name}) {
    if (fs::is_regular_file(file, error)) return file;
  }
  return {};
}

std::optional<ImportedCell> ReadLongForm(const fs::path& source) {
  ImportedCell rig;
  const fs::path root = RootOrFail(source);
  const Info info = ReadInfo(root);
  rig.remarks = info.remarks;
  if (!fs::equivalent(root, source) || info.num_cameras == 1) return std::nullopt;
  rig.files.push_back(info.file);
  rig.setup = info.setup;
  rig.target_name = "chessboard";
  rig.target = info.target;
  std::map<long, CapturePose> captures;
  std::vector<std::string> absent;
  for (int number = 1; number <= info.num_cameras; ++number) {
    const std::string name = info.prefix + std::to_string(number);
    const auto [images, remarks] = PosedImagesOf(root / name);
    rig.remarks.insert(rig.remarks.end(), remarks.begin(), remarks.end());
    if (images.empty()) {
      absent.push_back(name);
      continue;
    }
    captures = WithImages(std::move(captures), images, rig.cameras.size());
    for (const auto& [place, posed] : images) rig.files.push_back(posed.pose);
    ImportedCamera& camera = rig.cameras.emplace_back();
    camera.name = name;
    camera.images = root / name / "image";
    const fs::path intrinsics = root / name / "intrinsic_pars_file.yaml";
    if (fs::exists(intrinsics)) {
      const auto [read, of_camera] = ReadCamera(intrinsics, name);
      camera.camera = read;
      rig.remarks.insert(rig.remarks.end(), of_camera.begin(), of_camera.end());
      rig.files.push_back(intrinsics);
    }
    const fs::path truth = TruthOf(root, number);
    if (!truth.empty() && info.setup == Setup::kEyeToHand) {
      camera.mount_from_camera = ReadPose(truth);
      rig.files.push_back(truth);
    }
  }
  if (rig.cameras.empty()) {
    throw InputError(info.file.string() + ": states " + std::to_string(info.num_cameras) + " cameras, but no folder " +
                     info.prefix + "N has images with poses of their numbers");
  }
  if (!absent.empty()) rig.remarks.push_back("no images with poses, left out: " + Join(absent, ", "));
  for (auto& [number, capture] : captures) {
    capture.capture.images.resize(rig.cameras.size());
    rig.captures.push_back(std::move(capture.capture));
  }
  return rig;
}

}  // namespace

ImportReader ImportReader_mchec() { return {Matches, Read, ReadLongForm}; }

}  // namespace heba
