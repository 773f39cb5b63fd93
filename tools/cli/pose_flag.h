// Reads a pose, the positions of joints, or what has a name from the command line.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heba/io/pose_formats.h"
#include "heba/robot/arm.h"

namespace heba {

// Returns the pose that `text`, the value of the flag --`name`, gives: the numbers of `format`, separated by commas.
// Throws InputError if they are malformed.
Rigid3d PoseOfFlag(const std::string& name, const std::string& text, const PoseFormat& format);

// Likewise, or a mapping of a pose as in a config: {translation: [...], rpy: [...]}.
Rigid3d PoseOrMappingOfFlag(const std::string& name, const std::string& text, const PoseFormat& format);

// Returns the positions of an arm's joints (rad or m) that `text`, the value of the flag --`name`, gives: numbers,
// separated by commas, of which those of turning joints may be in degrees. Throws InputError if they are malformed.
Eigen::VectorXd JointsOfFlag(const std::string& name, const std::string& text, const Arm& arm, bool are_deg);

// Returns the format of --near, a pose, if the run's poses have `format`: the same, or `ros` if those are joints.
const PoseFormat& FormatOfNear(const PoseFormat& format);

// Splits NAME=VALUE, where the name is one of `names`, and returns its index and the value. The only part of a kind
// whose name is empty is meant without a name. Throws InputError, which begins with `what`, if the text has another
// form.
std::pair<size_t, std::string> NamedValue(const std::string& what, const std::string& text,
                                          const std::vector<std::string>& names, const std::string& form);

// Returns what a flag gives for each arm, empty if nothing: the value of the only arm, or ARM=VALUE;ARM=VALUE. Throws
// InputError, which begins with `flag`, if the text has another form; `form` is that of one arm, such as ARM=NUMBERS.
std::vector<std::string> ValuesByArm(const std::string& flag, const std::string& value,
                                     const std::vector<std::string>& robots, const std::string& form);

}  // namespace heba
