#include "tools/cli/rig_locate.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/detection.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"
#include "tools/cli/flags.h"
#include "tools/cli/pixel_flag.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/capture_section.h"
#include "tools/config/finished_rig.h"
#include "tools/run/rig_image_location.h"
#include "tools/text/console.h"
#include "tools/text/rig_location_text.h"

namespace heba {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Splits NAME=VALUE, where the name is one of `names`, and returns its index and the value.
std::pair<size_t, std::string> NamedValue(const std::string& what, const std::string& text,
                                          const std::vector<std::string>& names, const std::string& form) {
  const size_t end = text.find('=');
  if (end == std::string::npos) throw InputError(what + ": " + Quoted(text) + ": " + form + " is needed");
  const std::string name = Trim(text.substr(0, end));
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw InputError(what + ": " + UnknownName(name, names));
  return {static_cast<size_t>(found - names.begin()), text.substr(end + 1)};
}

std::vector<std::string> CameraNames(const RigResult& result) {
  std::vector<std::string> names;
  for (const RigCamera& camera : result.rig.cameras) names.push_back(camera.name);
  return names;
}

// Returns what a flag gives for each arm, empty if nothing: the numbers of the only arm, or ARM=NUMBERS;ARM=NUMBERS.
std::vector<std::string> NumbersByArm(const std::string& flag, const std::string& value,
                                      const std::vector<std::string>& robots) {
  std::vector<std::string> numbers(robots.size());
  if (value.empty()) return numbers;
  if (robots.size() == 1 && value.find('=') == std::string::npos) return {value};
  for (const std::string& part : Split(value, ';')) {
    const auto [robot, text] = NamedValue(flag, part, robots, "ARM=NUMBERS");
    if (!numbers[robot].empty()) throw InputError(flag + ": the arm " + robots[robot] + " is named twice");
    if (Trim(text).empty()) throw InputError(flag + ": " + Quoted(part) + ": ARM=NUMBERS is needed");
    numbers[robot] = text;
  }
  return numbers;
}

// Returns the poses and joints of the arms that --pose and --joints give; the joints are those of --pose if the poses
// of the arm are joints.
std::vector<GivenArmPose> PosesOfFlags(const FinishedRig& rig) {
  const std::vector<std::string>& robots = rig.result.rig.robots;
  const std::vector<std::string> poses = NumbersByArm("--pose", FLAGS_pose, robots);
  const std::vector<std::string> joints = NumbersByArm("--joints", FLAGS_joints, robots);
  std::vector<GivenArmPose> given(robots.size());
  for (size_t r = 0; r < robots.size(); ++r) {
    const PoseReading& reading = rig.pose_readings[r];
    const RobotSummary* const arm = FindEstimatedArm(rig.result, r);
    if (!poses[r].empty()) {
      given[r].base_from_gripper = BaseFromGripper(reading, PoseOfFlag("pose", poses[r], reading.format));
    }
    if (!joints[r].empty()) {
      if (arm == nullptr) {
        throw InputError("--joints: the run has not estimated the errors of the arm " + robots[r] + "; leave them out");
      }
      given[r].joints = JointsOfFlag("joints", joints[r], arm->nominal, rig.joints_are_deg[r]);
    } else if (arm != nullptr && !poses[r].empty() && !reading.format.robot.empty()) {
      given[r].joints = JointsOfFlag("pose", poses[r], arm->nominal, reading.format.angle_unit == "deg");
    }
  }
  return given;
}

std::vector<RigArmPose> PosesFor(const FinishedRig& rig, const std::vector<size_t>& cameras) {
  return PosesForCameras(rig.result, cameras, PosesOfFlags(rig), "--pose",
                         FLAGS_joints.empty() ? "--pose" : "--joints");
}

// Returns the poses of the arms that carry cameras, as stated and as corrected by their estimated errors.
Json ArmPosesJson(const FinishedRig& rig, const std::vector<RigArmPose>& arms) {
  Json json = Json::object();
  for (size_t r = 0; r < arms.size(); ++r) {
    if (!arms[r].carries_camera) continue;
    const StatedPose& stated = arms[r].stated;
    const RobotSummary* const arm = FindEstimatedArm(rig.result, r);
    const Rigid3d corrected = Correct(rig.result.rig, rig.result.solution, r, stated).base_from_mount;
    json[rig.result.rig.robots[r]] =
        Json{{"stated", PoseJson(stated.base_from_mount, "base", "gripper")},
             {"corrected", stated.effect != nullptr ? PoseJson(corrected, "base", "gripper") : Json(nullptr)},
             {"arm", arm == nullptr ? Json(nullptr) : Json(arm->nominal.name)},
             {"reason", arms[r].why_not_corrected}};
  }
  return json;
}

Json SigmasJson(const Eigen::Matrix3d& covariance, double unit) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < 3; ++i) list.push_back(Finite(unit * std::sqrt(covariance(i, i))));
  return list;
}

