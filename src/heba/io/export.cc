#include "heba/io/export.h"

#include <algorithm>

#include "heba/base/text.h"
#include "heba/io/pose_file.h"

namespace heba {

#define HEBA_EXPORT_FORMAT(name, file_name, holds_camera, description) \
  Outcome<std::string> ExportFormat_##name(const ExportRequest& request);
#include "heba/io/export_formats.def"
#undef HEBA_EXPORT_FORMAT

namespace {

using Writer = Outcome<std::string> (*)(const ExportRequest& request);

struct Entry {
  ExportFormat format;
  bool holds_camera;
  Writer writer;
};

const std::vector<Entry>& Entries() {
  static const std::vector<Entry> entries = {
#define HEBA_EXPORT_FORMAT(name, file_name, holds_camera, description) \
  {{#name, description, file_name}, holds_camera, &ExportFormat_##name},
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
  return lengths + ", then turns in " + format.angle_unit + " about the axes " +
         format.rotation.substr(format.rotation.find('_') + 1) + ", in this order, each about the axis " +
         (is_fixed ? "as it was at first" : "as already turned");
}

std::string RobotPoseText(PoseFormat format, const ExportRequest& request) {
  if (format.rotation == "matrix") format.translation_unit = request.length_unit;
  std::vector<std::string> remarks = ExportRemarks(request);
  remarks.push_back(AnglesInWords(format));
  return CommentLines(remarks, "# ") + PoseFileText({{"", "", request.parent_from_camera, 0}}, format);
}

}  // namespace

ExportRequest MakeExportRequest(const RunResult& result, const Estimate& estimate) {
  const bool is_fixed = result.setup == Setup::kEyeToHand;
  return {result.name,
          result.setup,
          estimate.hand_eye.camera_mount_from_camera,
          estimate.camera,
          is_fixed ? "base_link" : "tool0",
          "camera_optical_frame",
          "m"};
}

const std::vector<ExportFormat>& ExportFormats() {
  static const std::vector<ExportFormat> formats = [] {
    std::vector<ExportFormat> all;
    for (const Entry& entry : Entries()) all.push_back(entry.format);
    for (const PoseFormat& format : PoseFormats()) {
      all.push_back({format.name,
                     "the camera's pose as pose format " + format.name + " has it (" + Join(format.columns, " ") + ")",
                     "camera_" + format.name + ".csv"});
    }
    return all;
  }();
  return formats;
}

Outcome<std::string> ExportText(const ExportFormat& format, const ExportRequest& request) {
  for (const Entry& entry : Entries()) {
    if (entry.format.name != format.name) continue;
    if (entry.holds_camera && request.camera.params.empty()) {
      return Failure{
          "an estimate from poses alone has no camera, which this form holds; use urdf, "
          "ros2 or a robot's form, such as matrix"};
    }
    return entry.writer(request);
  }
  const PoseFormat* pose_format = FindPoseFormat(format.name);
  CHECK(pose_format != nullptr) << "export format " << format.name;
  return RobotPoseText(*pose_format, request);
}

std::vector<std::string> ExportRemarks(const ExportRequest& request) {
  // A name may hold anything: what is no plain letter could end a comment.
  const auto plain = [](std::string text) {
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c < ' ' || c > '~' || c == '-' || c == '<' || c == '>'; }, '_');
    return text;
  };
  const bool is_fixed = request.setup == Setup::kEyeToHand;
  return {"heba, calibration " + plain(request.name) + ", " + std::string(SetupName(request.setup)) +
              ": the camera in " +
              (is_fixed ? "the robot's base" : "the gripper (flange or tool, as the robot reports it)"),
          "parent " + plain(request.parent_frame) + ", camera " + plain(request.camera_frame) +
              ": the OPTICAL frame (x right, y down, z forward), not a body frame (x forward, y left, z up)"};
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

std::vector<double> OpenCvDistortion(const Camera& camera) { return {camera.params.begin() + 4, camera.params.end()}; }

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
