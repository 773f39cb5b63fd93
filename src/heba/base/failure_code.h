// The codes of failures of algorithms (Failure, heba/base/error.h). tools/text/failure_text.cc has the words of each.
#pragma once

#include <string_view>

namespace heba {

inline constexpr std::string_view kFailureCodes[] = {
    "not_run",
    "cancelled",
    // The motion and the closed forms.
    "few_captures",
    "no_rotation",
    "one_axis",
    "no_solution",
    "not_a_rotation",
    "bad_covariance",
    "weak_positions",
    "no_home",
    "no_translation",
    "few_rotations",
    "no_closed_form",
    "target_behind",
    "no_pixels",
    "few_tilts",
    "few_touches",
    "few_planned",
    "no_planned_place",
    "no_planned_depth",
    "one_touch_axis",
    // The intrinsics.
    "no_camera",
    "intrinsics_failed",
    "implausible_camera",
    "few_captures_of_camera",
    "undistorted",
    // The refinement.
    "no_points",
    "hidden_at_start",
    "hidden_point",
    "no_information",
    "undetermined",
    "large_sigma",
    "implausible_refined_camera",
    "not_converged",
    "chain_not_converged",
    "poses_not_converged",
    "few_coordinates",
    "points_contradict",
    "no_error_model",
    "of_fold",
    "hidden_held_out",
    "no_held_out_pose",
    // Several cameras, targets and arms.
    "of_camera",
    "ambiguous_part",
    "arm_carries_nothing",
    "pair_without_pose",
    "pair_failed",
    "on_two_arms",
    "not_joined",
    "camera_without_target",
    "unseen_target",
    "no_target_in_view",
    "shifted_images",
    // The errors of arms.
    "few_captures_of_arm",
    "no_better_than_noise",
    "no_better_model",
    "held_arm_noise",
    "idle_arm",
    "no_configuration_fits",
    "near_out_of_reach",
    "arm_refinement_failed",
    "tool_scatter",
    "tool_not_explained",
    "little_explained",
    "no_posture_near",
    "out_of_reach",
    "nameless_configurations",
    "no_masses",
    "kinematics_not_wanted",
    "record_joints",
    // The location of targets and pixels.
    "no_target",
    "few_detected",
    "no_pose",
    "not_finite",
    "of_pixel",
    "no_ray",
    "camera_without_ray",
    "ray_beside_plane",
    "plane_behind",
    "one_camera",
    "parallel_rays",
    "rays_behind",
    // The check of a later session.
    "no_part_told",
    // The detection.
    "all_left_out",
    "nothing_detected",
};

// A code that is not one of kFailureCodes does not compile.
class FailureCode {
 public:
  consteval explicit FailureCode(const char* code) : name_(code) {
    for (const std::string_view known : kFailureCodes) {
      if (known == code) return;
    }
    throw "the code is not one of kFailureCodes";
  }
  constexpr const char* name() const { return name_; }

 private:
  const char* name_;
};

}  // namespace heba
