// The parts that the result files of one camera and of several have in common: poses, cameras, shapes, noise, errors,
// covariances, verdicts.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/camera/camera.h"
#include "heba/data/pair_solution.h"
#include "heba/data/point_offsets.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"
#include "heba/io/json_reader.h"

namespace heba {

using Json = nlohmann::ordered_json;

// The largest number of points, captures or iterations that is accepted.
inline constexpr int kMostCounted = 1000000000;

// Return a value, or null if it does not exist or is not finite.
template <class T>
Json OrNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}
inline Json Finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json PoseJson(const Rigid3d& pose, std::string_view parent, std::string_view child);
// Returns a pose with one sigma of each of its coordinates (std_translation_m, std_rotation_rad), which is the pose
// `block` of a covariance. The covariance may be null: there are no sigmas.
Json PoseJson(const Rigid3d& pose, std::string_view parent, std::string_view child, const Covariance* covariance,
              const std::string& block);
Json CameraJson(const Camera& camera);
// Likewise with the sigmas of its parameters (std), which are null for those that were held.
Json CameraJson(const Camera& camera, const Covariance* covariance, const std::string& block);
// Returns the estimated shape of the target `block`, or null if no part of it was free.
Json PointOffsetsJson(const std::vector<PointOffsets>& offsets, size_t target);
Json ShapeJson(const TargetShape& shape, const Covariance& covariance, const std::string& block);
// Returns the members "<prefix>mm" and "<prefix>deg" of an arm's noise, which are null if there is none.
Json NoiseJson(const std::optional<RobotNoise>& noise, const std::string& prefix);
// Returns the figures that the errors of one camera and of several have in common.
template <class ErrorFigures>
Json FiguresJson(const ErrorFigures& errors) {
  return Json{{"reprojection_rms_px", OrNull(errors.reprojection_rms_px)},
              {"holdout_rms_px", OrNull(errors.holdout_rms_px)},
              {"holdout_target_mm", OrNull(errors.holdout_target_mm)},
              {"holdout_target_deg", OrNull(errors.holdout_target_deg)},
              {"left_out_rms_px", OrNull(errors.left_out_rms_px)},
              {"left_out_target_mm", OrNull(errors.left_out_target_mm)}};
}
// Returns a small motion in mm and deg.
Json TangentJson(const std::optional<Tangent6>& tangent);
// Returns the change of a pose without a capture, with its probability, or null.
Json MoveJson(const std::optional<CaptureMove>& move);
// Returns the rows of a matrix.
Json MatrixJson(const Eigen::MatrixXd& matrix);
// Returns a covariance with the names of its unknowns, without those of one block.
Json CovarianceJson(const Covariance& covariance, const UnknownBlock& left_out = {});
Json VerdictJson(const Verdict& verdict);
Json TimingJson(const Timing& timing);
// Returns the text of a file. File names need not be UTF-8; invalid bytes are replaced.
std::string FileText(const Json& json);

// The functions below throw InputError with the position in the file.

// Reads a pose, which must be that of `child` in `parent`.
Rigid3d ReadPoseJson(const JsonReader& reader, std::string_view parent, std::string_view child);
Camera ReadCameraJson(const JsonReader& reader);
PointOffsets ReadPointOffsetsJson(const JsonReader& reader);
TargetShape ReadShapeJson(const JsonReader& reader);
std::optional<double> ReadOptional(const JsonReader& reader, const char* key);
// Reads a number for which null stands for a value that is not finite.
double ReadFinite(const JsonReader& reader, const char* key, double otherwise);
// Read a figure that cannot be negative, such as an RMS, a sigma or a time.
double ReadMagnitude(const JsonReader& reader, const char* key);
std::optional<double> ReadOptionalMagnitude(const JsonReader& reader, const char* key);
// Reads the members that NoiseJson writes; nothing if they are null.
std::optional<RobotNoise> ReadNoise(const JsonReader& reader, const std::string& prefix);
// Reads what FiguresJson writes.
template <class ErrorFigures>
ErrorFigures ReadFigures(const JsonReader& reader) {
  ErrorFigures errors;
  errors.reprojection_rms_px = ReadOptionalMagnitude(reader, "reprojection_rms_px");
  errors.holdout_rms_px = ReadOptionalMagnitude(reader, "holdout_rms_px");
  errors.holdout_target_mm = ReadOptionalMagnitude(reader, "holdout_target_mm");
  errors.holdout_target_deg = ReadOptionalMagnitude(reader, "holdout_target_deg");
  if (reader.Has("left_out_rms_px")) errors.left_out_rms_px = ReadOptionalMagnitude(reader, "left_out_rms_px");
  if (reader.Has("left_out_target_mm")) errors.left_out_target_mm = ReadOptionalMagnitude(reader, "left_out_target_mm");
  return errors;
}
std::optional<Tangent6> ReadTangent(const JsonReader& reader, const char* key);
// Reads the member `move_without` of a capture (MoveJson).
std::optional<CaptureMove> ReadMove(const JsonReader& reader);
std::vector<std::string> ReadOrder(const JsonReader& covariance);
// Reads a square matrix; another number of rows is this fault.
Eigen::MatrixXd ReadMatrix(const JsonReader& reader, const char* key, Eigen::Index size, const char* fault);
// Returns the matrix of a covariance whose names are those of the layout.
Covariance ReadCovarianceMatrix(const JsonReader& reader, const UnknownLayout& layout);
// Fails if the names are not those of the layout, in its order.
void CheckOrder(const JsonReader& order, const std::vector<std::string>& names, const UnknownLayout& layout);
Verdict ReadVerdict(const JsonReader& reader);
Timing ReadTiming(const JsonReader& reader);

// Reads a value of an enum by its name, given the names of all values in their order.
template <class Enum, size_t kNumNames>
Enum ReadEnum(const JsonReader& reader, const std::string& what, const std::array<std::string_view, kNumNames>& names) {
  const std::optional<Enum> value = FindValue<Enum>(names, reader.Text());
  if (!value) {
    reader.Fail("the " + what +
                " is unknown; one of: " + Join(std::vector<std::string>(names.begin(), names.end()), ", "));
  }
  return *value;
}

}  // namespace heba
