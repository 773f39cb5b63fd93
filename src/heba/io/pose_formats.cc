#include "heba/io/pose_formats.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include <Eigen/LU>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/ur_kinematics.h"

namespace heba {
namespace {

enum class RotationKind { kQuaternionXyzw, kQuaternionWxyz, kRotationVector, kEuler, kExtrinsic, kMatrix };

struct RotationForm {
  std::string name;
  RotationKind kind = RotationKind::kMatrix;
  int num_numbers = 0;
  // Axes of kEuler and kExtrinsic, in the order of the name: 0, 1, 2 for x, y, z.
  std::array<int, 3> axes = {};
};

std::vector<RotationForm> MakeRotationForms() {
  std::vector<RotationForm> forms = {{"quaternion_xyzw", RotationKind::kQuaternionXyzw, 4, {}},
                                     {"quaternion_wxyz", RotationKind::kQuaternionWxyz, 4, {}},
                                     {"rotation_vector", RotationKind::kRotationVector, 3, {}},
                                     {"matrix", RotationKind::kMatrix, 9, {}}};
  const std::string axis_names = "xyz";
  const auto add_all_orders = [&](const std::string& prefix, RotationKind kind) {
    for (const int first : {2, 0, 1}) {
      for (const int second : {1, 0, 2}) {
        for (const int third : {0, 2, 1}) {
          if (first == second || second == third) continue;
          const std::string order = {axis_names[first], axis_names[second], axis_names[third]};
          forms.push_back({prefix + order, kind, 3, {first, second, third}});
        }
      }
    }
  };
  add_all_orders("euler_", RotationKind::kEuler);
  add_all_orders("extrinsic_", RotationKind::kExtrinsic);
  return forms;
}

const std::vector<RotationForm>& RotationForms() {
  static const std::vector<RotationForm> forms = MakeRotationForms();
  return forms;
}

const RotationForm* FindRotationForm(std::string_view name) { return FindEntry(RotationForms(), name); }

const RotationForm& FormOf(const PoseFormat& format) {
  const RotationForm* form = FindRotationForm(format.rotation);
  CHECK(form != nullptr) << "rotation " << format.rotation;
  return *form;
}

bool HasAngles(const RotationForm& form) {
  return form.kind == RotationKind::kRotationVector || form.kind == RotationKind::kEuler ||
         form.kind == RotationKind::kExtrinsic;
}

// Returns one `unit` in the base unit of the quantity.
double UnitFactor(const std::string& unit, Quantity quantity) {
  const ParsedQuantity one = ParseQuantity("1 " + unit, quantity);
  CHECK(one.fault.empty()) << one.fault;
  return one.value;
}

double RadPerUnit(const PoseFormat& format) { return UnitFactor(format.angle_unit, Quantity::kAngle); }

Eigen::Quaterniond Turn(int axis, double angle_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::Unit(axis)));
}

// Returns the angles of R = Ri(first) Rj(second) Rk(third).
Eigen::Vector3d EulerAngles(const Eigen::Matrix3d& rotation, const std::array<int, 3>& axes) {
  const int i = axes[0];
  const int j = axes[1];
  const int k = axes[2];
  const double parity = (i + 1) % 3 == j ? 1.0 : -1.0;
  const int l = 3 - i - j;
  // The first angle is undetermined in gimbal lock. The other two are computed from the rotation that remains after the
  // first one, so that the three together always reproduce R exactly.
  constexpr double kLocked = 1e-15;
  const double sine = i == k ? rotation(j, i) : -parity * rotation(j, k);
  const double cosine = i == k ? -parity * rotation(l, i) : rotation(k, k);
  const double first = std::hypot(sine, cosine) < kLocked ? 0.0 : std::atan2(sine, cosine);
  const Eigen::Matrix3d rest = Turn(i, -first).toRotationMatrix() * rotation;  // Rj(second) Rk(third).
  if (i == k) {
    return {first, std::atan2(-parity * rest(l, i), rest(i, i)), std::atan2(-parity * rest(j, l), rest(j, j))};
  }
  return {first, std::atan2(parity * rest(i, k), rest(k, k)), std::atan2(parity * rest(j, i), rest(j, j))};
}

