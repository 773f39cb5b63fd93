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

// One camera cannot tell more: what moves with the hand, or what stands in the world.
enum class DriftSide { kHand, kWorld };
inline constexpr std::array<std::string_view, 2> kDriftSideNames = {"hand", "world"};

enum class DriftForm { kLinear, kStep };
inline constexpr std::array<std::string_view, 2> kDriftFormNames = {"linear", "step"};

// The errors of the robot follow its path and can look like a drift. The evidence says what excludes it.
enum class DriftEvidence {
  kArm,       // The errors of the arm are estimated.
  kRevisits,  // The robot errs alike where one pose was taken several times.
  kOrder,     // The order of the captures is not a function of the pose.
  kWanted,    // Nothing: the drift is estimated because it was asked for.
};
inline constexpr std::array<std::string_view, 4> kDriftEvidenceNames = {"arm", "revisits", "order", "wanted"};

struct Drift {
  DriftSide side = DriftSide::kHand;
  DriftForm form = DriftForm::kLinear;
  size_t capture = 0;  // kStep: the first capture after it, an index in the order of time.
  // The motion of the body from the first capture to the last, in its own frame, which is that of the camera or of the
  // target.
  Tangent6 change = Tangent6::Zero();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  DriftEvidence evidence = DriftEvidence::kWanted;
  double p_value = 1;       // The probability of so large a drift by chance, for all that were tested.
  double odds_of_side = 1;  // How many times as likely this side is as the other one.
};

// Returns the share of its motion that the body still has to make after a capture, from 0 at the last one to 1.
double RemainingShare(const Drift& drift, size_t capture, size_t num_captures);

// Returns the body that drifts: the camera, or otherwise the target.
bool IsCameraDrifting(Setup setup, DriftSide side);

// Returns the pose of the target's mount in the camera's mount at which a capture would have been taken if the body had
// stood where it stands after the last capture.
Rigid3d WithoutDrift(const Rigid3d& camera_mount_from_target_mount, const Drift& drift, double remaining_share,
                     Setup setup, const Rigid3d& camera_mount_from_camera, const Rigid3d& target_mount_from_target);

// Which drifts a calibration takes in.
struct DriftOptions {
  bool is_tested = true;               // Whether the captures are tested for one.
  std::vector<DriftSide> wanted = {};  // The sides whose linear drift is estimated without a test.
};

}  // namespace heba
