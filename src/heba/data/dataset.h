// What was recorded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/geometry/rigid3.h"

namespace heba {

// One picture and the robot's pose when it was taken.
struct Capture {
  std::string name;             // The image's file name: what messages and results call this capture.
  std::filesystem::path image;  // Where it is.
  std::string role;             // home, translate_x, translate_y, rotate, free; or empty.
  Rigid3d base_from_gripper;
};

}  // namespace heba