Outcome<Eigen::Quaterniond> UnitQuaternion(double x, double y, double z, double w) {
  const Eigen::Quaterniond quaternion(w, x, y, z);
  // Rounding to three decimals changes the length by at most 0.001; numbers that are not a quaternion deviate by more
  // than this limit.
  constexpr double kMaxLengthError = 5e-3;
  const double length = quaternion.norm();
  if (!(std::abs(length - 1.0) <= kMaxLengthError)) {
    return Failure{"the quaternion's length is " + Significant(length, 4) + ", not 1"};
  }
  return quaternion.normalized();
}

Outcome<Eigen::Matrix3d> RotationFromMatrix(const Eigen::Matrix3d& matrix) {
  // The same limit as for quaternions.
  constexpr double kMaxError = 5e-3;
  const double error = (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= kMaxError)) {
    return Failure{"the matrix is not a rotation: its columns are not of length 1 and at right angles (off by " +
                   Significant(error, 2) + ")"};
  }
  if (matrix.determinant() < 0) return Failure{"the matrix is a reflection, not a rotation: its determinant is -1"};
  return NearestRotation(matrix);
}

Outcome<Rigid3d> PoseFromMatrix(std::span<const double> numbers, double m_per_unit) {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  if (numbers.size() == 16) {
    Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
    const auto is_last = [](const Eigen::Vector4d& row) {
      constexpr double kPrinted = 1e-6;
      return (row - Eigen::Vector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() < kPrinted;
    };
    // Some controllers, such as Franka's, report a matrix column by column.
    if (!is_last(matrix.row(3)) && is_last(matrix.col(3))) matrix.transposeInPlace();
    if (!is_last(matrix.row(3))) return Failure{"the last row of the matrix is not 0 0 0 1"};
    rotation = matrix.topLeftCorner<3, 3>();
    translation = matrix.topRightCorner<3, 1>();
  } else {
    rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data() + 3);
    translation = Eigen::Map<const Eigen::Vector3d>(numbers.data());
  }
  const Outcome<Eigen::Matrix3d> exact = RotationFromMatrix(rotation);
  if (!exact) return Failure{exact.reason()};
  return Rigid3d(*exact, m_per_unit * translation);
}

std::string CheckRange(const PoseFormat& format, std::span<const double> numbers) {
  // Far beyond any robot, and far below values that overflow.
  constexpr double kMaxNumber = 1e9;
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isfinite(numbers[i])) return "'" + format.columns[i] + "' is not finite";
    if (std::abs(numbers[i]) > kMaxNumber) return "'" + format.columns[i] + "' is larger than any robot's";
  }
  return "";
}

}  // namespace

const std::vector<PoseFormat>& PoseFormats() {
  static const std::vector<PoseFormat> formats = {
#define HEBA_POSE_FORMAT(name, columns, translation_unit, rotation, angle_unit, controller_form) \
  {#name, Split(columns, ' '), translation_unit, rotation, angle_unit, "", nullptr, controller_form},
#include "heba/io/pose_formats.def"
#undef HEBA_POSE_FORMAT
  };
  return formats;
}

std::vector<std::string> PoseFormatNames() { return NamesOf(PoseFormats()); }

const PoseFormat* FindPoseFormat(std::string_view name) { return FindEntry(PoseFormats(), name); }

std::vector<std::string> PoseRotationNames() { return NamesOf(RotationForms()); }

PoseFormat JointFormat(const std::string& robot, const std::string& angle_unit) {
  CHECK(FindUrRobot(robot) != nullptr) << "robot " << robot;
  return {"joints", {"j1", "j2", "j3", "j4", "j5", "j6"}, "m", "joints", angle_unit, robot};
}

PoseFormat NumbersFormat(const std::vector<std::string>& columns) { return {"numbers", columns, "m", "numbers", ""}; }

PoseFormat JointFormat(const std::string& name, std::shared_ptr<const UrdfArm> arm, const std::string& angle_unit) {
  PoseFormat format{"joints", arm->joint_names, "m", "joints", angle_unit, name};
  format.arm = std::move(arm);
  return format;
}

namespace {

// Returns the columns with those of these names, in this order, moved to the positions from `first` on; the same
// columns unless all names exist.
std::vector<std::string> WithNamesAt(std::vector<std::string> columns, size_t first,
                                     const std::vector<std::string>& names) {
  const auto place_of = [&](const std::string& name) {
    return std::find_if(columns.begin(), columns.end(),
                        [&](const std::string& column) { return BareColumnName(column) == name; });
  };
  std::vector<std::string> found;
  for (const std::string& name : names) {
    if (place_of(name) == columns.end()) return columns;
    found.push_back(*place_of(name));
  }
  for (const std::string& name : names) columns.erase(place_of(name));
  const auto at = columns.begin() + static_cast<std::ptrdiff_t>(std::min(first, columns.size()));
  columns.insert(at, found.begin(), found.end());
  return columns;
}

}  // namespace

std::string BareColumnName(const std::string& name) {
  std::string bare;
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) break;
    bare += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return bare;
}

