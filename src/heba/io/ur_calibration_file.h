// The file calibration.conf, in which the controller of an arm of Universal Robots keeps the factory calibration of
// this very arm: lists of six numbers, base first, that add to the maker's parameters of Denavit and Hartenberg
// (heba/robot/ur_robots.def),
//
//   [mounting]
//   delta_theta = [ -8.2e-05, ... ]   # rad
//   delta_a = [ ... ]                 # m
//   delta_d = [ ... ]                 # m
//   delta_alpha = [ ... ]             # rad
//   joint_checksum = [ 0x6e0f7bf, ... ]
//   calibration_status = 2            # 0 not initialised, 1 not linearised, 2 linearised
//
// Axes 2, 3 and 4 are nearly parallel, and these parameters place the origin of a joint at its common normal with the
// next one, so that delta_d of these joints may be hundreds of metres which cancel.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "heba/base/error.h"
#include "heba/robot/arm.h"

namespace heba {

// Returns whether the text of a file is such a calibration: whether it has the section [mounting].
bool IsUrCalibration(std::string_view text);

// Returns the arm of Universal Robots called `arm_name` with the calibration in `text`; its parameters are those of
// ArmFromAxes, so that they are small for parallel axes. `file` is the name of the file in messages. Throws InputError
// if there is no such arm, if the text is of another form, or if the arm is not calibrated (status 0).
Arm ParseUrCalibration(const std::string& text, const std::filesystem::path& file, const std::string& arm_name);

// Returns the text of such a file; its kinematics are those of the arm to about 1e-8 m and rad. Axes that are parallel
// to 1e-8 rad keep the d of the arm. The line joint_checksum, by which a controller recognises its joints, is a
// placeholder. Returns a Failure if the arm's name is not that of an arm of Universal Robots, if the axis of the first
// joint is not the base's z axis, or if the tip is not on the axis of the last joint.
Outcome<std::string> UrCalibrationText(const Arm& arm);

}  // namespace heba
