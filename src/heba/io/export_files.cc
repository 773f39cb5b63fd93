#include "heba/io/export_files.h"

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

ExportedFile FileOf(const std::string& name, const Outcome<std::string>& text, ExportedContent content) {
  return {name, text ? *text : "", text ? "" : text.reason(), content, "", {}};
}

// Returns the file of a camera or of an arm; its name begins with that of the part if `is_named`.
ExportedFile FileOf(const ExportFormat& format, const ExportRequest& request, ExportedContent content, bool is_named) {
  const std::string begin = is_named && !request.part.empty() ? request.part + "." : "";
  ExportedFile file = FileOf(begin + format.file_name, ExportText(format, request), content);
  file.part = request.part;
  file.format = format;
  return file;
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
std::string ArmFrame(const Problem& rig, size_t robot, const std::string& frame) {
  return rig.robots.size() == 1 ? frame : FrameName(rig.robots[robot]) + "_" + frame;
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
    files.push_back(
        FileOf("cameras." + root + "." + format.suffix, format.write(of_root), ExportedContent::kPosesOfOneRoot));
  }
  files.push_back(FileOf(std::string("cameras.") + format.suffix, format.write(poses), ExportedContent::kAllPoses));
  return files;
}

}  // namespace

ExportRequests MakeExportRequests(const RunResult& result, const std::string& method,
                                  const std::vector<bool>& is_ur_controller) {
  const Problem& rig = result.rig;
  const auto is_ur = [&](size_t robot) { return robot < is_ur_controller.size() && is_ur_controller[robot]; };
  const auto base_of = [&](size_t robot) { return ArmFrame(rig, robot, is_ur(robot) ? "base" : "base_link"); };
  ExportRequest common;
  common.name = result.name;
  common.method = method;
  common.grade = result.verdict.grade;
  ExportRequests requests;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const ProblemCamera& camera = rig.cameras[c];
    const size_t robot = camera.mount.robot;
    const bool is_carried = camera.mount.part == Mount::Part::kGripper;
    ExportRequest& request = requests.cameras.emplace_back(common);
    request.part = camera.name;
    request.setup = is_carried ? Setup::kEyeInHand : Setup::kEyeToHand;
    request.parent_from_child = result.solution.poses.mount_from_camera[c];
    request.parent = is_carried ? ExportFrame::kGripper : ExportFrame::kBase;
    request.parent_frame = is_carried ? ArmFrame(rig, robot, "tool0") : base_of(robot);
    request.child_frame = FrameName(camera.name.empty() ? "camera" : camera.name) + "_optical_frame";
    request.covariance = PoseCovarianceOf(result.solution.covariance, CameraPoseBlock(camera));
    request.is_ur_controller = is_ur(robot);
    request.camera = result.solution.cameras[c];
  }
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    ExportRequest& of_arm = requests.arms.emplace_back(common);
    of_arm.part = rig.robots[r];
    const RobotSummary* const arm = FindEstimatedArm(result, r);
    if (arm != nullptr) {
      of_arm.arm = WithChanges(arm->nominal, arm->errors);
      of_arm.rigid = arm->rigid;
      if (arm->rigid) of_arm.rigid_arm = WithChanges(arm->nominal, arm->rigid->errors);
    }
    if (arm == nullptr && !of_arm.part.empty()) of_arm.why_no_arm = WhyNotEstimated(result, r);
    if (r == 0) continue;
    ExportRequest& request = requests.bases.emplace_back(common);
    request.part = rig.robots[r];
    request.parent_from_child = result.solution.poses.world_from_base[r];
    request.child = ExportFrame::kBase;
    request.parent_frame = base_of(0);
    request.child_frame = base_of(r);
    request.covariance = PoseCovarianceOf(result.solution.covariance, BaseBlock(rig.robots[r]));
    request.is_ur_controller = is_ur(0) || is_ur(r);
  }
  return requests;
}

std::vector<ExportedFile> ExportFiles(const ExportFormat& format, const ExportRequests& requests) {
  std::vector<ExportedFile> files;
  if (HeldBy(format) == ExportHolds::kArm) {
    const bool is_named = requests.arms.size() > 1;
    for (const ExportRequest& arm : requests.arms) {
      files.push_back(FileOf(format, arm, ExportedContent::kArm, is_named));
    }
    return files;
  }
  std::string fault;  // The fault of a camera that a file with all cannot hold.
  for (const ExportRequest& camera : requests.cameras) {
    files.push_back(FileOf(format, camera, ExportedContent::kCamera, true));
    if (fault.empty() && !files.back().reason.empty()) fault = "camera " + camera.part + ": " + files.back().reason;
  }
  for (const PosesFormat& entry : kPosesFormats) {
    if (format.name != entry.format) continue;
    std::vector<ExportRequest> poses;
    if (entry.holds_bases) poses = requests.bases;
    poses.insert(poses.end(), requests.cameras.begin(), requests.cameras.end());
    if (poses.size() < 2) continue;
    for (ExportedFile& file : FilesOf(entry, poses)) {
      if (!fault.empty()) file = {file.name, "", fault, file.content, "", {}};
      files.push_back(std::move(file));
    }
  }
  return files;
}

}  // namespace heba