// Refuses the flags that only the result of one camera takes.
void RefuseFlagsOfOneCamera() {
  const auto refuse = [](const std::string& name, bool is_given, const std::string& why) {
    if (is_given) throw InputError("--" + name + ": " + why + "; leave this flag out");
  };
  refuse("plane", FLAGS_plane != "target" && FLAGS_pixels.empty(), "the plane is that of --pixels");
  refuse("robot", !FLAGS_robot.empty(), "joints that reach a target are not computed with a rig");
}

// Returns the rough poses of the targets that --near gives: the numbers of the only target with a symmetry, or
// TARGET=NUMBERS;TARGET=NUMBERS.
std::vector<std::optional<Rigid3d>> NearOfFlag(const FinishedRig& rig) {
  const std::vector<RigTarget>& targets = rig.result.rig.targets;
  std::vector<std::optional<Rigid3d>> near(targets.size());
  if (FLAGS_near.empty()) return near;
  std::vector<std::string> names;
  std::vector<size_t> symmetric;
  for (size_t t = 0; t < targets.size(); ++t) {
    names.push_back(targets[t].name);
    if (targets[t].symmetries.size() > 1) symmetric.push_back(t);
  }
  if (symmetric.empty()) {
    throw InputError("--near: no target has a symmetry, and each has only one possible pose; leave this flag out");
  }
  const PoseFormat& format = FormatOfNear(rig.pose_readings.front().format);
  if (symmetric.size() == 1 && FLAGS_near.find('=') == std::string::npos) {
    near[symmetric.front()] = PoseOfFlag("near", FLAGS_near, format);
    return near;
  }
  for (const std::string& part : Split(FLAGS_near, ';')) {
    const auto [t, numbers] = NamedValue("--near", part, names, "TARGET=NUMBERS");
    if (targets[t].symmetries.size() == 1) {
      throw InputError("--near: target " + names[t] + " has no symmetry and only one possible pose; leave it out");
    }
    if (near[t]) throw InputError("--near: target " + names[t] + " is named twice");
    near[t] = PoseOfFlag("near", numbers, format);
  }
  return near;
}

// Prints the document or the text.
void Print(const FinishedRig& rig, const Json& located, const std::string& text) {
  if (!FLAGS_json) {
    std::cout << ForTerminal(text) << std::flush;
    return;
  }
  Json json{{"schema", "heba/rig_locations/1"}, {"heba", Version()}, {"name", rig.result.name}};
  json.update(located);
  std::cout << FileText(json) << std::flush;
}

// Whether pixels show one point together, or one each.
enum class Pixels { kOfOnePoint, kOfPoints };
// Returns the pixels of --pixels.
std::vector<CameraPixel> PixelsOfFlag(const FinishedRig& rig, Pixels which) {
  std::vector<CameraPixel> pixels;
  const std::string form = "CAMERA=U,V";
  for (const std::string& part : Split(FLAGS_pixels, ';')) {
    const auto [camera, text] = NamedValue("--pixels", part, CameraNames(rig.result), form);
    const std::string& name = rig.result.rig.cameras[camera].name;
    const CameraPixel pixel{camera, PixelOfFlag(text, form + " is needed, several separated by semicolons")};
    CheckPixelInImage(pixel.pixel, rig.result.solution.cameras[camera], name);
    const auto is_same = [&](const CameraPixel& other) { return other.camera == pixel.camera; };
    if (which == Pixels::kOfOnePoint && std::any_of(pixels.begin(), pixels.end(), is_same)) {
      throw InputError("--pixels: camera " + name + " is named twice; one pixel of each camera shows the point");
    }
    pixels.push_back(pixel);
  }
  if (which == Pixels::kOfOnePoint && pixels.size() < 2) {
    throw InputError(
        "--pixels: a point needs its pixels in at least two cameras, or the plane that it lies on (--plane)");
  }
  return pixels;
}

Json PointSigmaJson(const PositionCovariance& covariance) {
  constexpr double kMm = 1000;
  return Json{{"total_mm", SigmasJson(covariance.TotalM2(), kMm)},
              {"calibration_mm", SigmasJson(covariance.by_calibration_m2, kMm)},
              {"image_mm", SigmasJson(covariance.by_image_m2, kMm)},
              {"robot_mm", SigmasJson(covariance.by_robot_m2, kMm)}};
}

