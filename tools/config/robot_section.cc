#include "tools/config/robot_section.h"

#include <algorithm>
#include <map>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/scale_sigmas.h"
#include "heba/io/arm_file.h"
#include "heba/io/pose_file.h"
#include "heba/io/pose_source.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/urdf_arm.h"

namespace heba {
namespace {

// Reads the arm of a URDF, between two of its links.
Arm ReadArmOfUrdf(MapReader& reader, const std::filesystem::path& file) {
  Arm arm = ReadUrdfArm(file, reader.Text("base_link", ""), reader.Text("tip_link", "")).arm;
  arm.name = file.stem().string();
  return arm;
}

// Returns the arm with the mass on its flange, in whose frame `centre` is.
Arm ReadPayload(const ConfigValue& value, const Arm& arm, MapReader& robot) {
  if (arm.load == nullptr) {
    value.Fail("the masses of the links of the arm " + arm.name +
               " are not known, without which a payload has no effect");
  }
  MapReader reader(value);
  PointMass payload;
  payload.mass_kg = reader.QuantityOf("mass", Quantity::kMass);
  if (payload.mass_kg < 0) reader.Get("mass").Fail("must not be negative");
  payload.centre_m = reader.Get("centre").AsVector3(Quantity::kLength);
  reader.Record("centre", reader.Get("centre").node());
  reader.Finish();
  robot.Record("payload", reader.used());
  return WithPayload(arm, payload);
}

}  // namespace

std::vector<std::vector<double>> ReadJoints(const Arm& arm, const std::filesystem::path& file, bool are_deg,
                                            const std::vector<std::string>& names) {
  const std::vector<PoseRow> rows = ReadPoseFile(file, NumbersFormat(JointColumns(arm)));
  const bool has_images = !rows.front().image.empty();
  if (!has_images && rows.size() != names.size()) {
    throw InputError(file.string() + ": has " + std::to_string(rows.size()) + " rows for " +
                     std::to_string(names.size()) + " captures; a column image would say which belong together");
  }
  std::map<std::string, const PoseRow*> row_of_image;
  for (const PoseRow& row : rows) row_of_image[row.image] = &row;
  std::vector<std::vector<double>> joints;
  for (size_t i = 0; i < names.size(); ++i) {
    const PoseRow* row = &rows[i < rows.size() ? i : 0];
    if (has_images) {
      const auto found = row_of_image.find(names[i]);
      if (found == row_of_image.end()) throw InputError(file.string() + ": has no row for the capture " + names[i]);
      row = found->second;
    }
    const Eigen::VectorXd positions = PositionsOf(arm, row->numbers, are_deg);
    joints.emplace_back(positions.begin(), positions.end());
  }
  return joints;
}

std::string JointsFileText(const Arm& arm, const std::vector<std::string>& images,
                           const std::vector<Eigen::VectorXd>& joints) {
  CHECK_EQ(images.size(), joints.size());
  std::string text = "image," + Join(JointColumns(arm), ",") + "\n";
  for (size_t i = 0; i < images.size(); ++i) {
    text += images[i];
    for (const double joint : joints[i]) text += "," + RoundTrip(joint);
    text += "\n";
  }
  return text;
}

std::vector<std::string> JointColumns(const Arm& arm) {
  std::vector<std::string> columns;
  for (int j = 0; j < arm.num_joints(); ++j) columns.push_back("j" + std::to_string(j + 1));
  return columns;
}

Eigen::VectorXd PositionsOf(const Arm& arm, const std::vector<double>& numbers, bool are_deg) {
  CHECK_EQ(numbers.size(), arm.joints.size());
  Eigen::VectorXd positions(arm.num_joints());
  for (size_t j = 0; j < numbers.size(); ++j) {
    const bool is_in_deg = are_deg && arm.joints[j].is_turning;
    positions[static_cast<Eigen::Index>(j)] = is_in_deg ? DegToRad(numbers[j]) : numbers[j];
  }
  return positions;
}

std::optional<double> ReadRobotScale(MapReader& reader) {
  if (reader.Has("scale_sigma")) return reader.Ratio("scale_sigma");
  if (reader.Has("kinematics")) return kCalibratedRobotScaleSigma;
  return std::nullopt;
}

bool NamesNoArm(const ConfigValue& robot) {
  return robot.IsMap() && robot.node().size() == 1 && robot.node()["scale_sigma"].IsDefined();
}

ArmOfFiles ReadRobotArm(MapReader& reader) {
  ArmOfFiles read;
  RobotArm& robot = read.robot;
  if (reader.Get("model").AsText().ends_with(".urdf")) {
    robot.arm = ReadArmOfUrdf(reader, read.files.emplace_back(reader.InputPath("model")));
  } else {
    robot.arm = *FindArm(reader.Choice("model", ArmNames()));
  }
  if (reader.Has("kinematics")) {
    robot.arm = ReadArmFile(read.files.emplace_back(reader.InputPath("kinematics")), robot.arm);
  }
  if (const std::optional<ConfigValue> payload = reader.Find("payload"))
    robot.arm = ReadPayload(*payload, robot.arm, reader);
  if (const std::optional<ConfigValue> tool = reader.Find("tool")) {
    robot.tip_from_gripper = ReadPose(*tool);
    reader.Record("tool", PoseNode(robot.tip_from_gripper));
  }
  if (const std::optional<ConfigValue> near = reader.Find("joints_near")) {
    const std::vector<ConfigValue> items = near->AsList();
    if (items.size() != static_cast<size_t>(robot.arm.num_joints())) {
      near->Fail("the arm has " + std::to_string(robot.arm.num_joints()) + " joints, not " +
                 std::to_string(items.size()));
    }
    robot.joints_near.resize(robot.arm.num_joints());
    YAML::Node used(YAML::NodeType::Sequence);
    for (size_t j = 0; j < items.size(); ++j) {
      const Quantity quantity = robot.arm.joints[j].is_turning ? Quantity::kAngle : Quantity::kLength;
      robot.joints_near[static_cast<Eigen::Index>(j)] = items[j].AsQuantity(quantity);
      used.push_back(items[j].node());
    }
    reader.Record("joints_near", used);
  }
  return read;
}

RobotSection ReadRobotSection(MapReader& root, const CaptureSection& captures, const std::filesystem::path& config) {
  RobotSection section;
  const std::filesystem::path& joints_file = captures.joints_file;
  const std::optional<ConfigValue> value = root.Find("robot");
  if (!value) {
    if (!joints_file.empty()) throw InputError(config.string() + ": captures.joints needs an arm (robot.model)");
    return section;
  }
  if (value->IsText()) value->Fail("must be a mapping: {model: " + value->AsText() + "}");
  MapReader reader(*value);
  section.scale_sigma = ReadRobotScale(reader);
  if (NamesNoArm(*value)) {
    root.Record("robot", reader.used());
    if (!joints_file.empty()) value->Fail("captures.joints needs an arm (robot.model)");
    return section;
  }
  ArmOfFiles read = ReadRobotArm(reader);
  reader.Finish();
  root.Record("robot", reader.used());
  const Arm& arm = read.robot.arm;
  const PoseFormat& format = captures.arm.reading.format;
  if (!joints_file.empty()) {
    std::vector<std::string> names;
    for (const Recording& capture : captures.captures) names.push_back(capture.name);
    section.joints = ReadJoints(arm, joints_file, captures.arm.joints_are_deg, names);
  } else if (IsOfJoints(format, arm)) {
    for (const std::vector<double>& numbers : captures.arm.numbers) {
      section.joints.push_back(JointsOfNumbers(arm, format, numbers));
    }
  }
  section.robot = std::move(read.robot);
  section.files = std::move(read.files);
  return section;
}

bool IsOfJoints(const PoseFormat& format, const Arm& arm) {
  return (!format.robot.empty() || format.arm != nullptr) &&
         format.columns.size() == static_cast<size_t>(arm.num_joints());
}

std::vector<double> JointsOfNumbers(const Arm& arm, const PoseFormat& format, const std::vector<double>& numbers) {
  const Eigen::VectorXd positions = PositionsOf(arm, numbers, format.angle_unit == "deg");
  return {positions.begin(), positions.end()};
}

Kinematics ReadKinematics(MapReader& refine, const std::vector<Arm>& arms, const std::string& key) {
  const std::optional<ConfigValue> value = refine.Find("kinematics");
  if (!value) {
    if (!arms.empty()) refine.Record("kinematics", YAML::Node("auto"));
    return Kinematics::kAuto;
  }
  Kinematics kinematics = Kinematics::kAuto;
  if (value->IsText()) {
    const std::string choice = value->AsChoice({"auto", "none", "offsets", "geometry", "gravity"});
    if (choice == "geometry") value->Fail("must be a list: [offsets, geometry]");
    if (choice == "gravity") value->Fail("must be a list: [offsets, geometry, gravity]");
    kinematics = choice == "auto" ? Kinematics::kAuto : choice == "none" ? Kinematics::kNone : Kinematics::kOffsets;
  } else {
    std::vector<std::string> parts;
    for (const ConfigValue& item : value->AsList()) {
      parts.push_back(item.AsChoice({"offsets", "geometry", "gravity"}));
      if (std::count(parts.begin(), parts.end(), parts.back()) > 1) item.Fail("'" + parts.back() + "' is listed twice");
    }
    const auto has = [&](const char* part) { return std::find(parts.begin(), parts.end(), part) != parts.end(); };
    if (!has("offsets")) value->Fail("offsets must be among them");
    if (has("gravity") && !has("geometry")) value->Fail("gravity needs geometry beside it");
    kinematics = has("gravity") ? Kinematics::kGravity : has("geometry") ? Kinematics::kGeometry : Kinematics::kOffsets;
  }
  refine.Record("kinematics", value->node());
  if (arms.empty() && kinematics != Kinematics::kNone) value->Fail("needs an arm (" + key + ")");
  for (const Arm& arm : arms) {
    if (kinematics != Kinematics::kGravity || arm.load != nullptr) continue;
    value->Fail("gravity needs the masses of the links of the arm " + arm.name +
                ", which are not known; a URDF with <inertial> states them");
  }
  return kinematics;
}

}  // namespace heba
