// Export of a result to the formats of other software: one file for each camera and, where the format allows it, files
// with all cameras and bases; for formats of an arm's kinematics, one file for each arm.
//
//   const heba::ExportRequests requests = heba::MakeExportRequests(heba::ReadWholeResult("runs/cell/result.json"));
//   for (const heba::ExportFormat& format : heba::ExportFormats()) {
//     for (const heba::ExportedFile& file : heba::ExportFiles(format, requests)) {
//       if (!file.text.empty()) std::ofstream(file.name) << file.text;
//     }
//   }
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/run_result.h"
#include "heba/io/export.h"

namespace heba {

// The poses and the arms of a result.
struct ExportRequests {
  std::vector<ExportRequest> cameras;
  std::vector<ExportRequest> bases;  // The pose of each base but the first in the first one.
  std::vector<ExportRequest> arms;   // Without poses.
};

// Returns the pose and the intrinsics of each camera, in base_link (`base` if the poses of the arm are those of a
// Universal Robots controller) or tool0 or, if there are several arms, in ARM_base_link or ARM_tool0. The frame of a
// camera is called NAME_optical_frame, and camera_optical_frame if it has no name. The base of the first arm is the
// world. `method` is that of the estimate in the result; `is_ur_controller` has an entry for each arm, or none.
ExportRequests MakeExportRequests(const RunResult& result, const std::string& method = kBundleMethod,
                                  const std::vector<bool>& is_ur_controller = {});

// An exported file holds one camera, one arm, or several poses.
enum class ExportedContent { kCamera, kArm, kPosesOfOneRoot, kAllPoses };

struct ExportedFile {
  std::string name;
  std::string text;    // Empty if the format cannot hold these poses.
  std::string reason;  // Why not, in words.
  ExportedContent content = ExportedContent::kCamera;
  std::string part;     // Name of the camera or of the arm; empty if it has none, and for files with several poses.
  ExportFormat format;  // Not set for files with several poses.
};

// Returns the files of a format: CAMERA.FILE_NAME for each camera and, if there are several poses and the format holds
// several, cameras.SUFFIX with all cameras and, for ROS, bases. A URDF has one root, so that poses with several roots
// (the bases and each gripper) are in one file for each, cameras.ROOT.urdf; cameras.urdf.xacro has all of them for the
// description of the cell, which defines the roots. The kinematics of an arm are FILE_NAME or, if there are several
// arms, ARM.FILE_NAME for each; a file without text stands for an arm whose errors were not estimated. The file of a
// camera without a name is FILE_NAME.
std::vector<ExportedFile> ExportFiles(const ExportFormat& format, const ExportRequests& requests);

}  // namespace heba