PoseFormat ReadPoseFormat(const ConfigValue& value) {
  if (!value.IsMap()) return *FindPoseFormat(value.AsChoice(PoseFormatNames()));
  MapReader reader(value);
  PoseFormat format;
  const ConfigValue columns = reader.Get("columns");
  for (const ConfigValue& column : columns.AsList()) {
    const std::string name = column.AsText();
    const std::vector<std::string>& known = format.file_columns;
    if (name != kNoColumn && std::find(known.begin(), known.end(), name) != known.end()) {
      column.Fail("'" + name + "' occurs twice");
    }
    format.file_columns.push_back(name);
    if (name != kNoColumn && name != kImageColumn && name != kRoleColumn && name != kTimeColumn)
      format.columns.push_back(name);
  }
  // Names take precedence over positions: x, y and z are always the position, and qx, qy, qz and qw the quaternion.
  format.columns = WithNamesAt(std::move(format.columns), 0, {"x", "y", "z"});
  format.translation_unit = reader.Choice("translation", {"m", "cm", "mm", "in"});
  format.rotation = reader.Choice("rotation", PoseRotationNames());
  const RotationForm& form = FormOf(format);
  if (form.kind == RotationKind::kQuaternionXyzw) {
    format.columns = WithNamesAt(std::move(format.columns), 3, {"qx", "qy", "qz", "qw"});
  } else if (form.kind == RotationKind::kQuaternionWxyz) {
    format.columns = WithNamesAt(std::move(format.columns), 3, {"qw", "qx", "qy", "qz"});
  }
  if (HasAngles(form)) {
    format.angle_unit = reader.Choice("angle", {"rad", "deg"});
  } else if (const std::optional<ConfigValue> angle = reader.Find("angle")) {
    angle->Fail(format.rotation + " has no angles; leave this out");
  }
  reader.Finish();
  const bool whole_matrix = form.kind == RotationKind::kMatrix && format.columns.size() == 16;
  if (!whole_matrix && static_cast<int>(format.columns.size()) != 3 + form.num_numbers) {
    columns.Fail(std::to_string(format.columns.size()) + " columns of numbers; " + format.rotation + " needs " +
                 std::to_string(3 + form.num_numbers) + ": x, y, z and " + std::to_string(form.num_numbers) +
                 " of the rotation" + (form.kind == RotationKind::kMatrix ? ", or the 16 of the 4 x 4 matrix" : ""));
  }
  return format;
}

PoseFormat WithUnits(const PoseFormat& format, const ConfigValue& units) {
  if (format.name != "matrix") {
    units.Fail(format.name.empty() ? "a pose format of your own contains its units; leave this out"
                                   : "pose format '" + format.name + "' is always in " + format.translation_unit +
                                         "; leave this out, or describe the columns by a mapping");
  }
  PoseFormat changed = format;
  changed.translation_unit = units.AsChoice({"m", "mm"});
  return changed;
}

