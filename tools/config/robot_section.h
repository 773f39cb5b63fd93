// Reads the section `robot` of a config, the recorded joints of the captures, and refine.kinematics.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/robot/arm.h"
#include "tools/config/capture_section.h"
#include "tools/config/run_config_types.h"

namespace heba {

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
// An arm, and the files that it was read from.
struct ArmOfFiles {
  RobotArm robot;
  std::vector<std::filesystem::path> files;
};
// Reads an arm from the keys model, base_link, tip_link, kinematics, payload, tool and joints_near.
ArmOfFiles ReadRobotArm(MapReader& reader);

// Returns whether the numbers of a pose format are the joints of an arm, and these joints, rad or m.
bool IsOfJoints(const PoseFormat& format, const Arm& arm);
std::vector<double> JointsOfNumbers(const Arm& arm, const PoseFormat& format, const std::vector<double>& numbers);

// The only arm.
struct RobotSection {
  std::optional<RobotArm> robot;
  std::optional<double> scale_sigma;        // Dataset::robot_scale_sigmas.
  std::vector<std::vector<double>> joints;  // One list per capture; empty if they are not recorded.
  std::vector<std::filesystem::path> files;
};
// Reads the only arm and the recorded joints of the captures. `config` is the file of the config.
RobotSection ReadRobotSection(MapReader& root, const CaptureSection& captures, const std::filesystem::path& config);

// Reads which errors of the arms are estimated. `arms` are those whose kinematics are known, `key` the one that names
// an arm.
Kinematics ReadKinematics(MapReader& refine, const std::vector<Arm>& arms, const std::string& key);

}  // namespace heba
