// Export of a rig's result to the formats of other software: one file for each camera and, where the format allows it,
// one with all cameras.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/rig_evaluation.h"
#include "heba/io/export.h"

namespace heba {

struct ExportedFile {
  std::string name;
  std::string text;    // Empty if the format cannot hold the camera, or these cameras.
  std::string reason;  // Why not, in words.
  std::string camera;  // The camera whose file this is; empty for the file with all.
};

// Returns the pose and the intrinsics of each camera, in base_link or tool0 or, if there are several arms, in
// ARM_base_link or ARM_tool0. The frame of a camera is called NAME_optical_frame. The base of the first arm is the
// world.
std::vector<ExportRequest> RigExportRequests(const RigResult& result);

// Returns the files of a format: CAMERA.FILE_NAME for each camera, and cameras.FILE_NAME with all if the format holds
// several.
std::vector<ExportedFile> ExportRig(const ExportFormat& format, const std::vector<ExportRequest>& cameras,
                                    const RigResult& result);

}  // namespace heba
