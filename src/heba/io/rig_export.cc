#include "heba/io/rig_export.h"

#include <algorithm>
#include <string_view>

#include "heba/io/export_format.h"

namespace heba {
namespace {

struct CamerasFormat {
  const char* name;
  Outcome<std::string> (*write)(const std::vector<ExportRequest>& cameras);
};
constexpr CamerasFormat kCamerasFormats[] = {
    {"urdf", &ExportCameras_urdf}, {"ros2", &ExportCameras_ros2}, {"kalibr", &ExportCameras_kalibr}};

ExportedFile FileOf(const std::string& name, const Outcome<std::string>& text, const std::string& camera) {
  return text ? ExportedFile{name, *text, "", camera} : ExportedFile{name, "", text.reason(), camera};
}

}  // namespace

std::vector<ExportRequest> RigExportRequests(const RigResult& result) {
  const RigProblem& rig = result.rig;
  std::vector<ExportRequest> requests;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const RigCamera& camera = rig.cameras[c];
    const bool is_carried = camera.mount.part == Mount::Part::kGripper;
    ExportRequest& request = requests.emplace_back();
    request.name = result.name;
    request.method = kBundleMethod;
    request.setup = is_carried ? Setup::kEyeInHand : Setup::kEyeToHand;
    request.parent_from_child = result.solution.poses.mount_from_camera[c];
    request.parent = is_carried ? ExportFrame::kGripper : ExportFrame::kBase;
    const std::string arm = rig.robots.size() == 1 ? "" : rig.robots[camera.mount.robot] + "_";
    request.parent_frame = arm + (is_carried ? "tool0" : "base_link");
    request.child_frame = camera.name + "_optical_frame";
    std::replace(request.child_frame.begin(), request.child_frame.end(), '-', '_');
    std::replace(request.parent_frame.begin(), request.parent_frame.end(), '-', '_');
    request.covariance = PoseCovarianceOf(result.solution.covariance, CameraPoseBlock(camera));
    request.camera = result.solution.cameras[c];
  }
  return requests;
}

std::vector<ExportedFile> ExportRig(const ExportFormat& format, const std::vector<ExportRequest>& cameras,
                                    const RigResult& result) {
  std::vector<ExportedFile> files;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const std::string& camera = result.rig.cameras[c].name;
    files.push_back(FileOf(camera + "." + format.file_name, ExportText(format, cameras[c]), camera));
  }
  for (const CamerasFormat& entry : kCamerasFormats) {
    if (format.name == entry.name && cameras.size() > 1) {
      constexpr std::string_view kCamera = "camera.";
      const bool is_of_camera = format.file_name.starts_with(kCamera);
      files.push_back(FileOf("cameras." + (is_of_camera ? format.file_name.substr(kCamera.size()) : format.file_name),
                             entry.write(cameras), ""));
    }
  }
  return files;
}

}  // namespace heba
