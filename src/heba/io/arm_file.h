// Files of an arm's kinematics.
#pragma once

#include <filesystem>

#include "heba/robot/arm.h"

namespace heba {

// Reads the kinematics of one arm from the file in which its controller of Universal Robots keeps the factory
// calibration (heba/io/ur_calibration_file.h), from that in which ROS keeps it (ur_calibration: the mapping
// `kinematics` of shoulder, upper_arm, forearm, wrist_1, wrist_2 and wrist_3, each with x, y, z in m and roll, pitch,
// yaw in rad), or from one that heba wrote (ArmFileText). `nominal` provides the name. Throws InputError if the file is
// of another form, or if the arm does not have six turning joints.
Arm ReadArmFile(const std::filesystem::path& path, const Arm& nominal);

// Returns the text of such a file. The tip must lie on the axis of the last joint and have its direction, as the flange
// of Universal Robots' arms; a Failure says if it does not.
Outcome<std::string> ArmFileText(const Arm& arm);

}  // namespace heba
