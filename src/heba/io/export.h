// Export of a result to the formats of other software: those of export_formats.def, and the camera's pose in every
// robot pose format (pose_formats.def).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"
#include "heba/io/pose_formats.h"

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

// The poses that a format can represent.
enum class ExportHolds {
  kAnyPose,        // The pose of any frame in any other frame.
  kOpticalCamera,  // The pose of the optical frame in the parent only.
  kLens,           // The camera's intrinsics; at most the pose of the optical frame.
};

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

// Functions for the files in export_formats/.

// The beginning of the first comment of every exported file.
inline constexpr std::string_view kExportMark = "heba, calibration ";
// Returns the comments of an exported file: its content, the meaning of the frames, and the uncertainty of the pose.
// Each entry is one line without a comment mark and without characters that could end a comment.
std::vector<std::string> ExportRemarks(const ExportRequest& request);
// Returns a name that is safe in a comment: '-', '<', '>', control characters and non-ASCII characters, which could end
// a comment, become underscores.
std::string PlainText(std::string text);
// Returns the lines, each preceded by `mark` and followed by a line end.
std::string CommentLines(const std::vector<std::string>& lines, const std::string& mark);

// Returns the pose of the body frame that camera drivers use (x forward, y left, z up) in the optical frame. Both
// frames have the same origin.
Rigid3d OpticalFromBody();

// Returns a decimal number that reads back as the same value and always has a decimal point, because YAML readers take
// 1e-05 for a text and 0 for an integer.
std::string DecimalText(double number);
std::string JoinNumbers(const std::vector<double>& numbers, std::string_view separator);
// Returns x, y, z (m), qx, qy, qz, qw, with qw not negative.
std::vector<double> TranslationAndQuaternion(const Rigid3d& pose);

// Returns OpenCV's lens of the camera; a Failure that names the camera model if `software` needs one and there is none.
Outcome<OpenCvLens> NeedOpenCvLens(const Camera& camera, const std::string& software);

// Returns text in double quotes that is valid in YAML and in Python.
std::string QuotedForYaml(std::string_view text);

}  // namespace heba
