// What the numbers of a robot's pose mean: the forms of pose_formats.def, or a user's own.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/config/yaml_reader.h"
#include "heba/geometry/rigid3.h"
#include "heba/robot/urdf_arm.h"

namespace heba {

// Columns of a poses file that are no numbers of the pose, and the mark of one that is passed over.
inline constexpr std::string_view kImageColumn = "image";
inline constexpr std::string_view kRoleColumn = "role";
inline constexpr std::string_view kNoColumn = "-";

struct PoseFormat {
  std::string name;  // Of pose_formats.def; empty for a user's own.
  // The file's columns in the order of the numbers: x, y, z, then the rotation's. For the rotation `matrix` either
  // x, y, z and the nine numbers of the rotation row by row (12), or the whole 4 x 4 matrix row by row (16).
  std::vector<std::string> columns;
  std::string translation_unit;  // m, cm, mm, in
  std::string rotation;          // A name of PoseRotationNames().
  std::string angle_unit;        // rad, deg; empty if the rotation has no angles.
  std::string robot = {};  // Not empty: the columns are this arm's joints (ur_robots.def or a URDF's), base first.
  std::shared_ptr<const UrdfArm> arm = nullptr;  // Of a URDF.
  std::string controller_form = {};              // How the controller writes a pose (pose_formats.def); may be empty.
  // The columns of a file without a header, in its order: those of `columns`, image and role, and - for one that means
  // nothing here. A format of the table has none.
  std::vector<std::string> file_columns = {};
};

// In the order of pose_formats.def.
const std::vector<PoseFormat>& PoseFormats();
std::vector<std::string> PoseFormatNames();
// Null if there is none of that name.
const PoseFormat* FindPoseFormat(std::string_view name);

// quaternion_xyzw, quaternion_wxyz, rotation_vector, matrix, and for every order abc of axes
//   euler_abc      R = Ra(first) Rb(second) Rc(third): each turn about the axes as already turned
//   extrinsic_abc  R = Rc(third) Rb(second) Ra(first): each turn about the fixed axes
std::vector<std::string> PoseRotationNames();

// The joints of an arm of ur_robots.def, in columns j1 to j6: its own forward kinematics give the flange's pose,
// without the calibration of the single arm.
PoseFormat JointFormat(const std::string& robot, const std::string& angle_unit);
// The same of an arm of a URDF, its joints in columns of their names; joints that slide are in m. `name` is what
// messages and configs call it.
PoseFormat JointFormat(const std::string& name, std::shared_ptr<const UrdfArm> arm, const std::string& angle_unit);

// The letters and digits that a column's name begins with, in small letters: "X [mm]" is x.
std::string BareColumnName(const std::string& name);

// A name, or a mapping {columns: [...], translation: mm, rotation: euler_zyx, angle: deg}. The columns may hold image
// and role where they stand in a file without a header, and - for a column that means nothing. Columns called x, y, z
// are the position, and qx, qy, qz, qw the quaternion, wherever they stand; all others are taken in their order.
PoseFormat ReadPoseFormat(const ConfigValue& value);
// `format` with the unit of translations that `units` names. InputError unless it is the format `matrix`, the only one
// that robots write in either.
PoseFormat WithUnits(const PoseFormat& format, const ConfigValue& units);
// Every other thing that the same columns could mean: the other forms of a rotation with as many numbers, each unit of
// angles; for joints, the other arms of the table. `format` first. The unit of translations stays.
std::vector<PoseFormat> FormatsOfSameColumns(const PoseFormat& format);
// Reads back as the same format (but for the units of `matrix`).
YAML::Node PoseFormatNode(const PoseFormat& format);
// Returns this format as a config says it, on one line: the name of one of the table, or else a mapping.
std::string PoseFormatText(const PoseFormat& format);

// The pose, of the frames that the file has. `numbers` are as many as the columns. A Failure if a number is not finite
// or absurd, a quaternion is not of length 1, or a matrix is not a rotation; a quaternion or matrix that was rounded to
// three decimals passes and is made exact.
Outcome<Rigid3d> PoseFromNumbers(const PoseFormat& format, std::span<const double> numbers);
// The inverse; joints have none (robot/ur_kinematics.h has them all). Of the angles that give one rotation: rotation
// vectors of at most half a turn; the second of three different axes within a quarter turn of 0, the second of two axes
// from 0 to half a turn.
std::vector<double> NumbersFromPose(const PoseFormat& format, const Rigid3d& pose);

}  // namespace heba
