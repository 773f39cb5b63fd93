// Compares finished runs of rigs: the errors of each camera, and the agreement of the poses of cameras, targets and
// arms that have the same names. The run of a single camera can stand beside them, as a camera with the run's name.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/pose_difference.h"
#include "heba/evaluation/rig_evaluation.h"

namespace heba {

// The figures of one camera in one run. Figures that do not exist are empty.
struct CellCamera {
  std::string name;
  std::optional<double> reprojection_rms_px;
  std::optional<double> holdout_rms_px;
  std::optional<double> holdout_target_mm;
  std::optional<double> holdout_target_deg;
  // One sigma of its pose: root of the sum of the variances along, and about, its axes.
  double sigma_mm = 0;
  double sigma_deg = 0;
};

enum class CellPoseKind { kCamera, kCameraInCamera, kTarget, kArm };
inline constexpr std::array<std::string_view, 4> kCellPoseKindNames = {"camera", "camera_in_camera", "target", "arm"};

// A pose that runs can have in common: the kind, and the names of its ends. The parent is "world", a gripper, or a
// camera.
struct CellPoseName {
  CellPoseKind kind = CellPoseKind::kCamera;
  std::string parent;
  std::string child;

  bool operator==(const CellPoseName& other) const = default;
  // "camera left in world".
  std::string Text() const;
};

struct CellPose {
  CellPoseName name;
  UncertainPose parent_from_child;
};

// What a run states about a cell.
struct ComparedCell {
  std::string label;  // The name of the run, or its folder if names are not unique.
  Grade grade = Grade::kGood;
  std::vector<std::string> arms;  // The world is the base of the first. Empty for the run of one camera.
  std::vector<CellCamera> cameras;
  std::vector<CellPose> poses;
  double seconds = 0;
};

ComparedCell CellOf(const std::string& label, const RigResult& result);
// Returns the only camera, under the name of the run. Throws InputError, which begins with `label`, if there is no
// refined estimate.
ComparedCell CellOf(const std::string& label, const RunResult& result);

// The difference of one pose between two runs.
struct CellDifference : PoseDifference {
  size_t first = 0;  // Index into the compared runs.
  size_t second = 0;
  CellPoseName name;
};

struct RigComparison {
  std::vector<ComparedCell> runs;
  // Of each pair of runs, in the order of the first run's poses.
  std::vector<CellDifference> differences;
  std::vector<std::string> findings;  // Sentences in plain words, the most important first.
};

// Throws InputError if a run has several arms and the first arm of another one has not the name of its first, because
// they would have different worlds, or if a run has no pose in common with any other.
RigComparison CompareRigs(std::vector<ComparedCell> runs);

std::string RigComparisonTable(const RigComparison& comparison);  // Returns the tables for the terminal.
std::string RigComparisonRunsCsv(const RigComparison& comparison);
std::string RigComparisonPairsCsv(const RigComparison& comparison);
std::string RigComparisonPage(const RigComparison& comparison);

}  // namespace heba
