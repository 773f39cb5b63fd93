// A result in the forms that other software reads: those of export_formats.def, and the camera's pose in every form of
// robot pose (pose_formats.def).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"
#include "heba/io/pose_formats.h"

namespace heba {

// What is exported, and the names that it has in the other software.
struct ExportRequest {
  std::string name;  // The run's.
  Setup setup = Setup::kEyeToHand;
  Rigid3d parent_from_camera;  // The parent is base (eye-to-hand) or gripper (eye-in-hand); the camera is optical.
  Camera camera;
  std::string parent_frame;
  std::string camera_frame;
  std::string length_unit = "m";  // Of the form `matrix`: m or mm.
};

// Of an estimate that is ok, with the usual names: base_link or tool0, and camera_optical_frame.
ExportRequest MakeExportRequest(const RunResult& result, const Estimate& estimate);

struct ExportFormat {
  std::string name;
  std::string description;
  std::string file_name;  // What such a file is usually called.
};
// Those of export_formats.def, then those of pose_formats.def.
const std::vector<ExportFormat>& ExportFormats();

// The text of a file. A Failure if the form cannot hold this camera. `format` is one of ExportFormats().
Outcome<std::string> ExportText(const ExportFormat& format, const ExportRequest& request);

// For the files in export_formats/.

// What every file says in comments: what it is, and which of the camera's frames is meant. A line an entry, without a
// comment's mark and free of what could end one.
std::vector<std::string> ExportRemarks(const ExportRequest& request);
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
