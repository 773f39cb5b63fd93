// Which of a view's possible target poses is the right one: what a view alone cannot tell, the chain of all captures
// can.
//
// A flat target has up to two poses that explain a view about equally well, and a board that looks the same after a
// turn can be read in several orders. Two captures must see the rotation that the robot made between them: angle(M_j
// M_i^-1) = angle(C_j C_i^-1); no wrong pose keeps that over all captures.
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/metrics.h"
#include "solvers/initial/target_pose.h"

namespace heba {

struct ChosenPoses {
  std::vector<PosePair> pairs;  // One a view.
  // The order in which each view's board was read: the index of the symmetry S with true point = S * labelled point.
  std::vector<int> symmetry;
  // What the methods, in the order of HandEyeMethods(), make of the pairs; nothing of those that were not asked.
  std::vector<std::optional<Outcome<HandEye>>> solutions;
};

// `poses[i]`: the candidates of views[i], at least one. `symmetries`: the motions that map the target to itself, the
// identity first (then one order for all is as good as another, and the first view's is kept).
ChosenPoses ChoosePoses(const Camera& camera, const std::vector<View>& views,
                        const std::vector<std::vector<TargetPose>>& poses, const std::vector<Rigid3d>& symmetries);

// Of the poses that a view alone allows, the one that is turned least against `camera_from_target`; null if there is
// none.
const TargetPose* NearestPose(const std::vector<TargetPose>& poses, const Rigid3d& camera_from_target);

// The pairs that a camera sees: of each view's target poses the one nearest to what the chain predicts. Views without a
// pose of their own have no pair.
std::vector<PosePair> PosePairsOf(const Camera& camera, const HandEye& hand_eye, const std::vector<View>& views);

}  // namespace heba
