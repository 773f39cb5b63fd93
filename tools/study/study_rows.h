// The results of a study as rows of figures: one for the bound and one for each method of a cell, or of a pose of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/config/study_config.h"

namespace heba {

// The result of a hand-eye calibration's cell, or of one pose of another cell. The results of one cell are neighbours.
struct CellResult {
  int cell = 0;  // Index of the cell in the study.
  StudyLabels labels;
  Outcome<StudyErrors> bound = {};
  std::vector<MethodSummary> methods;
};

// Errors in the units in which they are shown; nothing where there are none.
struct ShownErrors {
  std::optional<double> hand_eye_mm;
  std::optional<double> hand_eye_deg;
  std::optional<double> board_mm;
  std::optional<double> board_deg;
  std::optional<double> focal_px;
  std::optional<double> inside_mm;
  std::optional<double> outside_mm;
};

// A method's row; that of the bound has no method.
struct StudyRow {
  const CellResult* result = nullptr;
  const MethodSummary* method = nullptr;
  std::string name = {};
  bool is_emphasised = false;  // Whether the method is the one that heba recommends.
  ShownErrors errors = {};     // A method that failed in all trials has none.
  ShownErrors bound = {};
  std::optional<double> axxb_mm = {};
  std::optional<double> coverage = {};
  // The gain of a joint calibration is the error of the cameras calibrated one by one relative to its own.
  std::optional<double> gain_mm = {};
  std::optional<double> gain_deg = {};

  // Whether the row is that of a pose of named cameras.
  bool IsPose() const { return !result->labels.pose.empty(); }
  // Returns an error in units of the bound.
  std::optional<double> ByBound(std::optional<double> ShownErrors::*error) const;
};
// Returns the rows of a result: the bound, if it has one, and every method.
std::vector<StudyRow> RowsOf(const CellResult& result);

// The quantities that a study varies, which can be the horizontal axis of a chart. Translation and rotation noise of
// the robot are swept as a pair.
enum StudyQuantity : size_t {
  kPixelNoise,
  kCaptures,
  kPoints,
  kRobotMm,
  kRobotDeg,
  kScaleX,
  kScaleY,
  kBendX,
  kBendY,
  kTwist,
  kCubicXxx,
  kCubicXxy,
  kCubicXyy,
  kCubicYyy,
  kOutlierPoints,
  kWrongPoses,
  kNumQuantities
};
struct SweptQuantity {
  const char* label;
  bool has_zero;  // True if the axis is linear, because zero is a possible value.
  double (*value)(const StudyLabels& labels);
};
extern const SweptQuantity kQuantities[kNumQuantities];

// Returns true if the description of a cell omits this quantity because the chart varies it.
bool IsSwept(size_t quantity, size_t swept);

// Describes a cell without its pixel noise and without the swept quantity.
std::string SceneLine(const StudyLabels& labels, size_t swept = kPixelNoise);
// Returns ", pixel noise 0.1 px".
std::string PixelNoiseText(const StudyLabels& labels);
// Describes a cell with its pixel noise and without the pose.
std::string ConditionLine(StudyLabels labels);
// Describe its setup, and the free intrinsics.
std::string SetupText(const StudyLabels& labels);
std::string IntrinsicsText(const StudyLabels& labels);

}  // namespace heba