std::vector<RigArmPose> PosesForPixels(const FinishedRig& rig, const std::vector<CameraPixel>& pixels) {
  std::vector<size_t> cameras;
  for (const CameraPixel& pixel : pixels) cameras.push_back(pixel.camera);
  return PosesFor(rig, cameras);
}

// Locates each pixel where its ray meets a plane in the world.
int LocatePointsOnPlane(const FinishedRig& rig, const Plane& plane) {
  const std::vector<CameraPixel> pixels = PixelsOfFlag(rig, Pixels::kOfPoints);
  const std::vector<RigArmPose> arms = PosesForPixels(rig, pixels);
  Json points = Json::array();
  std::string text;
  for (const CameraPixel& pixel : pixels) {
    const std::string& camera = rig.result.rig.cameras[pixel.camera].name;
    const Outcome<LocatedPoint> point =
        LocatePixelInRig(rig.result.rig, rig.result.solution, pixel, plane, StatedPosesOf(arms));
    if (!point) {
      PrintError("--pixels: camera " + camera + ", " + Significant(pixel.pixel.x(), 6) + "," +
                 Significant(pixel.pixel.y(), 6) + ": " + point.reason());
      return kWorkFailed;
    }
    const Eigen::Vector3d& at = point->in_world;
    points.push_back(Json{{"camera", camera},
                          {"pixel", {pixel.pixel.x(), pixel.pixel.y()}},
                          {"in_world_m", {at.x(), at.y(), at.z()}},
                          {"sigma", PointSigmaJson(point->covariance)}});
    text += "camera " + camera + ", pixel " + Significant(pixel.pixel.x(), 6) + ", " + Significant(pixel.pixel.y(), 6) +
            ": " + RigPointText(*point) + "\n";
  }
  Print(rig, Json{{"robots", ArmPosesJson(rig, arms)}, {"points", points}}, text + ArmPosesText(rig.result, arms));
  return kDone;
}

int LocatePoint(const FinishedRig& rig) {
  const std::vector<CameraPixel> pixels = PixelsOfFlag(rig, Pixels::kOfOnePoint);
  const std::vector<RigArmPose> arms = PosesForPixels(rig, pixels);
  const Outcome<LocatedPoint> point =
      TriangulateInRig(rig.result.rig, rig.result.solution, pixels, StatedPosesOf(arms));
  if (!point) {
    PrintError("--pixels: " + point.reason());
    return kWorkFailed;
  }
  const Eigen::Vector3d& at = point->in_world;
  // Pixels that a user reads from an image may be as far from the point that they show.
  constexpr double kApartPx = 3;
  const std::string warning =
      point->rms_px > kApartPx ? "the rays of the pixels do not meet: do they show one point?" : "";
  const Json json{{"robots", ArmPosesJson(rig, arms)},
                  {"point",
                   {{"in_world_m", {at.x(), at.y(), at.z()}},
                    {"rms_px", point->rms_px},
                    {"warning", warning},
                    {"sigma", PointSigmaJson(point->covariance)}}}};
  Print(rig, json,
        RigPointText(*point) + "; the pixels are " + Significant(point->rms_px, 2) + " px from the point (RMS)\n" +
            ArmPosesText(rig.result, arms));
  if (!warning.empty()) std::cerr << "heba: warning: " << warning << std::endl;
  return kDone;
}

// Returns the detections of all targets in images CAMERA=IMAGE, and appends the cameras.
std::vector<RigSighting> SightingsIn(const FinishedRig& rig, const std::vector<std::string>& images,
                                     std::vector<size_t>* cameras) {
  const RigResult& result = rig.result;
  std::vector<RigSighting> sightings;
  for (const std::string& text : images) {
    const auto [camera, path] = NamedValue("an image", text, CameraNames(result), "CAMERA=IMAGE");
    if (std::find(cameras->begin(), cameras->end(), camera) != cameras->end()) {
      throw InputError("camera " + result.rig.cameras[camera].name + " is named twice; one image of each is located");
    }
    cameras->push_back(camera);
    const Camera& of_camera = result.solution.cameras[camera];
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      sightings.push_back(
          {camera, t,
           DetectCapture(*rig.targets[t], path, ImageSize{of_camera.width_px, of_camera.height_px}).detection});
    }
  }
  return sightings;
}

