// The motion of a mount during the captures: a creep, or one knock.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/data/setup.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// A body whose mount may yield: a camera, a target, or the base of an arm.
struct DriftBody {
  enum class Kind { kCamera, kTarget, kBase };
  Kind kind = Kind::kCamera;
  size_t index = 0;  // The place of the camera, the target or the arm in the problem.

  bool operator==(const DriftBody& other) const = default;
};
inline constexpr std::array<std::string_view, 3> kDriftBodyNames = {"camera", "target", "base"};

// One camera cannot tell more: what moves with the hand, or what stands in the world.
enum class DriftSide { kHand, kWorld };
inline constexpr std::array<std::string_view, 2> kDriftSideNames = {"hand", "world"};
// Returns the body of a single camera and a single target that is on a side.
DriftBody BodyOn(Setup setup, DriftSide side);

enum class DriftForm { kLinear, kStep };
inline constexpr std::array<std::string_view, 2> kDriftFormNames = {"linear", "step"};

// The errors of the robot follow its path and can look like a drift. The evidence says what excludes it.
enum class DriftEvidence {
  kArm,       // The errors of the arm are estimated.
  kRevisits,  // The robot errs alike where one pose was taken several times.
  kOrder,     // The order of the captures is not a function of the pose.
  kCameras,   // Other cameras see the same captures.
  kMotion,    // The motion of a camera is clear by itself, and a creep explains its images better than a knock.
  kWanted,    // Nothing: the drift is estimated because it was asked for.
};
inline constexpr std::array<std::string_view, 6> kDriftEvidenceNames = {"arm",     "revisits", "order",
                                                                        "cameras", "motion",   "wanted"};

struct Drift {
  DriftBody body;
  DriftForm form = DriftForm::kLinear;
  size_t capture = 0;  // kStep: the first capture after it, an index in the order of time.
  // The motion of the body from the first capture to the last, in its own frame.
  Tangent6 change = Tangent6::Zero();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  DriftEvidence evidence = DriftEvidence::kWanted;
  double p_value = 1;       // The probability of so large a drift by chance, for all that were tested.
  double odds_of_side = 1;  // How many times as likely this body is as the other one that was tested.
};

// Returns the share of its motion that the body still has to make after a capture, from 0 at the last one to 1.
double RemainingShare(const Drift& drift, size_t capture, size_t num_captures);

// Returns the pose of the target's mount in the camera's mount at which a capture would have been taken if the camera
// or the target had stood where it stands after the last capture.
Rigid3d WithoutDrift(const Rigid3d& camera_mount_from_target_mount, const Drift& drift, double remaining_share,
                     const Rigid3d& camera_mount_from_camera, const Rigid3d& target_mount_from_target);

// Which drifts a calibration takes in.
struct DriftOptions {
  bool is_tested = true;               // Whether the captures are tested for one.
  std::vector<DriftBody> wanted = {};  // The bodies whose linear drift is estimated without a test.
};

}  // namespace heba
