// Compares finished runs: the errors of each camera, the agreement of the poses that runs have in common and, of runs
// of one camera, the gain of the refinement and the influence of the target.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/pose_difference.h"
#include "heba/evaluation/run_result.h"
#include "tools/text/camera_figures.h"

namespace heba {

// A camera in one run. The sigmas are those of its pose in the world or, if a gripper carries it, in that gripper.
struct ComparedCamera {
  std::string name;
  std::string setup;  // SetupName, or the mount of a camera of a rig.
  CameraFigures figures;
};

enum class ComparedPoseKind { kCamera, kCameraInCamera, kTarget, kArm };
inline constexpr std::array<std::string_view, 4> kComparedPoseKindNames = {"camera", "camera_in_camera", "target",
                                                                           "arm"};

// A pose that runs can have in common: the kind, and the names of its ends. The parent is "world", a gripper, or a
// camera.
struct ComparedPoseName {
  ComparedPoseKind kind = ComparedPoseKind::kCamera;
  std::string parent;
  std::string child;

  bool operator==(const ComparedPoseName& other) const = default;
  // "camera left in world".
  std::string Text() const;
};

struct ComparedPose {
  ComparedPoseName name;
  UncertainPose parent_from_child;
};

// The run of one camera has closed-form estimates beside the refined one.
struct ComparedMethods {
  std::string closed_form;  // The one with the lowest hold-out error in px; empty if none has one.
  CameraFigures best_px;    // Its figures.
  CameraFigures best_mm;    // The figures of the one with the lowest hold-out error in mm.
  bool has_robot_noise = false;
};

// A run states this about a cell.
struct ComparedRun {
  std::string label;  // The name of the run, or its folder if names are not unique.
  std::string name;
  Grade grade = Grade::kGood;
  double seconds = 0;
  std::string target_types;
  std::vector<std::string> arms;  // The world is the base of the first; "" for the run of one camera.
  std::vector<ComparedCamera> cameras = {};
  std::vector<ComparedPose> poses = {};
  std::optional<ComparedMethods> methods = {};  // Set for the run of one camera.
};

// The camera of a result of the short form has no name, and no figures and no pose if there is no refined estimate.
ComparedRun ComparedRunOf(const std::string& label, const RunResult& result);

// The difference of one pose between two runs.
struct RunDifference : PoseDifference {
  size_t first = 0;  // Index into the compared runs.
  size_t second = 0;
  ComparedPoseName name;
};

struct Comparison {
  std::vector<ComparedRun> runs;
  bool has_rig = false;  // Whether one of the runs is that of a rig.
  // The differences follow the pairs of runs, and then the order of the first run's poses.
  std::vector<RunDifference> differences;
  std::vector<std::string> findings;  // Sentences in plain words, the most important first.
};

// Cameras, targets and arms of rigs belong together by their names, and the camera of a run of one camera beside a rig
// has the name of the run. Runs of one camera alone are compared if they have the same setup. Throws InputError if
// there is a rig and runs have different worlds (a run has several arms, and the first arm of another one has not the
// name of its first), if a run has no pose in common with any other, or if one has no refined estimate.
Comparison CompareRuns(std::vector<ComparedRun> runs);

std::string ComparisonTable(const Comparison& comparison);  // Returns the tables for the terminal.
std::string ComparisonRunsCsv(const Comparison& comparison);
std::string ComparisonPairsCsv(const Comparison& comparison);
std::string ComparisonPage(const Comparison& comparison);

}  // namespace heba
