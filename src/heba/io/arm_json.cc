#include "heba/io/arm_json.h"

#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "heba/base/units.h"

namespace heba {
namespace {

// Returns the place of a parameter of the arm by its name; nothing if there is none.
std::optional<int> FindPlace(const Arm& arm, const std::string& name) {
  for (int place = 0; place < arm.num_params(); ++place) {
    if (ArmParamName(place) == name) return place;
  }
  return std::nullopt;
}

Json RigidJson(const Arm& arm, const RigidEquivalent& rigid) {
  Json errors = Json::object();
  for (int place = 0; place < arm.num_params(); ++place) {
    if (rigid.errors[place] != 0) errors[ArmParamName(place)] = rigid.errors[place];
  }
  return Json{{"errors", errors}, {"left_m", rigid.left_m}, {"left_rad", rigid.left_rad}};
}

RigidEquivalent ReadRigidJson(const JsonReader& reader, const Arm& arm) {
  RigidEquivalent rigid;
  rigid.errors = Eigen::VectorXd::Zero(arm.num_params());
  for (const auto& [name, value] : reader.Get("errors").Members()) {
    const std::optional<int> place = FindPlace(arm, name);
    if (!place || ParamAt(*place) == ArmParam::kCompliance || !value) {
      reader.Get("errors").Fail("'" + name + "' is no parameter of the arm's geometry with a value");
    }
    rigid.errors[*place] = value->Number();
  }
  rigid.left_m = ReadMagnitude(reader, "left_m");
  rigid.left_rad = ReadMagnitude(reader, "left_rad");
  return rigid;
}

}  // namespace

Json ArmJson(const RobotSummary& robot) {
  Json parameters = Json::array();
  for (int place = 0; place < robot.nominal.num_params(); ++place) {
    const ArmJoint& joint = robot.nominal.joints[static_cast<size_t>(place / kNumArmParams)];
    const ArmParam param = ParamAt(place);
    const std::optional<double>& sigma = robot.error_sigmas[static_cast<size_t>(place)];
    const bool is_usual = param != ArmParam::kBeta && param != ArmParam::kCompliance;
    if (!is_usual && joint[param] == 0 && !sigma) continue;
    // An offset is the error of the joint's zero, whatever angle the parameter theta has there.
    const double nominal = param == ArmParam::kTheta ? 0 : joint[param];
    parameters.push_back(Json{{"name", ArmParamName(place)},
                              {"unit", ArmParamUnit(robot.nominal, place)},
                              {"nominal", nominal},
                              {"value", nominal + robot.errors[place]},
                              {"std", OrNull(sigma)}});
  }
  Json undetermined = Json::array();
  for (const auto& [name, with] : robot.undetermined) undetermined.push_back(Json{{"name", name}, {"with", with}});
  Json joints = Json::array();
  for (size_t j = 0; j < robot.nominal.joints.size(); ++j) {
    const ArmJoint& joint = robot.nominal.joints[j];
    joints.push_back(Json{{"theta_rad", joint.theta_rad},
                          {"d_m", joint.d_m},
                          {"a_m", joint.a_m},
                          {"alpha_rad", joint.alpha_rad},
                          {"beta_rad", joint.beta_rad},
                          {"turns", joint.is_turning}});
    if (robot.nominal.load == nullptr) continue;
    const PointMass& link = robot.nominal.load->links[j];
    joints.back()["mass_kg"] = link.mass_kg;
    joints.back()["centre_of_mass_m"] = {link.centre_m.x(), link.centre_m.y(), link.centre_m.z()};
  }
  Json sigma = NoiseJson(robot.noise_before, "before_");
  sigma.update(NoiseJson(robot.noise_after, "after_"));
  Json json{{"model", robot.nominal.name},
            {"angles", robot.has_recorded_joints ? "recorded" : "recovered"},
            {"configuration", robot.configuration},
            {"parameters", parameters},
            {"undetermined", undetermined},
            {"sigma", sigma},
            {"decision", robot.is_estimated ? "estimated" : "declined"},
            {"reason", robot.reason.ToString()},
            {"nominal", Json{{"base_from_first", PoseJson(robot.nominal.base_from_first, "base", "first")},
                             {"joints", joints},
                             {"last_from_tip", PoseJson(robot.nominal.last_from_tip, "last", "tip")},
                             {"tip_from_gripper", PoseJson(robot.tip_from_gripper, "tip", "gripper")}}}};
  if (robot.rigid) json["rigid"] = RigidJson(robot.nominal, *robot.rigid);
  return json;
}

RobotSummary ReadArmJson(const JsonReader& reader) {
  RobotSummary robot;
  robot.nominal.name = reader.Get("model").Text();
  if (robot.nominal.name.empty()) reader.Get("model").Fail("the arm has no name");
  robot.has_recorded_joints = reader.Get("angles").Text() == "recorded";
  robot.configuration = reader.Get("configuration").Text();
  const std::string decision = reader.Get("decision").Text();
  robot.is_estimated = decision == "estimated";
  if (!robot.is_estimated && decision != "declined") reader.Get("decision").Fail("must be estimated or declined");
  robot.reason = Failure(reader.Get("reason").Text());
  const JsonReader nominal = reader.Get("nominal");
  robot.nominal.base_from_first = ReadPoseJson(nominal.Get("base_from_first"), "base", "first");
  robot.nominal.last_from_tip = ReadPoseJson(nominal.Get("last_from_tip"), "last", "tip");
  robot.tip_from_gripper = ReadPoseJson(nominal.Get("tip_from_gripper"), "tip", "gripper");
  std::vector<PointMass> links;  // Earlier results, and arms without known masses, have none.
  for (const JsonReader& joint : nominal.Get("joints").List()) {
    robot.nominal.joints.push_back({joint.Get("theta_rad").Number(), joint.Get("d_m").Number(),
                                    joint.Get("a_m").Number(), joint.Get("alpha_rad").Number(),
                                    joint.Get("beta_rad").Number(), joint.Get("turns").Bool()});
    if (!joint.Has("mass_kg")) continue;
    const std::vector<double> centre = joint.Get("centre_of_mass_m").Numbers(3);
    links.push_back({ReadMagnitude(joint, "mass_kg"), {centre[0], centre[1], centre[2]}});
  }
  if (robot.nominal.joints.empty()) nominal.Get("joints").Fail("the arm has no joints");
  if (!links.empty()) {
    if (links.size() != robot.nominal.joints.size()) nominal.Get("joints").Fail("some joints have no mass_kg");
    robot.nominal = WithLinks(std::move(robot.nominal), std::move(links));
  }
  robot.errors = Eigen::VectorXd::Zero(robot.nominal.num_params());
  robot.error_sigmas.resize(static_cast<size_t>(robot.nominal.num_params()));
  std::set<std::string> are_read;
  for (const JsonReader& parameter : reader.Get("parameters").List()) {
    const std::string name = parameter.Get("name").Text();
    const std::optional<int> place = FindPlace(robot.nominal, name);
    if (!place) parameter.Fail("the arm has no parameter '" + name + "'");
    if (!are_read.insert(name).second) parameter.Fail("the parameter '" + name + "' is there twice");
    robot.errors[*place] = parameter.Get("value").Number() - parameter.Get("nominal").Number();
    robot.error_sigmas[static_cast<size_t>(*place)] = ReadOptionalMagnitude(parameter, "std");
  }
  if (reader.Has("rigid")) robot.rigid = ReadRigidJson(reader.Get("rigid"), robot.nominal);
  if (robot.is_estimated && are_read.empty()) reader.Get("parameters").Fail("an arm that was estimated has some");
  for (const JsonReader& entry : reader.Get("undetermined").List()) {
    robot.undetermined.emplace_back(entry.Get("name").Text(), entry.Get("with").Text());
  }
  robot.noise_before = ReadNoise(reader.Get("sigma"), "before_");
  robot.noise_after = ReadNoise(reader.Get("sigma"), "after_");
  return robot;
}

Json ArmEffectsJson(const ArmEffects& effects) {
  if (effects.shared == nullptr) return nullptr;
  const SharedEffects& shared = *effects.shared;
  Json groups = Json::array();
  for (size_t i = 0; i < shared.groups.size(); ++i) {
    const EffectGroup& group = shared.groups[i];
    const double sigma = i < effects.sigmas.size() ? effects.sigmas[i] : group.sigma;
    groups.push_back(Json{{"name", group.name}, {"unit", group.unit}, {"sigma", Finite(sigma)}});
  }
  Json list = Json::array();
  for (Eigen::Index i = 0; i < shared.size(); ++i) {
    const SharedEffect& effect = shared.effects[static_cast<size_t>(i)];
    list.push_back(Json{{"name", effect.name}, {"group", effect.group}, {"value", effects.values[i]}});
  }
  return Json{{"model", shared.name}, {"groups", groups}, {"effects", list}};
}

ArmEffects ReadArmEffects(const JsonReader& reader, const RobotSummary& robot, const std::vector<std::string>& names) {
  SharedEffects shared;
  ArmEffects read;
  shared.num_all = robot.nominal.num_params();
  std::map<std::string, size_t> group_of;
  std::map<std::string, double> value_of;
  if (reader.Has("estimated")) {
    const JsonReader estimated = reader.Get("estimated");
    shared.name = estimated.Get("model").Text();
    for (const JsonReader& group : estimated.Get("groups").List()) {
      const double sigma = ReadFinite(group, "sigma", std::numeric_limits<double>::infinity());
      shared.groups.push_back({group.Get("name").Text(), group.Get("unit").Text(), sigma});
      read.sigmas.push_back(sigma);
    }
    for (const JsonReader& effect : estimated.Get("effects").List()) {
      const int group = effect.Get("group").Int(0, static_cast<int>(shared.groups.size()) - 1);
      group_of[effect.Get("name").Text()] = static_cast<size_t>(group);
      value_of[effect.Get("name").Text()] = effect.Get("value").Number();
    }
  }
  read.values.resize(static_cast<Eigen::Index>(names.size()));
  for (const std::string& name : names) {
    const std::optional<int> place = FindPlace(robot.nominal, name);
    if (!place) reader.Fail("'" + name + "' is estimated, but the arm has no such parameter");
    const auto group = group_of.find(name);
    // The sum with the nominal parameter has lost digits of the error.
    const auto value = value_of.find(name);
    read.values[shared.size()] = value == value_of.end() ? robot.errors[*place] : value->second;
    constexpr double kRounding = 1e-9;
    if (std::abs(read.values[shared.size()] - robot.errors[*place]) > kRounding) {
      reader.Fail("the error of '" + name + "' in 'estimated' is not its value less the nominal one in 'parameters'");
    }
    shared.effects.push_back({name, *place, group == group_of.end() ? 0 : group->second});
  }
  read.shared = std::make_shared<const SharedEffects>(std::move(shared));
  return read;
}

ArmEffects ReadArmEffects(const JsonReader& reader, const RobotSummary& robot) {
  std::vector<std::string> names;
  for (const JsonReader& effect : reader.Get("estimated").Get("effects").List()) {
    names.push_back(effect.Get("name").Text());
  }
  return ReadArmEffects(reader, robot, names);
}

}  // namespace heba
