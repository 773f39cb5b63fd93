// How good every method is, on the captures that it was given and on captures that it has not seen.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/data/setup.h"
#include "heba/data/solution.h"
#include "heba/evaluation/finding.h"
#include "heba/evaluation/metrics.h"

namespace heba {

struct Errors {
  std::optional<double> reprojection_rms_px;
  std::optional<double> holdout_rms_px;
  // How far the target was from where it was predicted on captures that were held out, by its pictures' own poses.
  std::optional<double> holdout_target_mm;
  std::optional<double> holdout_target_deg;
  // Of a refinement: the held-out squares in the metric of all noise that it knows, per degree of freedom.
  std::optional<double> holdout_chi2;
  // The held-out residuals of every method, on the same captures, in sigmas of the refinement's noise (pixels and
  // robot), root mean square.
  std::optional<double> holdout_sigmas;
  std::optional<double> axxb_mean_mm;
  std::optional<BoardScatter> board_scatter;
  std::optional<TruthErrors> truth;
};

// The refinements' names: of the captures' poses (solvers/refine/pose_refinement.h), and of the reprojection error.
inline constexpr const char* kChainMethod = "chain";
inline constexpr const char* kBundleMethod = "bundle";

// One row of a run's result.
struct Estimate {
  std::string method;
  std::string kind;  // closed_form | refined
  bool ok = false;
  std::string reason;  // Why not, if not ok.
  HandEye hand_eye;    // Meaningful if ok.
  Camera camera;
  Errors errors;
  std::optional<Solution> solution;  // Of a refinement.
};

struct CaptureResult {
  std::string image;
  std::string role;
  int num_points = 0;
  bool used = false;
  std::string reason;            // Why not used, or what is odd about it.
  int num_second_pass = 0;       // Of the points, those found only where the first estimate said to look.
  int num_rejected = 0;          // Of the points, those that the estimate left out.
  std::optional<double> rms_px;  // With the refined estimate, from the robot's pose as it was given.
  // The gripper as the pictures have it, in the gripper's frame as the robot had it; if the robot is noisy.
  std::optional<Rigid3d> correction;
  // What the refined hand-eye pose would move by without this capture (solvers/uncertainty/influence.h).
  std::optional<CaptureMove> move_without;
  // The capture of which this one is a copy, image and pose; empty for all others. Copies are not used.
  std::string repeat_of = {};
  // How far the target was from where a refinement that had not seen this capture predicted it.
  std::optional<double> holdout_target_mm = {};
  bool was_searched = true;  // False for what belongs to no capture: a picture without a pose, one that is left out.
};

struct Timing {
  double detect_s = 0;
  double seed_s = 0;
  double refine_s = 0;
  double total_s = 0;
};

// What a grasp feels of the refined calibration: the target as the capture of middling distance saw it.
struct WorkingPoint {
  Eigen::Vector3d in_camera_m = Eigen::Vector3d::Zero();  // The target's middle.
  // How well the calibration knows the place of a target that is seen there, in the frame of the camera's mount, along
  // the camera's axes. What is wrong of the hand-eye pose and of the intrinsics goes together, and in part cancels
  // (solvers/calibration/target_location.h).
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
};

// A model of the errors that was compared with others (solvers/calibration/model_choice.h).
struct ModelEntry {
  std::string name;
  double log_likelihood = 0;
  int dof = 0;
  std::optional<double> p;
};

// The model of the errors that the refinement uses.
struct ModelSummary {
  std::string robot_noise;                // none | estimated | given
  std::vector<std::string> target_shape;  // A list of scale, bend.
  std::string camera;                     // The camera model.
  std::vector<ModelEntry> alternatives;   // Empty if nothing was to be chosen.
};

// That a target located there is known to `within_m` with this confidence.
struct Requirement {
  double within_m = 0;
  double confidence = 0.95;
  std::string place;     // In words.
  double reached_m = 0;  // The radius that holds a target's middle with this confidence, the largest of the place.
};

// A finished run: what result.json holds.
struct RunResult {
  std::string name;
  // The config's own words about the cell, for the record: serial numbers, an operator's name.
  std::vector<std::pair<std::string, std::string>> about;
  Setup setup = Setup::kEyeToHand;
  std::string target_type;
  int num_target_points = 0;
  std::vector<CaptureResult> captures;
  std::vector<Estimate> estimates;
  std::optional<WorkingPoint> working_point;
  ModelSummary model;
  std::vector<Requirement> requirements;
  // Findings about the run that its figures do not show.
  std::vector<Finding> observations;
  Verdict verdict;  // JudgeRun's.
  Timing timing;
};

// The refinement that the other estimates lead up to, with its covariance; null if there is none.
const Estimate* FindRefined(const RunResult& result);

using FigureOf = std::optional<double> (*)(const Errors&);
inline std::optional<double> HoldOutPx(const Errors& errors) { return errors.holdout_rms_px; }
inline std::optional<double> HoldOutMm(const Errors& errors) { return errors.holdout_target_mm; }
inline std::optional<double> HoldOutSigmas(const Errors& errors) { return errors.holdout_sigmas; }
// The closed form with the lowest of a figure; null if none has it.
const Estimate* FindBestClosedForm(const RunResult& result, FigureOf figure);

}  // namespace heba
