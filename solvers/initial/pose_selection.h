// Selects the correct one of a view's possible target poses: the kinematic loop of all captures resolves the
// ambiguity of a single view.
//
// A planar target has up to two poses that explain a view about equally well, and a target that looks the same after
// a rotation can be read in several orders. Two captures must see the rotation that the robot made between them:
// angle(M_j M_i^-1) = angle(C_j C_i^-1). No wrong pose satisfies this over all captures.
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/metrics.h"
#include "solvers/initial/target_pose.h"

namespace heba {

struct ChosenPoses {
  std::vector<PosePair> pairs;  // One per view.
  // The order in which the target was read in each view: index of the symmetry S with true point = S * labelled
  // point.
  std::vector<int> symmetry;
  // The results of the methods, in the order of HandEyeMethods(), for these pairs; nothing for methods that were not
  // run.
  std::vector<std::optional<Outcome<HandEye>>> solutions;
};

// Selects one pose per view. `poses[i]`: the candidates of views[i], at least one. `symmetries`: the motions that map
// the target to itself, the identity first. A common symmetry of all views cannot be resolved: the order of the first
// view is kept.
ChosenPoses ChoosePoses(const Camera& camera, const std::vector<View>& views,
                        const std::vector<std::vector<TargetPose>>& poses, const std::vector<Rigid3d>& symmetries);

// Returns the pose with the smallest rotation relative to `camera_from_target`, or null if `poses` is empty.
const TargetPose* NearestPose(const std::vector<TargetPose>& poses, const Rigid3d& camera_from_target);

// Returns the pose pairs of the views: the target pose of each view that is nearest to the prediction of the loop.
// Views from which no target pose can be estimated have no pair.
std::vector<PosePair> PosePairsOf(const Camera& camera, const HandEye& hand_eye, const std::vector<View>& views);

}  // namespace heba
