// The meaning of the numbers of a robot pose: the formats of pose_formats.def, or a user's own.
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

// Names of the columns of a poses file that are not numbers of the pose, and the name of a column that is ignored.
inline constexpr std::string_view kImageColumn = "image";
inline constexpr std::string_view kRoleColumn = "role";
inline constexpr std::string_view kTimeColumn = "time";
inline constexpr std::string_view kNoColumn = "-";

// A way to write a pose as a row of numbers.
struct PoseFormat {
  std::string name;  // Name in pose_formats.def; empty for a user's own format.
  // The columns in the order of the numbers: x, y, z, then the rotation. For the rotation `matrix`, either x, y, z and
  // the nine numbers of the rotation matrix row by row (12 columns), or the 4 x 4 matrix row by row (16 columns). A 4 x
  // 4 matrix that was written column by column is recognised by its last row.
  std::vector<std::string> columns;
  std::string translation_unit;  // One of m, cm, mm, in.
  std::string rotation;          // One of PoseRotationNames(), or `joints`.
  std::string angle_unit;        // One of rad, deg; empty if the rotation has no angles.
  // If not empty, the columns are the joints of this arm (of ur_robots.def or of a URDF), base first.
  std::string robot = {};
  std::shared_ptr<const UrdfArm> arm = nullptr;  // Set for an arm of a URDF.
  std::string controller_form = {};              // The controller's syntax of a pose (pose_formats.def); may be empty.
  // The columns of a file without a header, in file order: those of `columns`, image and role, and - for a column that
  // is ignored. Empty for the formats of pose_formats.def.
  std::vector<std::string> file_columns = {};
};

// Returns all formats, in the order of pose_formats.def.
const std::vector<PoseFormat>& PoseFormats();
std::vector<std::string> PoseFormatNames();
// Returns null if there is no format of that name.
const PoseFormat* FindPoseFormat(std::string_view name);

// Returns quaternion_xyzw, quaternion_wxyz, rotation_vector, matrix, and for every order abc of axes
//   euler_abc      R = Ra(first) Rb(second) Rc(third): each rotation about the already rotated axes
//   extrinsic_abc  R = Rc(third) Rb(second) Ra(first): each rotation about the fixed axes
std::vector<std::string> PoseRotationNames();

// Returns the format of joint angles of an arm of ur_robots.def, in columns j1 to j6. The nominal forward kinematics
// give the flange's pose; the factory calibration of the single arm is not used.
PoseFormat JointFormat(const std::string& robot, const std::string& angle_unit);
// Returns the format of joint values of an arm of a URDF, in columns named like the joints; prismatic joints are in m.
// `name` is the name of the arm in messages and configs.
PoseFormat JointFormat(const std::string& name, std::shared_ptr<const UrdfArm> arm, const std::string& angle_unit);

// Returns the letters and digits at the beginning of a column's name, in lower case: x for "X [mm]".
std::string BareColumnName(const std::string& name);

// Reads the name of a format, or a mapping {columns: [...], translation: mm, rotation: euler_zyx, angle: deg}. The
// columns are listed in the order of a file without a header; they may include image, role, time, and - for a column
// that is ignored. Columns called x, y, z are the position and qx, qy, qz, qw the quaternion, in any order; all others
// are interpreted in the listed order.
PoseFormat ReadPoseFormat(const ConfigValue& value);
// Returns `format` with the unit of translations that `units` names. Throws InputError unless the format is `matrix`,
// the only one for which robots use different units.
PoseFormat WithUnits(const PoseFormat& format, const ConfigValue& units);
// Returns every interpretation of the same columns, `format` first: all other rotations with the same number of
// columns, each with all units of angles; for joints, all other arms of the table. The unit of translations is the
// same.
std::vector<PoseFormat> FormatsOfSameColumns(const PoseFormat& format);
// Returns a node that reads back as the same format, except for the units of `matrix`.
YAML::Node PoseFormatNode(const PoseFormat& format);
// Returns the format of a table with these columns that holds no poses: PoseRow::pose is the identity.
PoseFormat NumbersFormat(const std::vector<std::string>& columns);

// Returns the format as one line of a config: the name of a format of the table, or a mapping.
std::string PoseFormatText(const PoseFormat& format);

// Converts numbers, one per column, to a pose in the frames of the file. Returns a Failure if a number is not finite or
// absurdly large, a quaternion is not of length 1, or a matrix is not a rotation. A quaternion or matrix that was
// rounded to three decimals is accepted and normalised.
Outcome<Rigid3d> PoseFromNumbers(const PoseFormat& format, std::span<const double> numbers);
// Returns the numbers of a pose, the inverse of PoseFromNumbers. `format` must not consist of joints, which are not
// unique (robot/ur_kinematics.h computes all of them). Of the angles that describe one rotation, those are chosen with
// a rotation vector of at most 180 deg; a second Euler angle within 90 deg of 0 if the three axes differ, and from 0 to
// 180 deg if the first axis is used twice.
std::vector<double> NumbersFromPose(const PoseFormat& format, const Rigid3d& pose);

}  // namespace heba
