// A result in the forms that other software reads: those of export_formats.def, and the camera's pose in every form of
// robot pose (pose_formats.def).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"
#include "heba/io/pose_formats.h"

namespace heba {

// The kind of a frame of an exported pose.
enum class ExportFrame {
  kBase,     // The robot's base, as the robot reports its poses.
  kGripper,  // The flange or tool, as the robot reports it.
  kOptical,  // The camera, x right, y down, z forward.
  kBody,     // The camera's body, x forward, y left, z up, at the place of the optical frame.
  kLink,     // A frame of the camera's own that the user has given by its pose.
};

// What is exported, and the names that it has in the other software.
struct ExportRequest {
  std::string name;    // The run's.
  std::string method;  // The estimate's.
  Setup setup = Setup::kEyeToHand;
  Rigid3d parent_from_child;
  ExportFrame parent = ExportFrame::kBase;
  ExportFrame child = ExportFrame::kOptical;
  std::string parent_frame;  // The frames' names.
  std::string child_frame;
  // One-sigma covariance of the pose, of the tangent in the child's frame (m, rad); nothing if it is not known.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  // The poses are those of a Universal Robots controller, in its own base.
  bool is_ur_controller = false;
  Camera camera;
  std::string length_unit = "m";  // Of the form `matrix`: m or mm.
};

// The pose of the camera's optical frame, from an estimate that is ok, with the usual names: base_link (`base` for a
// Universal Robots controller) or tool0, and camera_optical_frame.
ExportRequest MakeExportRequest(const RunResult& result, const Estimate& estimate, bool is_ur_controller = false);
// The pose of another frame of the camera in its place: `optical_from_child` is that frame's pose in the optical one.
ExportRequest WithChild(ExportRequest request, ExportFrame child, const Rigid3d& optical_from_child);
// The pose of the parent in the child: the two change places.
ExportRequest Inverted(ExportRequest request);

// The room that a format has.
enum class ExportHolds {
  kAnyPose,        // The pose of any frame in any other.
  kOpticalCamera,  // The pose of the optical frame in the parent and nothing else.
  kLens,           // The camera's intrinsics; of poses at most that of the optical frame.
};

struct ExportFormat {
  std::string name;
  std::string description;
  std::string file_name;  // What such a file is usually called.
};
// Those of export_formats.def, then those of pose_formats.def.
const std::vector<ExportFormat>& ExportFormats();

// The text of a file. A Failure if the form cannot hold this camera or this pose. `format` is one of ExportFormats().
Outcome<std::string> ExportText(const ExportFormat& format, const ExportRequest& request);

// For the files in export_formats/.

// The beginning of the comments of every file.
inline constexpr std::string_view kExportMark = "heba, calibration ";
// Returns the comments of every file: what it is, which frames are meant, and how well the pose is known. A line an
// entry, without a comment's mark and free of what could end one.
std::vector<std::string> ExportRemarks(const ExportRequest& request);
// A name as it can stand in a comment: what is no plain letter could end one.
std::string PlainText(std::string text);
// Each behind `mark`, and at the end of a line.
std::string CommentLines(const std::vector<std::string>& lines, const std::string& mark);

// The frame that cameras' drivers call the body: x forward, y left, z up; at the same place.
Rigid3d OpticalFromBody();

// A number that reads back as the same, everywhere as one that is not whole: YAML's readers take 1e-05 for a text and 0
// for an integer.
std::string DecimalText(double number);
std::string JoinNumbers(const std::vector<double>& numbers, std::string_view separator);
// x, y, z (m), and qx, qy, qz, qw, w not negative.
std::vector<double> TranslationAndQuaternion(const Rigid3d& pose);

// OpenCV's coefficients of the camera's lens: k1 k2 p1 p2 k3 [k4 k5 k6], or four of a fisheye lens; none of a pinhole.
std::vector<double> OpenCvDistortion(const Camera& camera);
inline bool IsFisheye(const Camera& camera) { return camera.model == "kannala_brandt4"; }

// Text within double quotes, of YAML and Python.
std::string QuotedForYaml(std::string_view text);

}  // namespace heba
