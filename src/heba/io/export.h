// Export of a result to the formats of other software: those of export_formats.def, and the camera's pose in every
// robot pose format (pose_formats.def).
//
//   const heba::RunResult result = heba::ReadWholeResult("runs/cell/result.json");
//   const heba::ExportRequest request = heba::MakeExportRequests(result).cameras[0];  // heba/io/export_files.h
//   for (const heba::ExportFormat& format : heba::ExportFormats()) {
//     const heba::Outcome<std::string> text = heba::ExportText(format, request);
//     if (text) std::ofstream(format.file_name) << *text;
//   }
#pragma once

#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/io/export_request.h"

namespace heba {

// Replaces the optical frame by another frame of the camera; `optical_from_child` is the pose of that frame in the
// optical frame. NAME_optical_frame becomes NAME_link.
ExportRequest WithChild(ExportRequest request, ExportFrame child, const Rigid3d& optical_from_child);
// Exchanges parent and child: the result is the pose of the parent in the child.
ExportRequest Inverted(ExportRequest request);

// Returns the formats of export_formats.def, then those of pose_formats.def.
const std::vector<ExportFormat>& ExportFormats();

// Returns the text of a file. `format` is one of ExportFormats(). Returns a Failure if the format cannot represent this
// camera or this pose.
Outcome<std::string> ExportText(const ExportFormat& format, const ExportRequest& request);

}  // namespace heba
