#include "tools/files/location_file.h"

#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/units.h"
#include "heba/io/result_file.h"
#include "tools/text/location_text.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

Json VectorJson(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

Json PoseJson(const Rigid3d& pose, const char* parent, const char* child) {
  // q and -q are the same rotation; w is kept non-negative, as in result.json.
  const double sign = pose.rotation.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector4d xyzw = sign * pose.rotation.coeffs();
  const Eigen::Matrix4d matrix = pose.Matrix();
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < 4; ++i) rows.push_back({matrix(i, 0), matrix(i, 1), matrix(i, 2), matrix(i, 3)});
  return Json{{"parent", parent},
              {"child", child},
              {"translation_m", VectorJson(pose.translation)},
              {"quaternion_xyzw", {xyzw[0], xyzw[1], xyzw[2], xyzw[3]}},
              {"matrix", rows}};
}

Json SigmaMm(const Eigen::Matrix3d& covariance_m2) { return VectorJson(1000 * covariance_m2.diagonal().cwiseSqrt()); }

Json SigmasJson(const PositionCovariance& covariance) {
  return Json{{"total_mm", SigmaMm(covariance.TotalM2())},
              {"calibration_mm", SigmaMm(covariance.by_calibration_m2)},
              {"image_mm", SigmaMm(covariance.by_image_m2)},
              {"robot_mm", SigmaMm(covariance.by_robot_m2)}};
}

Json SigmasJson(const PoseSigmasBySource& sigmas) {
  Json json;
  const std::pair<const char*, const PoseSigmas*> parts[] = {{"total", &sigmas.total},
                                                             {"calibration", &sigmas.by_calibration},
                                                             {"image", &sigmas.by_image},
                                                             {"robot", &sigmas.by_robot}};
  for (const auto& [name, part] : parts) json[std::string(name) + "_mm"] = VectorJson(1000 * part->translation_m);
  for (const auto& [name, part] : parts) {
    json[std::string(name) + "_deg"] = VectorJson(RadToDeg(1) * part->rotation_rad);
  }
  return json;
}

const char* UnitOf(bool is_turning) { return is_turning ? "deg" : "m"; }
double InUnit(double joint, bool is_turning) { return is_turning ? RadToDeg(joint) : joint; }

Json PosturesJson(const std::optional<ReachingPostures>& found) {
  if (!found) return nullptr;
  Json joints = Json::array();
  for (size_t i = 0; i < found->joint_names.size(); ++i) {
    joints.push_back(Json{{"name", found->joint_names[i]}, {"unit", UnitOf(found->are_turning[i])}});
  }
  Json postures = Json::array();
  for (const ReachingPostures::Posture& posture : found->postures) {
    Json values = Json::array();
    for (size_t i = 0; i < posture.joints.size(); ++i) {
      values.push_back(InUnit(posture.joints[i], found->are_turning[i]));
    }
    postures.push_back(Json{{"joints", values}, {"singularity", posture.singularity}});
  }
  return Json{{"arm", found->arm}, {"reason", found->reason}, {"joints", joints}, {"postures", postures}};
}

Json CommandJson(const RobotSummary& robot, const Reach& reach, const ReachCommand& command) {
  Json json{{"configuration", command.configuration}, {"reason", command.reason}};
  if (!command.reason.empty()) {
    for (const char* const key :
         {"base_from_gripper", "joints", "from_target_mm", "from_target_deg", "extrapolated", "sigma"}) {
      json[key] = nullptr;
    }
    return json;
  }
  Json joints = Json::array();
  for (Eigen::Index i = 0; i < command.joints.size(); ++i) {
    const bool is_turning = robot.nominal.joints[static_cast<size_t>(i)].is_turning;
    joints.push_back(Json{{"name", "j" + std::to_string(i + 1)},
                          {"value", InUnit(command.joints[i], is_turning)},
                          {"unit", UnitOf(is_turning)}});
  }
  json["base_from_gripper"] = PoseJson(command.base_from_gripper, "base", "gripper");
  json["joints"] = joints;
  json["from_target_mm"] = 1000 * DistanceM(command.base_from_gripper, reach.wanted);
  json["from_target_deg"] = RadToDeg(AngleRad(command.base_from_gripper, reach.wanted));
  json["extrapolated"] = command.is_extrapolated;
  json["sigma"] = SigmasJson(command.covariance);
  return json;
}

