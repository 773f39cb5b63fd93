// Reads the section `robot` of a config, the recorded joints of the captures, and refine.kinematics.
#pragma once

#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/robot/arm.h"
#include "tools/config/run_config.h"

namespace heba {

// Reads `joint_angle` of `captures`: whether recorded joints are in degrees.
bool ReadJointsAreDeg(MapReader& captures);
// Returns the columns that hold the joints of an arm in a file: j1, j2, ...
std::vector<std::string> JointColumns(const Arm& arm);
// Returns the positions of the joints (rad or m) from numbers of a file, whose angles may be in degrees.
Eigen::VectorXd PositionsOf(const Arm& arm, const std::vector<double>& numbers, bool are_deg);

// Reads the file of recorded joints, `joints` with `joint_angle` of `captures`, if there is one: columns j1 to jN and
// optionally image.
void ReadJointsFile(MapReader& captures, RunConfig* config);

// Reads the arm and, if RunConfig::joints_file names a file, the joints of the captures.
void ReadRobotSection(MapReader& root, RunConfig* config);

// Reads which of the arm's errors are estimated. The arm must have been read.
void ReadKinematics(MapReader& refine, RunConfig* config);

}  // namespace heba