std::vector<PoseFormat> FormatsOfSameColumns(const PoseFormat& format) {
  std::vector<PoseFormat> formats = {format};
  const auto add = [&](PoseFormat other) {
    other.name = format.name == "joints" ? "joints" : "";
    if (other.rotation == format.rotation && other.angle_unit == format.angle_unit && other.robot == format.robot)
      return;
    formats.push_back(std::move(other));
  };
  const std::vector<std::string> angle_units = {"rad", "deg"};
  if (format.arm) {
    for (const std::string& unit : angle_units) add(JointFormat(format.robot, format.arm, unit));
    return formats;
  }
  if (!format.robot.empty()) {
    for (const std::string& robot : UrRobotNames()) {
      for (const std::string& unit : angle_units) add(JointFormat(robot, unit));
    }
    return formats;
  }
  for (const RotationForm& form : RotationForms()) {
    if (form.num_numbers != FormOf(format).num_numbers) continue;
    PoseFormat other = format;
    other.rotation = form.name;
    if (!HasAngles(form)) {
      add(other);
      continue;
    }
    for (const std::string& unit : angle_units) {
      other.angle_unit = unit;
      add(other);
    }
  }
  return formats;
}

YAML::Node PoseFormatNode(const PoseFormat& format) {
  if (!format.name.empty()) return YAML::Node(format.name);
  YAML::Node node(YAML::NodeType::Map);
  for (const std::string& column : format.file_columns.empty() ? format.columns : format.file_columns) {
    node["columns"].push_back(column);
  }
  node["translation"] = format.translation_unit;
  node["rotation"] = format.rotation;
  if (!format.angle_unit.empty()) node["angle"] = format.angle_unit;
  return node;
}

