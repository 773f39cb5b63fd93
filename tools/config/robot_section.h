// Reads the section `robot` of a config, the recorded joints of the captures, and refine.kinematics.
#pragma once

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config.h"

namespace heba {

// Reads the file of recorded joints, `joints` with `joint_angle` of `captures`, if there is one: columns j1 to jN and
// optionally image.
void ReadJointsFile(MapReader& captures, RunConfig* config);

// Reads the arm and, if RunConfig::joints_file names a file, the joints of the captures.
void ReadRobotSection(MapReader& root, RunConfig* config);

// Reads which of the arm's errors are estimated. The arm must have been read.
void ReadKinematics(MapReader& refine, RunConfig* config);

}  // namespace heba
