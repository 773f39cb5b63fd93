// Export of a result to the formats of other software: those of export_formats.def, and the camera's pose in every
// robot pose format (pose_formats.def).
//
//   const heba::RunResult result = heba::ReadResult("runs/cell/result.json");
//   const heba::ExportRequest request = heba::MakeExportRequest(result, *heba::FindRefined(result));
//   for (const heba::ExportFormat& format : heba::ExportFormats()) {
//     const heba::Outcome<std::string> text = heba::ExportText(format, request);
//     if (text) std::ofstream(format.file_name) << *text;
//   }
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

// The frames between which an exported pose is given.
enum class ExportFrame {
  kBase,     // The robot's base, as the robot reports its poses.
  kGripper,  // The flange or tool, as the robot reports it.
  kOptical,  // The camera's optical frame: x right, y down, z forward.
  kBody,     // The camera's body frame: x forward, y left, z up, with the origin of the optical frame.
  kLink,     // A frame of the camera whose pose was given by the user.
};

// The data to export, with the names that they have in the other software.
struct ExportRequest {
  std::string name;    // Name of the run.
  std::string method;  // Method of the estimate.
  Setup setup = Setup::kEyeToHand;
  Rigid3d parent_from_child;
  ExportFrame parent = ExportFrame::kBase;
  ExportFrame child = ExportFrame::kOptical;
  std::string parent_frame;  // Name of the parent frame.
  // Name of the child frame.
  std::string child_frame;
  // Covariance of the pose (one sigma), by the tangent in the child's frame (m, rad); nothing if it is unknown.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  // True if the poses are those of a Universal Robots controller, in the controller's own base frame.
  bool is_ur_controller = false;
  Camera camera;
  std::optional<Arm> arm;         // With its estimated errors; nothing if they were not estimated.
  std::optional<Grade> grade;     // The grade of the run's verdict; nothing if it is not known.
  std::string length_unit = "m";  // For the format `matrix`: m or mm.
};

// Returns the pose of the camera's optical frame for an estimate that is ok, with the usual frame names: base_link
// (`base` for a Universal Robots controller) or tool0, and camera_optical_frame.
ExportRequest MakeExportRequest(const RunResult& result, const Estimate& estimate, bool is_ur_controller = false);
// Replaces the optical frame by another frame of the camera; `optical_from_child` is the pose of that frame in the
// optical frame.
ExportRequest WithChild(ExportRequest request, ExportFrame child, const Rigid3d& optical_from_child);
// Exchanges parent and child: the result is the pose of the parent in the child.
ExportRequest Inverted(ExportRequest request);

struct ExportFormat {
  std::string name;
  std::string description;
  std::string file_name;  // Usual name of such a file.
};
// Returns the formats of export_formats.def, then those of pose_formats.def.
const std::vector<ExportFormat>& ExportFormats();

// Returns the text of a file. `format` is one of ExportFormats(). Returns a Failure if the format cannot represent this
// camera or this pose.
Outcome<std::string> ExportText(const ExportFormat& format, const ExportRequest& request);

}  // namespace heba
