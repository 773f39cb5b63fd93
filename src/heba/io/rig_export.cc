#include "heba/io/rig_export.h"

#include <algorithm>

#include "heba/io/export_format.h"

namespace heba {
namespace {

// A kind of file with several poses.
struct PosesFormat {
  const char* format;
  const char* suffix;  // The file's name ends with it.
  Outcome<std::string> (*write)(const std::vector<ExportRequest>& poses);
  bool holds_bases;
  bool has_one_root;  // Whether there is a file for each root frame.
};
constexpr PosesFormat kPosesFormats[] = {
    {"urdf", "urdf", &ExportPoses_urdf, true, true},
    {"urdf", "urdf.xacro", &ExportPoses_urdf_fragment, true, false},
    {"ros2", "launch.py", &ExportPoses_ros2, true, false},
    {"kalibr", "camchain.yaml", &ExportPoses_kalibr, false, false},
};

ExportedFile FileOf(const std::string& name, const Outcome<std::string>& text) {
  return text ? ExportedFile{name, *text, "", "", false} : ExportedFile{name, "", text.reason(), "", false};
}

// Returns the frame at the root of the tree of frames with this one.
std::string RootOf(const std::vector<ExportRequest>& poses, std::string frame) {
  // A tree is at most as high as it has poses.
  for (size_t i = 0; i < poses.size(); ++i) {
    const auto above =
        std::find_if(poses.begin(), poses.end(), [&](const ExportRequest& pose) { return pose.child_frame == frame; });
    if (above != poses.end()) frame = above->parent_frame;
  }
  return frame;
}

std::string FrameName(std::string name) {
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

// Returns the name of a frame of an arm.
std::string ArmFrame(const RigProblem& rig, size_t robot, const std::string& frame) {
  return rig.robots.size() == 1 ? frame : FrameName(rig.robots[robot]) + "_" + frame;
}

// Returns the files with the kinematics of the arms.
std::vector<ExportedFile> ArmFilesOf(const ExportFormat& format, const RigResult& result) {
  const std::vector<std::string>& robots = result.rig.robots;
  std::vector<ExportedFile> files;
  for (size_t r = 0; r < robots.size(); ++r) {
    const RobotSummary* const arm = FindEstimatedArm(result, r);
    const std::string name = (robots.size() == 1 ? "" : robots[r] + ".") + format.file_name;
    if (arm != nullptr) {
      ExportRequest request;
      request.name = result.name;
      request.method = kBundleMethod;
      request.grade = result.verdict.grade;
      request.arm = WithChanges(arm->nominal, arm->errors);
      files.push_back(FileOf(name, ExportText(format, request)));
    } else {
      files.push_back({name, "", WhyNotEstimated(result, r), "", false});
    }
    files.back().arm = robots[r];
  }
  return files;
}

// Returns the files of one kind with several poses.
std::vector<ExportedFile> FilesOf(const PosesFormat& format, const std::vector<ExportRequest>& poses) {
  std::vector<ExportedFile> files;
  const std::vector<std::string> roots = RootFrames(poses);
  for (const std::string& root : roots) {
    if (!format.has_one_root || roots.size() == 1) break;
    std::vector<ExportRequest> of_root;
    for (const ExportRequest& pose : poses) {
      if (RootOf(poses, pose.parent_frame) == root) of_root.push_back(pose);
    }
    files.push_back(FileOf("cameras." + root + "." + format.suffix, format.write(of_root)));
  }
  files.push_back(FileOf(std::string("cameras.") + format.suffix, format.write(poses)));
  files.back().holds_all = true;
  return files;
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
    request.grade = result.verdict.grade;
    request.setup = is_carried ? Setup::kEyeInHand : Setup::kEyeToHand;
    request.parent_from_child = result.solution.poses.mount_from_camera[c];
    request.parent = is_carried ? ExportFrame::kGripper : ExportFrame::kBase;
    request.parent_frame = ArmFrame(rig, camera.mount.robot, is_carried ? "tool0" : "base_link");
    request.child_frame = FrameName(camera.name) + "_optical_frame";
    request.covariance = PoseCovarianceOf(result.solution.covariance, CameraPoseBlock(camera));
    request.camera = result.solution.cameras[c];
  }
  return requests;
}

std::vector<ExportRequest> BaseExportRequests(const RigResult& result) {
  const RigProblem& rig = result.rig;
  std::vector<ExportRequest> requests;
  for (size_t r = 1; r < rig.robots.size(); ++r) {
    ExportRequest& request = requests.emplace_back();
    request.name = result.name;
    request.method = kBundleMethod;
    request.grade = result.verdict.grade;
    request.parent_from_child = result.solution.poses.world_from_base[r];
    request.child = ExportFrame::kBase;
    request.parent_frame = ArmFrame(rig, 0, "base_link");
    request.child_frame = ArmFrame(rig, r, "base_link");
    request.covariance = PoseCovarianceOf(result.solution.covariance, BaseBlock(rig.robots[r]));
  }
  return requests;
}

std::vector<ExportedFile> ExportRig(const ExportFormat& format, const std::vector<ExportRequest>& cameras,
                                    const std::vector<ExportRequest>& bases, const RigResult& result) {
  if (HeldBy(format) == ExportHolds::kArm) return ArmFilesOf(format, result);
  std::vector<ExportedFile> files;
  std::string fault;  // The fault of a camera that a file with all cannot hold.
  for (size_t c = 0; c < cameras.size(); ++c) {
    const std::string& camera = result.rig.cameras[c].name;
    files.push_back(FileOf(camera + "." + format.file_name, ExportText(format, cameras[c])));
    files.back().camera = camera;
    if (fault.empty() && !files.back().reason.empty()) fault = "camera " + camera + ": " + files.back().reason;
  }
  for (const PosesFormat& entry : kPosesFormats) {
    if (format.name != entry.format) continue;
    std::vector<ExportRequest> poses;
    if (entry.holds_bases) poses = bases;
    poses.insert(poses.end(), cameras.begin(), cameras.end());
    if (poses.size() < 2) continue;
    for (ExportedFile& file : FilesOf(entry, poses)) {
      if (!fault.empty()) file = {file.name, "", fault, "", file.holds_all};
      files.push_back(std::move(file));
    }
  }
  return files;
}

}  // namespace heba
