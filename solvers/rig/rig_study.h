// Monte-Carlo study of a rig: the errors of the poses of a joint calibration, and of the cameras calibrated one by one,
// on simulated captures with known truth, compared with the Cramer-Rao bound (solvers/calibration/study.h).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "heba/rig_calibration.h"
#include "heba/simulation/scene.h"
#include "solvers/calibration/study.h"

namespace heba {

// The ways to calibrate a rig; their names are those of kRigEstimatorNames, in this order.
enum class RigEstimator {
  kJointly,   // CalibrateRig of all cameras.
  kOneByOne,  // CalibrateRig of each camera by itself, with the targets that it sees and the arms that move them.
};
inline constexpr std::array<const char*, 2> kRigEstimatorNames = {"jointly", "one_by_one"};

// One cell of a study: a rig, its noise, and the options of the estimators. The poses of the arms are the same in every
// trial; the noise is not.
struct RigStudyCell {
  RigProblem rig;  // With the true cameras and the designed targets; its captures are not used.
  RigPoses poses;
  std::vector<SimulatedTarget> targets;
  std::vector<ArmPoses> arms;  // The exact poses of each capture.
  SceneOptions simulation;     // Its noise_px, robot_noise and motion.margin_px hold.
  // If `has_camera` is empty, the trials estimate the cameras, whose models are known.
  RigCalibrationOptions options;
  std::vector<RigEstimator> estimators = {RigEstimator::kJointly, RigEstimator::kOneByOne};
};

// Returns the names of the poses whose errors a study states: every camera in its mount ("camera left in world"), every
// camera in another one whose relative pose is constant ("camera right in camera left"), and every base in another one
// ("arm right in arm left"). All vectors of poses below have this order.
std::vector<std::string> StudiedRigPoses(const RigStudyCell& cell);

// Runs trial `trial` of a cell; `seed` and `trial` determine all random numbers. Returns for each pose one estimate per
// estimator, whose error has 6 entries (m, rad, in the child frame). A pose between two cameras that are calibrated one
// by one has the covariance of two independent ones, and that between two bases is taken from the camera that states
// the smallest sigma. Poses that no camera determines by itself have no estimate of kOneByOne.
std::vector<std::vector<TrialEstimate>> RunRigTrial(const RigStudyCell& cell, uint64_t seed, int trial);

// Returns the Cramer-Rao bound of each pose: the smallest covariance (m, rad, in the child frame) that an unbiased
// estimator can have if both noises are known and the targets are as designed. Returns a Failure if the captures do not
// determine the unknowns.
Outcome<std::vector<Eigen::Matrix<double, 6, 6>>> RigErrorBound(const RigStudyCell& cell);

// A pose's bound and the errors of its estimators; StudyErrors::hand_eye_m and hand_eye_rad are those of the pose.
struct RigPoseSummary {
  std::string pose;
  Outcome<StudyErrors> bound = {};
  std::vector<MethodSummary> methods;
};
// Summarises the trials of a cell.
std::vector<RigPoseSummary> SummariseRig(const RigStudyCell& cell,
                                         const std::vector<std::vector<std::vector<TrialEstimate>>>& trials);

}  // namespace heba
