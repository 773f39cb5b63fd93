// Functions for the files in export_formats/.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/io/export_request.h"
#include "heba/io/pose_formats.h"

namespace heba {

// The poses that a format can represent.
enum class ExportHolds {
  kAnyPose,        // The pose of any frame in any other frame.
  kOpticalCamera,  // The pose of the optical frame in the parent only.
  kLens,           // The camera's intrinsics; at most the pose of the optical frame.
  kArm,            // The estimated kinematics of the arm; no pose.
};
// Returns what one of ExportFormats() can represent.
ExportHolds HeldBy(const ExportFormat& format);

// Formats that hold several poses in one file. A Failure if they cannot hold these. In the first three, a frame has one
// pose at most. A URDF needs all poses in one tree of frames (RootFrames); a fragment, which does not define the frames
// in which the poses are given, is included in the xacro file of a cell that defines them.
Outcome<std::string> ExportPoses_urdf(const std::vector<ExportRequest>& poses);
Outcome<std::string> ExportPoses_urdf_fragment(const std::vector<ExportRequest>& poses);
Outcome<std::string> ExportPoses_ros2(const std::vector<ExportRequest>& poses);
Outcome<std::string> ExportPoses_kalibr(const std::vector<ExportRequest>& cameras);

// Returns the frames that have no pose in another one, in their order.
std::vector<std::string> RootFrames(const std::vector<ExportRequest>& poses);
// Returns the frame that has two poses; empty if none has.
std::string FrameWithTwoPoses(const std::vector<ExportRequest>& poses);

// The beginning of the first comment of every exported file.
inline constexpr std::string_view kExportMark = "heba, calibration ";
// Returns the comments of an exported file: its content, the meaning of the frames, and the uncertainty of the pose.
// Each entry is one line without a comment mark and without characters that could end a comment.
std::vector<std::string> ExportRemarks(const ExportRequest& request);
// Likewise for a file of the arm's kinematics.
std::vector<std::string> ArmRemarks(const ExportRequest& request);
// Likewise for a file that holds the arm's geometry alone, of GeometryOf.
std::vector<std::string> GeometryRemarks(const ExportRequest& request);
// Returns the arm of a request without compliances. If its joints yield, its geometry stands for that at the captures.
Arm GeometryOf(const ExportRequest& request);
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

// Returns the form of a pose in URDF and in ROS' parameters: x, y, z in m, then roll, pitch and yaw in rad about fixed
// axes, R = Rz(yaw) Ry(pitch) Rx(roll).
const PoseFormat& RollPitchYawFormat();
// Returns the element of a URDF that states a pose: <origin xyz="..." rpy="..."/>.
std::string UrdfOrigin(const Rigid3d& pose);

// Returns OpenCV's lens of the camera; a Failure that names the camera model if `software` needs one and there is none.
Outcome<OpenCvLens> NeedOpenCvLens(const Camera& camera, const std::string& software);

// Returns text in double quotes that is valid in YAML and in Python.
std::string QuotedForYaml(std::string_view text);

}  // namespace heba
