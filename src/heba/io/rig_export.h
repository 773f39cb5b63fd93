// Export of a rig's result to the formats of other software: one file for each camera and, where the format allows it,
// files with all cameras and bases; for formats of an arm's kinematics, one file for each arm.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/rig_evaluation.h"
#include "heba/io/export.h"

namespace heba {

struct ExportedFile {
  std::string name;
  std::string text;        // Empty if the format cannot hold these poses.
  std::string reason;      // Why not, in words.
  std::string camera;      // The camera whose file this is; empty for files with several poses.
  bool holds_all = false;  // True for a file with all cameras.
  std::string arm = {};    // The arm whose file this is; empty for files with poses.
};

// Returns the pose and the intrinsics of each camera, in base_link or tool0 or, if there are several arms, in
// ARM_base_link or ARM_tool0. The frame of a camera is called NAME_optical_frame. The base of the first arm is the
// world.
std::vector<ExportRequest> RigExportRequests(const RigResult& result);
// Returns the pose of each base but the first in the first one.
std::vector<ExportRequest> BaseExportRequests(const RigResult& result);

// Returns the files of a format: CAMERA.FILE_NAME for each camera and, if there are several poses and the format holds
// several, cameras.SUFFIX with all cameras and, for ROS, bases. A URDF has one root, so that poses with several roots
// (the bases and each gripper) are in one file for each, cameras.ROOT.urdf; cameras.urdf.xacro has all of them for the
// description of the cell, which defines the roots. The kinematics of an arm are FILE_NAME or, if there are several
// arms, ARM.FILE_NAME for each; a file without text stands for an arm whose errors were not estimated.
std::vector<ExportedFile> ExportRig(const ExportFormat& format, const std::vector<ExportRequest>& cameras,
                                    const std::vector<ExportRequest>& bases, const RigResult& result);

}  // namespace heba