Json SigmaJson(const LocatedTarget& located) {
  const auto by_source = [](const Matrix6& covariance) {
    return Json{{"mm", SigmasJson(covariance.topLeftCorner<3, 3>(), 1000)},
                {"deg", SigmasJson(covariance.bottomRightCorner<3, 3>(), RadToDeg(1.0))}};
  };
  return Json{{"total", by_source(located.pose_covariance.Total())},
              {"calibration", by_source(located.pose_covariance.by_calibration)},
              {"image", by_source(located.pose_covariance.by_image)},
              {"robot", by_source(located.pose_covariance.by_robot)}};
}

Json TargetJson(const FinishedRig& rig, const RigTargetLocation& location, const std::string& fault) {
  const RigTarget& target = rig.result.rig.targets[location.target];
  Json json{{"target", target.name},
            {"cameras", Json::array()},
            {"located", location.chosen.has_value()},
            {"reason", fault},
            {"pose", nullptr},
            {"rms_px", nullptr},
            {"chance", nullptr},
            {"symmetries", target.symmetries.size()},
            {"sigma", nullptr},
            {"poses", Json::array()},
            {"chosen", location.chosen ? Json(*location.chosen) : Json(nullptr)}};
  for (const size_t camera : location.cameras) json["cameras"].push_back(rig.result.rig.cameras[camera].name);
  for (size_t i = 0; i < location.possible.size(); ++i) {
    const LocatedTarget& located = location.possible[i];
    json["poses"].push_back(
        Json{{"pose", PoseJson(located.world_from_target, "world", target.name)},
             {"near_deg", location.near ? Json(RadToDeg(location.near->angles_rad[i])) : Json(nullptr)},
             {"near_mm", location.near ? Json(1000 * location.near->distances_m[i]) : Json(nullptr)},
             {"sigma", SigmaJson(located)}});
  }
  if (!location.possible.empty()) {
    json["rms_px"] = location.possible.front().rms_px;
    json["chance"] = location.possible.front().p_value;
  }
  if (location.chosen) {
    json["pose"] = json["poses"][*location.chosen]["pose"];
    json["sigma"] = json["poses"][*location.chosen]["sigma"];
  }
  return json;
}

int LocateTargets(const FinishedRig& rig, const std::vector<std::string>& images) {
  const std::vector<std::optional<Rigid3d>> near = NearOfFlag(rig);
  std::vector<size_t> cameras;
  const std::vector<RigSighting> sightings = SightingsIn(rig, images, &cameras);
  const std::vector<RigArmPose> arms = PosesFor(rig, cameras);
  const std::vector<RigTargetLocation> locations =
      LocateTargetsInRig(rig.result, rig.targets, sightings, StatedPosesOf(arms), near);
  const bool is_any_located = std::any_of(locations.begin(), locations.end(), [](const RigTargetLocation& location) {
    return location.chosen.has_value();
  });
  std::string text;
  std::vector<std::string> faults;
  Json list = Json::array();
  for (const RigTargetLocation& location : locations) {
    std::string fault = RigLocationFault(rig.result.rig, location);
    if (!location.possible.empty() && !location.chosen && !location.near) {
      fault += "; --near " + Join(FormatOfNear(rig.pose_readings.front().format).columns, ",") +
               ", a rough world_from_target, decides between them";
    }
    text += RigLocationText(rig.result.rig, location);
    list.push_back(TargetJson(rig, location, fault));
    // A target of which the images show too little is no failure beside others, like one that they do not show.
    if (is_any_located && !location.undetermined.empty()) {
      text += fault + "\n";
    } else if (!fault.empty()) {
      faults.push_back(fault);
    }
  }
  if (locations.empty()) faults.emplace_back("no target was detected in these images");
  if (is_any_located) text += ArmPosesText(rig.result, arms);
  Print(rig, Json{{"robots", ArmPosesJson(rig, arms)}, {"targets", list}}, text);
  if (faults.empty()) return kDone;
  PrintError(Join(faults, "; "));
  return kWorkFailed;
}

}  // namespace

int LocateWithRig(const std::vector<std::string>& arguments) {
  const FinishedRig rig = ReadFinishedRig(arguments[0]);
  RefuseFlagsOfOneCamera();
  const std::vector<std::string> images(arguments.begin() + 1, arguments.end());
  if (!FLAGS_pixels.empty()) {
    if (!FLAGS_near.empty()) throw InputError("--near: pixels have only one possible position; leave this flag out");
    if (!images.empty()) throw InputError("--pixels: needs no image; leave " + Quoted(images.front()) + " out");
    const std::optional<Plane> plane = PlaneOfFlag();
    return plane ? LocatePointsOnPlane(rig, *plane) : LocatePoint(rig);
  }
  if (images.empty()) throw InputError("a rig needs images: CAMERA=IMAGE for each camera");
  return LocateTargets(rig, images);
}

}  // namespace heba
