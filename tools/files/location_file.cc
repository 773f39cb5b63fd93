#include "tools/files/location_file.h"

#include <cmath>
#include <utility>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/setup.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"
#include "tools/text/failure_text.h"
#include "tools/text/location_text.h"

namespace heba {
namespace {

Json VectorJson(const Eigen::Vector3d& vector) { return {Finite(vector.x()), Finite(vector.y()), Finite(vector.z())}; }

Json MatrixPoseJson(const Rigid3d& pose, const std::string& parent, const std::string& child) {
  Json json = PoseJson(pose, parent, child);
  const Eigen::Matrix4d matrix = pose.Matrix();
  json["matrix"] = Json::array();
  for (Eigen::Index i = 0; i < 4; ++i) {
    json["matrix"].push_back({matrix(i, 0), matrix(i, 1), matrix(i, 2), matrix(i, 3)});
  }
  return json;
}

Json SigmaMm(const Eigen::Matrix3d& covariance_m2) { return VectorJson(1000 * covariance_m2.diagonal().cwiseSqrt()); }

Json SigmasJson(const PositionCovariance& covariance) {
  return Json{{"total_mm", SigmaMm(covariance.TotalM2())},
              {"calibration_mm", SigmaMm(covariance.by_calibration_m2)},
              {"image_mm", SigmaMm(covariance.by_image_m2)},
              {"robot_mm", SigmaMm(covariance.by_robot_m2)}};
}

// Returns the sigmas of a target along and about the axes of the world.
Json SigmasJson(const PoseSigmasBySource& sigmas) {
  Json json;
  const std::pair<std::string, const PoseSigmas*> parts[] = {{"total", &sigmas.total},
                                                             {"calibration", &sigmas.by_calibration},
                                                             {"image", &sigmas.by_image},
                                                             {"robot", &sigmas.by_robot}};
  for (const auto& [name, part] : parts) json[name + "_mm"] = VectorJson(1000 * part->translation_m);
  for (const auto& [name, part] : parts) json[name + "_deg"] = VectorJson(RadToDeg(1) * part->rotation_rad);
  return json;
}

// Returns the sigmas of a target along and about its own axes.
Json SigmasJson(const PoseCovariance& covariance) {
  const auto of_source = [](const Eigen::Matrix<double, 6, 6>& part) {
    const Eigen::Matrix<double, 6, 1> sigmas = part.diagonal().cwiseSqrt();
    return Json{{"mm", VectorJson(1000 * sigmas.head<3>())}, {"deg", VectorJson(RadToDeg(1) * sigmas.tail<3>())}};
  };
  return Json{{"total", of_source(covariance.Total())},
              {"calibration", of_source(covariance.by_calibration)},
              {"image", of_source(covariance.by_image)},
              {"robot", of_source(covariance.by_robot)}};
}

const char* UnitOf(bool is_turning) { return is_turning ? "deg" : "m"; }
double InUnit(double joint, bool is_turning) { return is_turning ? RadToDeg(joint) : joint; }

Json PosturesJson(const ReachingPostures& found) {
  Json joints = Json::array();
  const std::vector<ArmJoint>& of_arm = found.arm.arm.joints;
  for (size_t i = 0; i < of_arm.size(); ++i) {
    joints.push_back(Json{{"name", found.arm.joint_names[i]}, {"unit", UnitOf(of_arm[i].is_turning)}});
  }
  Json postures = Json::array();
  for (const ReachingPostures::Posture& posture : found.postures) {
    Json values = Json::array();
    for (size_t i = 0; i < of_arm.size(); ++i) {
      values.push_back(InUnit(posture.joints[static_cast<Eigen::Index>(i)], of_arm[i].is_turning));
    }
    postures.push_back(Json{{"joints", values}, {"singularity", posture.singularity}});
  }
  return Json{{"arm", found.arm.name}, {"reason", found.reason}, {"joints", joints}, {"postures", postures}};
}

// Returns the postures of the arm of a single camera, or those of each arm by its name.
Json PosturesJson(const Problem& rig, const std::vector<ReachingPostures>& all) {
  if (IsSingleCamera(rig)) return all.empty() ? Json(nullptr) : PosturesJson(all.front());
  Json json = Json::object();
  for (const ReachingPostures& postures : all) json[rig.robots[postures.robot]] = PosturesJson(postures);
  return json;
}

Json CommandJson(const RobotSummary& robot, const TargetReach& reach, const ReachCommand& command) {
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
  json["base_from_gripper"] = MatrixPoseJson(command.base_from_gripper, "base", "gripper");
  json["joints"] = joints;
  json["from_target_mm"] = 1000 * DistanceM(command.base_from_gripper, reach.wanted);
  json["from_target_deg"] = RadToDeg(AngleRad(command.base_from_gripper, reach.wanted));
  json["extrapolated"] = command.is_extrapolated;
  json["sigma"] = SigmasJson(command.covariance);
  return json;
}

// Returns the commands of an arm, and why there is none; all are empty if `reach` is null.
Json ReachJson(const RunResult& result, const TargetReach* reach) {
  Json json{{"command", nullptr}, {"commands", nullptr}, {"command_reason", ""}};
  if (reach == nullptr) return json;
  const RobotSummary& robot = *FindEstimatedArm(result, reach->robot);
  if (reach->command) json["command"] = CommandJson(robot, *reach, *reach->command);
  if (reach->has_each) {
    json["commands"] = Json::array();
    for (const ReachCommand& command : reach->in_each) json["commands"].push_back(CommandJson(robot, *reach, command));
  }
  json["command_reason"] = reach->command ? reach->command->reason : reach->reason;
  return json;
}

Json ArmPoseJson(const LocationRequest& request, size_t robot) {
  const RunResult& result = *request.result;
  const StatedPose& stated = request.arms[robot].stated;
  const RobotSummary* const arm = FindEstimatedArm(result, robot);
  const Rigid3d corrected = Correct(result.rig, result.solution, robot, stated).base_from_mount;
  return Json{{"stated", MatrixPoseJson(stated.base_from_mount, "base", "gripper")},
              {"corrected", stated.effect != nullptr ? MatrixPoseJson(corrected, "base", "gripper") : Json(nullptr)},
              {"arm", arm == nullptr ? Json(nullptr) : Json(arm->nominal.name)},
              {"reason", request.arms[robot].why_not_corrected}};
}

// Returns a pose of the target that fits, named `key`, with its sigmas in the world named `sigma_key`.
Json PossibleJson(const LocationRequest& request, const TargetLocation& location, size_t i, const std::string& key,
                  const std::string& sigma_key) {
  const RunResult& result = *request.result;
  const PossiblePose& possible = location.possible[i];
  const std::string& name = result.rig.targets[location.target].name;
  return Json{
      {key, MatrixPoseJson(possible.located.world_from_target, WorldName(result.rig), name.empty() ? "target" : name)},
      {"near_deg", location.near ? Json(RadToDeg(location.near->angles_rad[i])) : Json(nullptr)},
      {"near_mm", location.near ? Json(1000 * location.near->distances_m[i]) : Json(nullptr)},
      {sigma_key, SigmasJson(SigmasOf(result.solution, possible.located))},
      {"postures", PosturesJson(result.rig, possible.postures)}};
}

// Returns the position of a pixel in the world, named `key`, with its sigmas and the postures that reach it.
Json PositionJson(const Problem& rig, const PixelPosition& position, const std::string& key) {
  return Json{{"pixel", {position.pixel.pixel.x(), position.pixel.pixel.y()}},
              {key, VectorJson(position.point.in_world)},
              {"sigma", SigmasJson(position.point.covariance)},
              {"postures", PosturesJson(rig, position.postures)}};
}

// Returns the gripper with the tool at the grasp; null if none was asked for, or if no pose is chosen.
Json GraspJson(const LocationRequest& request, const TargetLocation& location) {
  if (!request.has_grasp || !location.chosen) return nullptr;
  const LocatedTarget& located = location.possible[*location.chosen].located;
  return Json{{"pose", MatrixPoseJson(located.world_from_target * request.TargetFromGripper(),
                                      WorldName(request.result->rig), "gripper")},
              {"grasp_sigma_mm", SigmaMm(CovarianceOfPoint(located, request.target_from_grasp.translation))}};
}

Json ImageJson(const LocationRequest& request, const ImageLocation& location) {
  const TargetLocation target = location.targets.empty() ? TargetLocation() : location.targets.front();
  Json json{{"image", location.image},
            {"located", location.IsLocated()},
            {"reason", Join(LocationFaults(request, location), "; ")},
            {"points", target.num_points},
            {"target_points", request.targets.front()->points().size()},
            {"rms_px", target.possible.empty() ? Json(nullptr) : Json(target.possible.front().located.rms_px)},
            {"poses", Json::array()},
            {"chosen", target.chosen ? Json(*target.chosen) : Json(nullptr)}};
  json.update(ReachJson(*request.result, target.reaches.empty() ? nullptr : &target.reaches.front()));
  json["gripper"] = GraspJson(request, target);
  json["pixels"] = Json::array();
  for (size_t i = 0; i < target.possible.size(); ++i) {
    json["poses"].push_back(PossibleJson(request, target, i, "base_from_target", "sigma"));
  }
  for (const PixelPosition& position : location.pixels) {
    json["pixels"].push_back(PositionJson(request.result->rig, position, "in_base_m"));
  }
  return json;
}

Json TargetJson(const LocationRequest& request, const TargetLocation& location) {
  const Problem& rig = request.result->rig;
  const ProblemTarget& target = rig.targets[location.target];
  const bool is_seen = !location.possible.empty();
  Json json{{"target", target.name},
            {"cameras", Json::array()},
            {"located", location.chosen.has_value()},
            {"reason", TargetFault(request, location)},
            {"points", location.num_points},
            {"target_points", request.targets[location.target]->points().size()},
            {"pose", nullptr},
            {"rms_px", is_seen ? Json(location.possible.front().located.rms_px) : Json(nullptr)},
            {"chance", is_seen ? Json(location.possible.front().located.p_value) : Json(nullptr)},
            {"symmetries", target.symmetries.size()},
            {"sigma", nullptr},
            {"poses", Json::array()},
            {"chosen", location.chosen ? Json(*location.chosen) : Json(nullptr)},
            {"gripper", GraspJson(request, location)},
            {"reach", Json::object()}};
  for (const size_t camera : location.cameras) json["cameras"].push_back(rig.cameras[camera].name);
  for (size_t i = 0; i < location.possible.size(); ++i) {
    json["poses"].push_back(PossibleJson(request, location, i, "pose", "sigma_in_world"));
    json["poses"].back()["sigma"] = SigmasJson(location.possible[i].located.pose_covariance);
  }
  if (location.chosen) {
    for (const char* const key : {"pose", "sigma"}) json[key] = json["poses"][*location.chosen][key];
  }
  for (const TargetReach& reach : location.reaches) {
    json["reach"][rig.robots[reach.robot]] = ReachJson(*request.result, &reach);
  }
  return json;
}

// Returns the members of the document of several cameras.
Json LongJson(const LocationRequest& request, const ImageLocation& location) {
  const Problem& rig = request.result->rig;
  Json json{{"reason", FailureText(location.fault)}, {"robots", Json::object()}};
  for (size_t r = 0; r < request.arms.size(); ++r) {
    if (request.arms[r].carries_camera) json["robots"][rig.robots[r]] = ArmPoseJson(request, r);
  }
  if (request.pixels.empty()) {
    json["targets"] = Json::array();
    for (const TargetLocation& target : location.targets) json["targets"].push_back(TargetJson(request, target));
  } else if (request.plane) {
    json["points"] = Json::array();
    for (const PixelPosition& position : location.pixels) {
      Json& point = json["points"].emplace_back(Json{{"camera", rig.cameras[position.pixel.camera].name}});
      point.update(PositionJson(rig, position, "in_world_m"));
    }
  } else {
    const std::optional<LocatedPoint>& point = location.point;
    json["point"] = point ? Json{{"in_world_m", VectorJson(point->in_world)},
                                 {"rms_px", point->rms_px},
                                 {"warning", PointWarning(*point)},
                                 {"sigma", SigmasJson(point->covariance)}}
                          : Json(nullptr);
  }
  return json;
}

}  // namespace

std::string LocationsToJson(const LocationRequest& request, const std::vector<ImageLocation>& locations) {
  const Problem& rig = request.result->rig;
  const bool is_single = IsSingleCamera(rig);
  Json json{{"schema", is_single ? "heba/locations/1" : "heba/rig_locations/1"},
            {"heba", Version()},
            {"name", request.result->name}};
  if (is_single) {
    const bool is_carried = rig.cameras.front().mount.part == Mount::Part::kGripper;
    json["setup"] = SetupName(is_carried ? Setup::kEyeInHand : Setup::kEyeToHand);
    json["camera_mount"] = is_carried ? ArmPoseJson(request, 0) : Json(nullptr);
  }
  // A confidence region is one of Fisher's F with so many degrees of freedom in the denominator; null if the noise was
  // given.
  json["covariance_dof"] = Finite(request.result->solution.covariance_dof);
  if (!is_single) {
    json.update(LongJson(request, locations.front()));
    return FileText(json);
  }
  json["images"] = Json::array();
  for (const ImageLocation& location : locations) json["images"].push_back(ImageJson(request, location));
  return FileText(json);
}

std::string PointWarning(const LocatedPoint& point) {
  // Pixels that a user reads from an image may be as far from the point that they show.
  constexpr double kApartPx = 3;
  return point.rms_px > kApartPx ? "the rays of the pixels do not meet: do they show one point?" : "";
}

}  // namespace heba
