// The input of the doctor's checks: a data set as its config reads it, corrected by the checks before.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/detection.h"
#include "solvers/initial/pose_consistency.h"
#include "solvers/initial/usable_views.h"
#include "tools/config/run_config.h"
#include "tools/doctor/symptom.h"
#include "tools/text/console.h"

namespace heba {

// A capture whose image determines a pose of the target.
struct ExaminedView {
  size_t capture = 0;  // Index into Dataset::captures.
  View view;           // Has the robot pose as corrected by the checks before.
  // All poses that the image allows (PoseCandidates), as seen by Examination::camera.
  std::vector<Rigid3d> camera_from_target;
  double rms_px = 0;  // RMS residual under the first of them.
};

// The format of the poses file under which robot and images agree best.
struct PoseFit {
  PoseFormat format;
  double misfit_m = 0;       // Difference at the target; 7 of 10 captures have less.
  std::string misfit;        // Such as "0.1 deg and 0.3 mm".
  bool fits = false;         // Whether robot and images agree to within kPoorShare of the working distance.
  bool tells_scale = false;  // Whether they would show a target of another size.
  // Whether camera and gripper (or base) would be at one place: the poses are those of the target in the camera.
  bool is_of_camera = false;
};

// The rest of the rig around a data set that is one of its cameras and one of its targets.
struct CellContext {
  // The codes (Target::Codes) of the other targets that the images may show, which are not this one.
  std::vector<std::string> other_codes;
  // Whether some images of the cell show the whole target: where others do not show it, it is not in view.
  bool is_target_known = false;
  // All captures of the rig, with the poses of the arm. The data set has those whose images do not show another target
  // instead.
  std::vector<std::string> captures;
  std::vector<Rigid3d> base_from_gripper;
  std::vector<size_t> place;  // For each capture of the data set, its place among all.
  struct OtherArm {
    std::string name;
    std::vector<Rigid3d> base_from_gripper;  // In all captures of the rig.
  };
  std::vector<OtherArm> other_arms;
};

struct Examination {
  RunConfig config;                         // Its data set has one camera, one target and one arm.
  std::vector<TargetDetection> detections;  // Made by the first check.
  std::optional<Camera> camera;             // Given, or estimated from the images; not set if neither is possible.
  std::vector<ExaminedView> views;
  bool found_wrong = false;  // Whether a check before found a fault.
  // Set by the check of the poses; not set if neither images nor motion determine it.
  std::optional<PoseFit> pose_fit;
  CellContext rig;  // Empty if the data set is not a part of a rig.
  int num_threads = 1;
  Verbosity verbosity = Verbosity::kNormal;
};

// A check returns its symptoms and the parts of the examination that the checks that follow use in place of the present
// ones. A part without a value stays as it is.
struct Checked {
  std::vector<Symptom> symptoms;
  std::optional<RunConfig> config = std::nullopt;
  std::optional<std::vector<TargetDetection>> detections = std::nullopt;
  std::optional<Camera> camera = std::nullopt;
  std::optional<std::vector<ExaminedView>> views = std::nullopt;
  std::optional<PoseFit> pose_fit = std::nullopt;
};

// Returns the examination with the parts that a check corrected.
Examination Corrected(Examination examination, Checked checked);

// Returns the detections in the captures of the config, from the cache if they are there.
std::vector<TargetDetection> Detections(const RunConfig& config, int num_threads, Verbosity verbosity);

// Returns the number of images in which the target shows enough points for a pose.
size_t NumSeen(const std::vector<TargetDetection>& detections);

// Returns the views of the captures with enough points, with the target's poses as seen by `camera`. Views that no
// pose explains are left out.
std::vector<ExaminedView> ExamineViews(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                       const Camera& camera);

// Returns the views of captures whose target poses are given.
std::vector<ExaminedView> ViewsOfPoses(const Dataset& dataset);

// Returns `views` as pairs of poses.
std::vector<PoseCandidates> CandidatesOf(const std::vector<ExaminedView>& views);

// Returns the mean distance of the target from the camera. `views` must not be empty.
double WorkingDistanceM(const std::vector<ExaminedView>& views);

// Robot and images whose difference exceeds this share of the working distance do not belong together.
inline constexpr double kPoorShare = 0.05;

// Describes the difference between robot and images: "23 deg and 180 mm".
std::string MisfitText(const PoseConsistency& consistency);

// Describes a hand-eye pose by its name in a setup and its value: "gripper_from_camera [..] mm, quaternion xyzw [..]".
std::string HandEyeText(Setup setup, const Rigid3d& camera_mount_from_camera);

}  // namespace heba