namespace {

// Quotes a name that contains YAML syntax, such as brackets.
std::string YamlText(const std::string& name) {
  const bool is_plain = std::all_of(name.begin(), name.end(),
                                    [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
  return is_plain ? name : "'" + Join(Split(name, '\''), "''") + "'";
}

}  // namespace

std::string PoseFormatText(const PoseFormat& format) {
  for (const PoseFormat& known : PoseFormats()) {
    if (format.file_columns.empty() && known.columns == format.columns &&
        known.translation_unit == format.translation_unit && known.rotation == format.rotation &&
        known.angle_unit == format.angle_unit) {
      return known.name;
    }
  }
  std::vector<std::string> columns;
  for (const std::string& column : format.file_columns.empty() ? format.columns : format.file_columns) {
    columns.push_back(YamlText(column));
  }
  return "{columns: [" + Join(columns, ", ") + "], translation: " + format.translation_unit +
         ", rotation: " + format.rotation + (format.angle_unit.empty() ? "" : ", angle: " + format.angle_unit) + "}";
}

namespace {

// Returns the pose that numbers within their ranges are.
Outcome<Rigid3d> PoseOf(const PoseFormat& format, std::span<const double> numbers) {
  if (format.rotation == "numbers") return Rigid3d();
  if (format.arm) {
    const Arm& arm = format.arm->arm;
    CHECK_EQ(numbers.size(), arm.joints.size());
    Eigen::VectorXd joints(arm.num_joints());
    for (size_t i = 0; i < numbers.size(); ++i) {
      joints[static_cast<Eigen::Index>(i)] = numbers[i] * (arm.joints[i].is_turning ? RadPerUnit(format) : 1);
    }
    return BaseFromTip(arm, joints);
  }
  if (!format.robot.empty()) {
    JointAngles joints_rad;
    for (size_t i = 0; i < joints_rad.size(); ++i) joints_rad[i] = RadPerUnit(format) * numbers[i];
    return BaseFromFlange(*FindUrRobot(format.robot), joints_rad);
  }
  const RotationForm& form = FormOf(format);
  const double m_per_unit = UnitFactor(format.translation_unit, Quantity::kLength);
  if (form.kind == RotationKind::kMatrix) return PoseFromMatrix(numbers, m_per_unit);

  const Eigen::Vector3d translation = m_per_unit * Eigen::Map<const Eigen::Vector3d>(numbers.data());
  const std::span<const double> r = numbers.subspan(3);
  if (form.kind == RotationKind::kQuaternionXyzw || form.kind == RotationKind::kQuaternionWxyz) {
    const Outcome<Eigen::Quaterniond> rotation = form.kind == RotationKind::kQuaternionXyzw
                                                     ? UnitQuaternion(r[0], r[1], r[2], r[3])
                                                     : UnitQuaternion(r[1], r[2], r[3], r[0]);
    if (!rotation) return Failure{rotation.reason()};
    return Rigid3d(*rotation, translation);
  }
  const Eigen::Vector3d angles_rad = RadPerUnit(format) * Eigen::Map<const Eigen::Vector3d>(r.data());
  if (form.kind == RotationKind::kRotationVector) return Rigid3d(ExpRotation(angles_rad), translation);
  const Eigen::Quaterniond first = Turn(form.axes[0], angles_rad[0]);
  const Eigen::Quaterniond second = Turn(form.axes[1], angles_rad[1]);
  const Eigen::Quaterniond third = Turn(form.axes[2], angles_rad[2]);
  return Rigid3d(form.kind == RotationKind::kEuler ? first * second * third : third * second * first, translation);
}

}  // namespace

Outcome<Rigid3d> PoseFromNumbers(const PoseFormat& format, std::span<const double> numbers) {
  CHECK_EQ(numbers.size(), format.columns.size());
  const std::string fault = CheckRange(format, numbers);
  if (!fault.empty()) return Failure{fault};
  Outcome<Rigid3d> pose = PoseOf(format, numbers);
  constexpr double kFarthestM = 1e6;
  if (pose && (!(pose->translation.norm() < kFarthestM) || !pose->rotation.coeffs().allFinite())) {
    return Failure{"the pose is absurdly far away (" + Significant(pose->translation.norm(), 2) + " m)"};
  }
  return pose;
}

std::vector<double> NumbersFromPose(const PoseFormat& format, const Rigid3d& pose) {
  const RotationForm& form = FormOf(format);
  const Eigen::Vector3d translation = pose.translation / UnitFactor(format.translation_unit, Quantity::kLength);
  std::vector<double> numbers;
  if (form.kind == RotationKind::kMatrix && format.columns.size() == 16) {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = pose.Matrix();
    matrix.topRightCorner<3, 1>() = translation;
    numbers.assign(matrix.data(), matrix.data() + 16);
    return numbers;
  }
  numbers.assign(translation.data(), translation.data() + 3);
  const auto append = [&numbers](const auto& values) { numbers.insert(numbers.end(), values.begin(), values.end()); };
  const Eigen::Quaterniond& q = pose.rotation;
  switch (form.kind) {
    case RotationKind::kQuaternionXyzw:
      append(std::array<double, 4>{q.x(), q.y(), q.z(), q.w()});
      break;
    case RotationKind::kQuaternionWxyz:
      append(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()});
      break;
    case RotationKind::kRotationVector:
      append(Eigen::Vector3d(LogRotation(q) / RadPerUnit(format)));
      break;
    case RotationKind::kEuler:
      append(Eigen::Vector3d(EulerAngles(pose.RotationMatrix(), form.axes) / RadPerUnit(format)));
      break;
    case RotationKind::kExtrinsic: {
      // Rotations about fixed axes equal rotations about rotated axes in the reverse order.
      const Eigen::Vector3d reversed = EulerAngles(pose.RotationMatrix(), {form.axes[2], form.axes[1], form.axes[0]});
      append(Eigen::Vector3d(reversed.reverse() / RadPerUnit(format)));
      break;
    }
    case RotationKind::kMatrix: {
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> matrix = pose.RotationMatrix();
      numbers.insert(numbers.end(), matrix.data(), matrix.data() + 9);
      break;
    }
  }
  return numbers;
}

}  // namespace heba
