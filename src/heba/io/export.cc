#include "heba/io/export.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/export_format.h"
#include "heba/io/pose_file.h"
#include "heba/io/pose_formats.h"

namespace heba {

#define HEBA_EXPORT_FORMAT(name, file_name, holds, description) \
  Outcome<std::string> ExportFormat_##name(const ExportRequest& request);
#include "heba/io/export_formats.def"
#undef HEBA_EXPORT_FORMAT

namespace {

using Writer = Outcome<std::string> (*)(const ExportRequest& request);

struct Entry {
  ExportFormat format;
  ExportHolds holds;
  Writer writer;
};

const std::vector<Entry>& Entries() {
  static const std::vector<Entry> entries = {
#define HEBA_EXPORT_FORMAT(name, file_name, holds, description) \
  {{#name, description, file_name}, ExportHolds::holds, &ExportFormat_##name},
#include "heba/io/export_formats.def"
#undef HEBA_EXPORT_FORMAT
  };
  return entries;
}

std::string AnglesInWords(const PoseFormat& format) {
  if (format.rotation == "matrix") return "the 4 x 4 matrix row by row, lengths in " + format.translation_unit;
  const std::string lengths = "x, y, z in " + format.translation_unit;
  if (format.rotation.starts_with("quaternion")) return lengths + ", then a quaternion (" + format.rotation + ")";
  if (format.rotation == "rotation_vector") {
    return lengths + ", then the rotation vector (axis times angle) in " + format.angle_unit;
  }
  const bool is_fixed = format.rotation.starts_with("extrinsic_");
  return lengths + ", then rotations in " + format.angle_unit + " about the axes " +
         format.rotation.substr(format.rotation.find('_') + 1) + ", in this order, each about the " +
         (is_fixed ? "fixed axis" : "already rotated axis");
}

// Returns the number of decimals that resolve a micrometre or about a microradian.
int ControllerDecimals(const PoseFormat& format, size_t number) {
  const std::string& unit = number < 3 ? format.translation_unit : format.angle_unit;
  if (unit == "mm") return 3;
  return unit == "deg" ? 4 : 6;
}

// Returns the pose in the syntax of the robot's controller, such as {X 812.345, Y ...}.
std::string ControllerText(const PoseFormat& format, const ExportRequest& request) {
  const std::vector<double> numbers = NumbersFromPose(format, request.parent_from_child);
  std::string text;
  size_t next = 0;
  for (const char c : format.controller_form) {
    if (c == '%') {
      text += Fixed(numbers[next], ControllerDecimals(format, next));
      ++next;
    } else if (c == '@') {
      text += request.parent == ExportFrame::kGripper ? "UTOOL" : "UFRAME";
    } else {
      text += c;
    }
  }
  return text;
}

std::string RobotPoseText(PoseFormat format, const ExportRequest& request) {
  if (format.rotation == "matrix") format.translation_unit = request.length_unit;
  std::vector<std::string> remarks = ExportRemarks(request);
  remarks.push_back(AnglesInWords(format));
  // Controllers know only frames that are given in the robot's base or on its flange.
  const bool is_controllers = request.parent == ExportFrame::kBase || request.parent == ExportFrame::kGripper;
  if (!format.controller_form.empty() && is_controllers) {
    remarks.push_back("for the controller: " + ControllerText(format, request));
  }
  return CommentLines(remarks, "# ") + PoseFileText({{"", CaptureRole::kNone, request.parent_from_child, 0}}, format);
}

// Returns why the format cannot represent the request; an empty text if it can.
std::string WhyNot(ExportHolds holds, const ExportRequest& request) {
  if (holds == ExportHolds::kArm) {
    if (request.arm || !request.why_no_arm.empty()) return request.why_no_arm;
    return "the estimate '" + request.method + "' has no kinematics of the arm, which this format holds (robot.model)";
  }
  if (holds == ExportHolds::kLens && request.camera.params.empty()) {
    return "an estimate from poses alone has no camera, which this format needs; use urdf, ros2 or a robot's format, "
           "such "
           "as matrix";
  }
  if (holds != ExportHolds::kAnyPose && request.child != ExportFrame::kOptical) {
    return "this format holds the pose of the camera's optical frame in " +
           std::string(request.setup == Setup::kEyeToHand ? "the base" : "the gripper") +
           " only; leave out --child-is and --inverse, or use urdf, ros2 or a robot's format";
  }
  return "";
}

std::string FrameInWords(ExportFrame frame) {
  switch (frame) {
    case ExportFrame::kBase:
      return "the robot's base";
    case ExportFrame::kGripper:
      return "the gripper (flange or tool, as the robot reports it)";
    case ExportFrame::kOptical:
      return "the camera's OPTICAL frame (x right, y down, z forward), not a body frame (x forward, y left, z up)";
    case ExportFrame::kBody:
      return "the camera's BODY frame (x forward, y left, z up) with the origin of the optical frame (x right, y down, "
             "z "
             "forward)";
    case ExportFrame::kLink:
      return "a LINK of the camera, in which the optical frame (x right, y down, z forward) has the pose that was "
             "given";
  }
  return "";
}

std::string SigmasText(const Eigen::Matrix<double, 6, 6>& covariance, Eigen::Index first, double unit) {
  std::vector<std::string> sigmas;
  for (Eigen::Index i = first; i < first + 3; ++i) {
    sigmas.push_back(Significant(std::sqrt(std::max(covariance(i, i), 0.0)) / unit, 2));
  }
  return Join(sigmas, ", ");
}

}  // namespace

ExportRequest WithChild(ExportRequest request, ExportFrame child, const Rigid3d& optical_from_child) {
  // The covariance is transformed by the adjoint: T exp(xi) C = (T C) exp(Adjoint(C^-1) xi).
  const Eigen::Matrix<double, 6, 6> child_by_optical = Adjoint(Inverse(optical_from_child));
  request.parent_from_child = request.parent_from_child * optical_from_child;
  if (request.covariance) {
    request.covariance = child_by_optical * *request.covariance * child_by_optical.transpose();
  }
  request.child = child;
  const std::string name = request.child_frame.substr(0, request.child_frame.rfind("_optical_frame"));
  request.child_frame = name + "_link";
  return request;
}

ExportRequest Inverted(ExportRequest request) {
  // The covariance is transformed by the adjoint: (T exp(xi))^-1 = T^-1 exp(Adjoint(T) (-xi)).
  const Eigen::Matrix<double, 6, 6> parent_by_child = Adjoint(request.parent_from_child);
  if (request.covariance) request.covariance = parent_by_child * *request.covariance * parent_by_child.transpose();
  request.parent_from_child = Inverse(request.parent_from_child);
  std::swap(request.parent, request.child);
  std::swap(request.parent_frame, request.child_frame);
  return request;
}

const std::vector<ExportFormat>& ExportFormats() {
  static const std::vector<ExportFormat> formats = [] {
    std::vector<ExportFormat> all;
    for (const Entry& entry : Entries()) all.push_back(entry.format);
    for (const PoseFormat& format : PoseFormats()) {
      all.push_back({format.name,
                     "the camera's pose in pose format " + format.name + " (" + Join(format.columns, " ") + ")",
                     "camera_" + format.name + ".csv"});
    }
    return all;
  }();
  return formats;
}

ExportHolds HeldBy(const ExportFormat& format) {
  for (const Entry& entry : Entries()) {
    if (entry.format.name == format.name) return entry.holds;
  }
  return ExportHolds::kAnyPose;
}

Outcome<std::string> ExportText(const ExportFormat& format, const ExportRequest& request) {
  for (const Entry& entry : Entries()) {
    if (entry.format.name != format.name) continue;
    const std::string why_not = WhyNot(entry.holds, request);
    if (!why_not.empty()) return Failure{why_not};
    return entry.writer(request);
  }
  const PoseFormat* pose_format = FindPoseFormat(format.name);
  CHECK(pose_format != nullptr) << "export format " << format.name;
  return RobotPoseText(*pose_format, request);
}

namespace {

std::string GradeRemark(Grade grade) { return "the verdict of the run: " + std::string(GradeName(grade)); }

}  // namespace

Arm GeometryOf(const ExportRequest& request) {
  return request.rigid_arm ? *request.rigid_arm : RigidPart(*request.arm);
}

std::vector<std::string> ArmRemarks(const ExportRequest& request) {
  std::vector<std::string> remarks = {std::string(kExportMark) + PlainText(request.name) +
                                          ": the kinematics of the arm " + PlainText(request.arm->name) +
                                          ", estimated with the camera's pose",
                                      "Parameters that no captures determine have their nominal values."};
  if (request.grade) remarks.push_back(GradeRemark(*request.grade));
  return remarks;
}

std::vector<std::string> GeometryRemarks(const ExportRequest& request) {
  std::vector<std::string> remarks = ArmRemarks(request);
  const std::vector<ArmJoint>& joints = request.arm->joints;
  const bool yields =
      std::any_of(joints.begin(), joints.end(), [](const ArmJoint& joint) { return joint.compliance != 0; });
  if (!yields) return remarks;
  remarks.emplace_back("The joints also yield to gravity, which `heba correct` takes into account everywhere.");
  if (request.rigid) {
    remarks.push_back("Lengths, angles and offsets stand for it at the captures, but for " +
                      Significant(1000 * request.rigid->left_m, 2) + " mm and " +
                      Significant(RadToDeg(request.rigid->left_rad), 2) + " deg (root mean squares).");
  } else {
    remarks.emplace_back("Nothing here stands for it.");
  }
  return remarks;
}

std::string PlainText(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~' || c == '-' || c == '<' || c == '>'; }, '_');
  return text;
}

std::vector<std::string> ExportRemarks(const ExportRequest& request) {
  const std::string parent = PlainText(request.parent_frame);
  const std::string child = PlainText(request.child_frame);
  // The setup tells where the camera is, and says nothing of the pose of one base in another.
  const bool is_of_bases = request.parent == ExportFrame::kBase && request.child == ExportFrame::kBase;
  const std::string setup = is_of_bases ? "" : ", " + std::string(SetupName(request.setup));
  std::vector<std::string> remarks = {std::string(kExportMark) + PlainText(request.name) + setup + ", method " +
                                          PlainText(request.method) + ": the pose of " + child + " in " + parent,
                                      parent + ": " + FrameInWords(request.parent),
                                      child + ": " + FrameInWords(request.child)};
  if (request.grade) remarks.push_back(GradeRemark(*request.grade));
  if (request.covariance) {
    constexpr double kMillimetre = 1e-3;
    constexpr double kDegree = M_PI / 180;
    remarks.push_back("one sigma along and about the axes of " + child + ": " +
                      SigmasText(*request.covariance, 0, kMillimetre) + " mm and " +
                      SigmasText(*request.covariance, 3, kDegree) + " deg");
  }
  if (request.is_ur_controller && request.setup == Setup::kEyeToHand) {
    remarks.emplace_back(
        "the base is that of the Universal Robots controller and pendant, the frame `base` of ROS; base_link of ROS is "
        "rotated by 180 deg about z relative to it");
  }
  return remarks;
}

std::string CommentLines(const std::vector<std::string>& lines, const std::string& mark) {
  std::string text;
  for (const std::string& line : lines) text += mark + line + "\n";
  return text;
}

Rigid3d OpticalFromBody() {
  Eigen::Matrix3d rotation;
  rotation << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return {Eigen::Quaterniond(rotation), Eigen::Vector3d::Zero()};
}

std::string DecimalText(double number) {
  std::string text = RoundTrip(number);
  if (text.find('.') == std::string::npos) text.insert(std::min(text.find('e'), text.size()), ".0");
  return text;
}

std::vector<std::string> RootFrames(const std::vector<ExportRequest>& poses) {
  std::vector<std::string> roots;
  for (const ExportRequest& pose : poses) {
    const bool is_child = std::any_of(
        poses.begin(), poses.end(), [&](const ExportRequest& other) { return other.child_frame == pose.parent_frame; });
    const bool is_known = std::find(roots.begin(), roots.end(), pose.parent_frame) != roots.end();
    if (!is_child && !is_known) roots.push_back(pose.parent_frame);
  }
  return roots;
}

std::string FrameWithTwoPoses(const std::vector<ExportRequest>& poses) {
  std::set<std::string> seen;
  for (const ExportRequest& pose : poses) {
    if (!seen.insert(pose.child_frame).second) return pose.child_frame;
  }
  return "";
}

std::string JoinNumbers(const std::vector<double>& numbers, std::string_view separator) {
  std::vector<std::string> parts;
  for (const double number : numbers) parts.push_back(DecimalText(number));
  return Join(parts, separator);
}

std::vector<double> TranslationAndQuaternion(const Rigid3d& pose) {
  const double sign = pose.rotation.w() < 0 ? -1 : 1;
  const Eigen::Vector4d q = sign * pose.rotation.coeffs();
  const Eigen::Vector3d& t = pose.translation;
  return {t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]};
}

const PoseFormat& RollPitchYawFormat() {
  static const PoseFormat format{"", {"x", "y", "z", "roll", "pitch", "yaw"}, "m", "extrinsic_xyz", "rad"};
  return format;
}

std::string UrdfOrigin(const Rigid3d& pose) {
  const std::vector<double> numbers = NumbersFromPose(RollPitchYawFormat(), pose);
  return "<origin xyz=\"" + JoinNumbers({numbers.begin(), numbers.begin() + 3}, " ") + "\" rpy=\"" +
         JoinNumbers({numbers.begin() + 3, numbers.end()}, " ") + "\"/>";
}

Outcome<OpenCvLens> NeedOpenCvLens(const Camera& camera, const std::string& software) {
  if (std::optional<OpenCvLens> lens = OpenCvLensOf(camera)) return *std::move(lens);
  return Failure{software + " has no equivalent of the camera model " + camera.model + "; export as kalibr"};
}

std::string QuotedForYaml(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    constexpr char kHex[] = "0123456789abcdef";
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += std::string("\\") + c;
    } else if (byte < 0x20 || byte == 0x7f) {
      quoted += std::string("\\x") + kHex[byte >> 4] + kHex[byte & 15];
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace heba