Json CameraMountJson(const LocationRequest& request) {
  if (request.result->setup == Setup::kEyeToHand) return nullptr;
  const StatedPose& stated = request.camera_mount;
  const bool is_corrected = request.robot != nullptr && stated.effect != nullptr;
  const Rigid3d corrected = Correct(*FindRefined(*request.result)->solution, stated).base_from_mount;
  return Json{{"stated", PoseJson(stated.base_from_mount, "base", "gripper")},
              {"corrected", is_corrected ? PoseJson(corrected, "base", "gripper") : Json(nullptr)},
              {"arm", request.robot == nullptr ? Json(nullptr) : Json(request.robot->nominal.name)},
              {"reason", request.why_not_corrected}};
}

// Returns why there is no pose to command; empty if there is one, or if the run has not estimated the errors of an arm.
std::string WhyNoCommand(const LocationRequest& request, const ImageLocation& location) {
  if (request.robot == nullptr || !location.chosen) return "";
  if (!location.reach) return kNoCommandReason;
  return location.reach->command ? location.reach->command->reason : location.reach->reason_of_each;
}

Json ImageJson(const LocationRequest& request, const ImageLocation& location) {
  Json json{{"image", location.image},
            {"located", location.IsLocated()},
            {"reason", LocationFault(location)},
            {"points", location.num_points},
            {"target_points", location.num_target_points},
            {"rms_px", location.possible.empty() ? Json(nullptr) : Json(location.possible.front().located.rms_px)},
            {"poses", Json::array()},
            {"chosen", location.chosen ? Json(*location.chosen) : Json(nullptr)},
            {"command", nullptr},
            {"commands", nullptr},
            {"command_reason", WhyNoCommand(request, location)},
            {"pixels", Json::array()}};
  const Solution& solution = *FindRefined(*request.result)->solution;
  for (size_t i = 0; i < location.possible.size(); ++i) {
    const PossiblePose& possible = location.possible[i];
    json["poses"].push_back(
        Json{{"base_from_target", PoseJson(possible.located.world_from_target, "base", "target")},
             {"near_deg", location.near ? Json(RadToDeg(location.near->angles_rad[i])) : Json(nullptr)},
             {"near_mm", location.near ? Json(1000 * location.near->distances_m[i]) : Json(nullptr)},
             {"sigma", SigmasJson(SigmasOf(solution, possible.located))},
             {"postures", PosturesJson(possible.postures)}});
  }
  if (location.reach) {
    const Reach& reach = *location.reach;
    if (reach.command) json["command"] = CommandJson(*request.robot, reach, *reach.command);
    if (reach.has_each) {
      json["commands"] = Json::array();
      for (const ReachCommand& command : reach.in_each) {
        json["commands"].push_back(CommandJson(*request.robot, reach, command));
      }
    }
  }
  for (const PixelPosition& position : location.pixels) {
    json["pixels"].push_back(Json{{"pixel", {position.pixel.x(), position.pixel.y()}},
                                  {"in_base_m", VectorJson(position.point.in_world)},
                                  {"sigma", SigmasJson(position.point.covariance)},
                                  {"postures", PosturesJson(position.postures)}});
  }
  return json;
}

}  // namespace

std::string LocationsToJson(const LocationRequest& request, const std::vector<ImageLocation>& locations) {
  // A confidence region is one of Fisher's F with so many degrees of freedom in the denominator; null if the noise was
  // given.
  const double dof = FindRefined(*request.result)->solution->covariance_dof;
  Json json;
  json["schema"] = "heba/locations/1";
  json["heba"] = Version();
  json["name"] = request.result->name;
  json["setup"] = SetupName(request.result->setup);
  json["camera_mount"] = CameraMountJson(request);
  json["covariance_dof"] = std::isfinite(dof) ? Json(dof) : Json(nullptr);
  json["images"] = Json::array();
  for (const ImageLocation& location : locations) json["images"].push_back(ImageJson(request, location));
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace heba
