// Closed forms of the hand-eye pose, from pairs of poses alone.
//
//   std::vector<heba::PosePair> pairs;  // One for each capture.
//   pairs.push_back({heba::CameraMountFromTargetMount(setup, base_from_gripper), camera_from_target});
//   const heba::Outcome<heba::HandEye> hand_eye = heba::SolveClosedForm("park", pairs);
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/metrics.h"

namespace heba {

struct ClosedForm {
  std::string name;
  std::string description;  // Includes the reference to the paper.
};
// Returns all closed forms, in the order of closed_form/methods.def.
std::vector<ClosedForm> ClosedForms();

// Finds X = camera_mount_from_camera and Z = target_mount_from_target with X C_i = M_i Z, where M_i =
// camera_mount_from_target_mount and C_i = camera_from_target are the poses of pair i. Returns a Failure if there are
// too few captures, if all rotation axes are parallel, or if the method cannot use the motion. `method` is CHECKed to
// be one of ClosedForms().
Outcome<HandEye> SolveClosedForm(std::string_view method, const std::vector<PosePair>& pairs);

}  // namespace heba
