// Reads the section `robot` of a config, the recorded joints of the captures, and refine.kinematics.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/robot/arm.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads `joint_angle` of `captures`: whether recorded joints are in degrees.
bool ReadJointsAreDeg(MapReader& captures);
// Returns the columns that hold the joints of an arm in a file: j1, j2, ...
std::vector<std::string> JointColumns(const Arm& arm);
// Returns the positions of the joints (rad or m) from numbers of a file, whose angles may be in degrees.
Eigen::VectorXd PositionsOf(const Arm& arm, const std::vector<double>& numbers, bool are_deg);

// Reads the recorded joints (rad or m) of the captures with these names: columns j1 to jN and optionally image. The
// rows belong to the captures by image, or by order.
std::vector<std::vector<double>> ReadJoints(const Arm& arm, const std::filesystem::path& file, bool are_deg,
                                            const std::vector<std::string>& names);

// Returns the text of such a file, with positions in rad or m, one list per image.
std::string JointsFileText(const Arm& arm, const std::vector<std::string>& images,
                           const std::vector<Eigen::VectorXd>& joints);

// Reads one sigma of the scale of a robot's translations, `scale_sigma`; that of a calibrated robot if the reader has
// only the calibration of an arm, `kinematics`. Nothing if nothing is stated.
std::optional<double> ReadRobotScale(MapReader& reader);
// Returns whether the section `robot` has no key but `scale_sigma`, which names no arm.
bool NamesNoArm(const ConfigValue& robot);
// Reads an arm from the keys model, base_link, tip_link, kinematics, payload, tool and joints_near. Adds the files that
// it reads to `data_files`.
RobotArm ReadRobotArm(MapReader& reader, std::vector<std::filesystem::path>* data_files);

// Returns whether the numbers of a pose format are the joints of an arm, and these joints, rad or m.
bool IsOfJoints(const PoseFormat& format, const Arm& arm);
std::vector<double> JointsOfNumbers(const Arm& arm, const PoseFormat& format, const std::vector<double>& numbers);

// Reads the only arm and, unless `joints_file` is empty, the joints of the captures.
void ReadRobotSection(MapReader& root, const std::filesystem::path& joints_file, RunConfig* config);

// Reads which errors of the arms are estimated. `arms` are those whose kinematics are known, `key` the one that names
// an arm.
Kinematics ReadKinematics(MapReader& refine, const std::vector<Arm>& arms, const std::string& key);

}  // namespace heba
