// Reads a pose, or the positions of joints, from the command line.
#pragma once

#include <string>

#include <Eigen/Core>

#include "heba/io/pose_formats.h"
#include "heba/robot/arm.h"

namespace heba {

// Returns the pose that `text`, the value of the flag --`name`, gives: the numbers of `format`, separated by commas.
// Throws InputError if they are malformed.
Rigid3d PoseOfFlag(const std::string& name, const std::string& text, const PoseFormat& format);

// Returns the positions of an arm's joints (rad or m) that `text`, the value of the flag --`name`, gives: numbers,
// separated by commas, of which those of turning joints may be in degrees. Throws InputError if they are malformed.
Eigen::VectorXd JointsOfFlag(const std::string& name, const std::string& text, const Arm& arm, bool are_deg);

// Returns the format of --near, a pose, if the run's poses have `format`: the same, or `ros` if those are joints.
const PoseFormat& FormatOfNear(const PoseFormat& format);

}  // namespace heba
