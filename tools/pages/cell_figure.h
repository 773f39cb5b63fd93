// The figure of a cell in 3-D: arms, cameras and targets at every capture.
#pragma once

#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/problem.h"

namespace heba {

struct ShownArm {
  std::string name;  // The label of its base.
  Rigid3d world_from_base;
  std::vector<Rigid3d> base_from_gripper;  // One per capture.
};

struct ShownCamera {
  std::string name;
  Mount mount;  // Mount::robot is an index in ShownCell::arms.
  Rigid3d mount_from_camera;
  Camera camera;
};

struct ShownTarget {
  std::string name;
  Mount mount;
  Rigid3d mount_from_target;
  Points3 points_in_target;
};

struct ShownMoment {
  std::string name;  // Of the capture.
  bool is_used = false;
};

struct ShownCell {
  std::vector<ShownArm> arms;
  std::vector<ShownCamera> cameras;
  std::vector<ShownTarget> targets;
  std::vector<ShownMoment> captures;
};

// Returns the markup of the figure. Without the script it is a plan view.
std::string CellFigure(const ShownCell& cell);

}  // namespace heba
