// Draws the captures of a scene, before any image is rendered.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/data/pair_problem.h"
#include "heba/geometry/rigid3.h"
#include "tools/config/scene_config.h"

namespace heba {

struct SceneCapture {
  CaptureRole role = CaptureRole::kNone;
  std::vector<std::vector<Rigid3d>> camera_from_target;  // Each camera has one for each target.
  std::vector<Rigid3d> reported;                         // base_from_gripper of each arm, as it reports it.
  std::vector<Eigen::VectorXd> joints;                   // Commanded, of each arm (rad or m); empty without kinematics.
};

struct SceneCaptures {
  std::vector<SceneCapture> captures;
  std::vector<Eigen::VectorXd> arm_errors;  // Each arm has one for each parameter; empty without kinematics.
};

// Draws the captures, each as often as the scene repeats it, with the motions of its cameras. The order of the draws
// differs between the short form of a scene and the other: the data of a scene and its seed stay what they are. Returns
// a Failure if a target does not fit into an image, or if an arm does not reach enough poses.
Outcome<SceneCaptures> DrawSceneCaptures(const SceneConfig& scene);

}  // namespace heba
