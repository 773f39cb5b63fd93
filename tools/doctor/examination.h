// What the doctor's checks look at: a data set as its config reads it, then as the checks before have mended it.
#pragma once

#include <optional>
#include <vector>

#include "solvers/initial/pose_consistency.h"
#include "solvers/initial/usable_views.h"
#include "targets/detection.h"
#include "tools/config/run_config.h"
#include "tools/text/console.h"

namespace heba {

// A capture whose picture tells a pose of the target.
struct ExaminedView {
  size_t capture = 0;  // Of RunConfig::captures.
  View view;           // With the robot's pose as the checks before left it.
  // What the picture leaves open (PoseCandidates), by Examination::camera.
  std::vector<Rigid3d> camera_from_target;
  double rms_px = 0;  // Of the first of them.
};

// A reading of the poses file under which robot and pictures agree best.
struct PoseFit {
  PoseFormat format;
  double misfit_m = 0;  // At the target; 7 of 10 captures have less.
  std::string misfit;   // "0.1 deg and 0.3 mm"
  bool fits = false;    // Robot and pictures belong together so: they differ by less than kPoorShare.
};

struct Examination {
  RunConfig config;
  std::vector<CaptureDetection> detections;  // The first check's.
  std::optional<Camera> camera;              // Given, or estimated from the pictures; nothing if neither is to be had.
  std::vector<ExaminedView> views;
  bool found_wrong = false;  // By a check before.
  // Found by the check of the poses; nothing if the pictures or the motion cannot tell.
  std::optional<PoseFit> pose_fit;
  int num_threads = 1;
  Verbosity verbosity = Verbosity::kNormal;
};

// In how many pictures the target shows enough points for a pose.
size_t NumSeen(const std::vector<CaptureDetection>& detections);

// The views of the captures with enough points, and, as `camera` sees them, the target's poses. Those that no
// pose explains are left out.
std::vector<ExaminedView> ExamineViews(const RunConfig& config, const std::vector<CaptureDetection>& detections,
                                       const Camera& camera);

// The same of captures of which others found the target's poses.
std::vector<ExaminedView> ViewsOfPoses(const RunConfig& config);

// `views` as pairs of poses.
std::vector<PoseCandidates> CandidatesOf(const std::vector<ExaminedView>& views);

// Mean distance of the target from the camera. `views` must not be empty.
double WorkingDistanceM(const std::vector<ExaminedView>& views);

// Robot and pictures that differ by more than this share of the working distance do not belong together.
inline constexpr double kPoorShare = 0.05;

// "23 deg and 180 mm": how far robot and pictures are apart.
std::string MisfitText(const PoseConsistency& consistency);

// What a hand-eye pose is called in a set-up, and its value: "gripper_from_camera translation [..] m, ...".
std::string HandEyeText(Setup setup, const Rigid3d& camera_mount_from_camera);

}  // namespace heba
