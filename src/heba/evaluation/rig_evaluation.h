// The result of a run with a rig: the adjustment, its errors on captures that it was given and on held-out ones, and
// the verdict.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/finding.h"

namespace heba {

// The error figures of one camera. Figures that do not exist are empty.
struct RigErrors {
  std::optional<double> reprojection_rms_px;
  std::optional<double> holdout_rms_px;
  // Difference between the predicted pose of the target and its pose estimated from the image alone, root mean square
  // over the held-out images.
  std::optional<double> holdout_target_mm;
  std::optional<double> holdout_target_deg;
  // Differences of the pose of the camera in its mount from the truth.
  std::optional<double> truth_mm;
  std::optional<double> truth_deg;
  // The reason if captures were held out, but a figure of them does not exist.
  std::string holdout_reason = {};
};

// The points of one target in one image.
struct RigTargetInImage {
  std::string target;
  int num_points = 0;
  int num_rejected = 0;          // Number of points that the estimate rejected.
  std::optional<double> rms_px;  // RMS with the estimate and the poses of the arms as given.
  bool used = false;
};

// The outcome for one image of one capture.
struct RigImageResult {
  std::string capture;
  std::string camera;
  std::string image;  // File name.
  bool used = false;
  std::string reason;                     // Reason why it, or one of its targets, was not used.
  std::vector<RigTargetInImage> targets;  // Empty if no target was seen.
};

// A capture: the poses of the arms, and their corrections.
struct RigCaptureResult {
  std::string name;
  std::vector<Rigid3d> base_from_gripper;  // One per arm, as reported.
  std::vector<Rigid3d> corrections;        // One per arm; empty if the arms are exact.
};

// The exact poses of a rig, if they are known.
struct RigTruth {
  RigPoses poses;
  std::vector<std::optional<Camera>> cameras;
};

// A finished run with a rig, from which result.json is written.
struct RigResult {
  std::string name;
  std::vector<std::pair<std::string, std::string>> about;  // RunResult::about.
  // The names, mounts, cameras and targets. It has no captures.
  RigProblem rig;
  std::vector<std::string> target_types;
  RigSolution solution;                        // Without the outcomes of the captures.
  std::vector<RigErrors> errors;               // One per camera.
  std::optional<double> holdout_chi2;          // Held-out chi-square per degree of freedom.
  std::vector<RelativePose> relative_cameras;  // RelativeCameraPoses.
  std::vector<RelativePose> relative_targets;
  std::vector<RelativePose> relative_bases;
  // The differences of relative_cameras from the truth, m and rad, if it is known.
  std::vector<std::pair<double, double>> relative_truth;
  std::vector<RigCaptureResult> captures;
  std::vector<RigImageResult> images;  // One per camera and capture, in the order of the captures.
  std::vector<Finding> observations;   // Findings about the run that its figures do not show.
  Verdict verdict;                     // Result of JudgeRig.
  Timing timing;
};

// Judges a rig as JudgeRun a single camera, by the worst camera; the finding names it.
Verdict JudgeRig(const RigResult& result);

}  // namespace heba
