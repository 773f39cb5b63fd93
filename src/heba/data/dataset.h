// The recorded data.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "heba/data/capture_role.h"
#include "heba/data/shared_effects.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// One image and the robot pose at which it was taken.
struct Capture {
  std::string name;             // File name of the image, which identifies the capture in messages and results.
  std::filesystem::path image;  // Path of the image.
  CaptureRole role = CaptureRole::kNone;
  Rigid3d base_from_gripper;
  std::vector<double> joints = {};                // Recorded positions of the joints, rad or m; may be empty.
  std::shared_ptr<const PoseEffect> effect = {};  // View::effect.
  Matrix6X gripper_by_joints = Matrix6X(6, 0);    // View::gripper_by_joints.
};

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
  bool operator==(const ImageSize& other) const = default;
};

}  // namespace heba
