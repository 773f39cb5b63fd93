#include "tools/cli/rig_locate.h"

#include <cmath>
#include <iostream>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/detection.h"
#include "heba/io/result_file.h"
#include "heba/io/result_json.h"
#include "tools/cli/flags.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/capture_section.h"
#include "tools/config/finished_rig.h"
#include "tools/run/rig_image_location.h"
#include "tools/text/console.h"
#include "tools/text/result_text.h"

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

// Returns the poses of the arms that --pose gives: the numbers of the only arm, or ARM=NUMBERS;ARM=NUMBERS.
std::vector<std::optional<Rigid3d>> PosesOfFlag(const FinishedRig& rig) {
  const std::vector<std::string>& robots = rig.result.rig.robots;
  std::vector<std::optional<Rigid3d>> poses(robots.size());
  if (FLAGS_pose.empty()) return poses;
  const auto read = [&](size_t robot, const std::string& numbers) {
    const PoseReading& reading = rig.pose_readings[robot];
    poses[robot] = BaseFromGripper(reading, PoseOfFlag("pose", numbers, reading.format));
  };
  if (robots.size() == 1 && FLAGS_pose.find('=') == std::string::npos) {
    read(0, FLAGS_pose);
    return poses;
  }
  for (const std::string& part : Split(FLAGS_pose, ';')) {
    const auto [robot, numbers] = NamedValue("--pose", part, robots, "ARM=NUMBERS");
    read(robot, numbers);
  }
  return poses;
}

std::vector<Rigid3d> PosesFor(const FinishedRig& rig, const std::vector<size_t>& cameras) {
  return PosesForCameras(rig.result.rig, cameras, PosesOfFlag(rig), "--pose");
}

std::string SigmasText(const Eigen::Matrix3d& covariance, double unit) {
  std::vector<std::string> sigmas;
  for (Eigen::Index i = 0; i < 3; ++i) sigmas.push_back(ShownAmount(unit * std::sqrt(covariance(i, i)), 2));
  return Join(sigmas, ", ");
}

Json SigmasJson(const Eigen::Matrix3d& covariance, double unit) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < 3; ++i) list.push_back(Finite(unit * std::sqrt(covariance(i, i))));
  return list;
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

int LocatePoint(const FinishedRig& rig) {
  std::vector<CameraPixel> pixels;
  std::vector<size_t> cameras;
  for (const std::string& part : Split(FLAGS_pixels, ';')) {
    const auto [camera, text] = NamedValue("--pixels", part, CameraNames(rig.result), "CAMERA=U,V");
    const std::vector<std::string> fields = Split(text, ',');
    CameraPixel& pixel = pixels.emplace_back();
    pixel.camera = camera;
    cameras.push_back(camera);
    if (fields.size() != 2 || !ParseDouble(Trim(fields[0]), &pixel.pixel.x()) ||
        !ParseDouble(Trim(fields[1]), &pixel.pixel.y())) {
      throw InputError("--pixels: " + Quoted(text) + ": two numbers are needed, U,V");
    }
  }
  const Outcome<RigPoint> point = TriangulateInRig(rig.result.rig, rig.result.solution, pixels, PosesFor(rig, cameras));
  if (!point) {
    PrintError("--pixels: " + point.reason());
    return kWorkFailed;
  }
  const Eigen::Vector3d& at = point->in_world;
  constexpr double kMm = 1000;
  const Json json{{"point",
                   {{"in_world_m", {at.x(), at.y(), at.z()}},
                    {"rms_px", point->rms_px},
                    {"sigma",
                     {{"total_mm", SigmasJson(point->TotalM2(), kMm)},
                      {"calibration_mm", SigmasJson(point->by_calibration_m2, kMm)},
                      {"image_mm", SigmasJson(point->by_image_m2, kMm)},
                      {"robot_mm", SigmasJson(point->by_robot_m2, kMm)}}}}}};
  const double sigma_mm = kMm * std::sqrt(point->TotalM2().diagonal().maxCoeff());
  const auto shown = [&](double metres) { return Fixed(kMm * metres, DecimalsFor(sigma_mm, 6)); };
  Print(rig, json,
        "point in world: [" + shown(at.x()) + ", " + shown(at.y()) + ", " + shown(at.z()) + "] mm, one sigma " +
            SigmasText(point->TotalM2(), kMm) + " mm along the world's x, y, z\n  calibration " +
            SigmasText(point->by_calibration_m2, kMm) + ", images " + SigmasText(point->by_image_m2, kMm) + ", arm " +
            SigmasText(point->by_robot_m2, kMm) + " mm; the pixels are " + Significant(point->rms_px, 2) +
            " px from the point (RMS)\n");
  constexpr double kApartPx = 3;
  if (point->rms_px > kApartPx && !FLAGS_json) {
    std::cerr << "heba: warning: the rays of the pixels do not meet: do they show one point?" << std::endl;
  }
  return kDone;
}

int LocateTargets(const FinishedRig& rig, const std::vector<std::string>& images) {
  const RigResult& result = rig.result;
  std::vector<size_t> cameras;
  std::vector<RigSighting> sightings;
  for (const std::string& text : images) {
    const auto [camera, path] = NamedValue("an image", text, CameraNames(result), "CAMERA=IMAGE");
    if (std::find(cameras.begin(), cameras.end(), camera) != cameras.end()) {
      throw InputError("camera " + result.rig.cameras[camera].name + " is named twice; one image of each is located");
    }
    cameras.push_back(camera);
    const Camera& of_camera = result.solution.cameras[camera];
    for (size_t t = 0; t < rig.targets.size(); ++t) {
      sightings.push_back(
          {camera, t,
           DetectCapture(*rig.targets[t], path, ImageSize{of_camera.width_px, of_camera.height_px}).detection});
    }
  }
  std::string text;
  Json list = Json::array();
  for (const auto& [t, seen_by, located] : LocateTargetsInRig(result, rig.targets, sightings, PosesFor(rig, cameras))) {
    const std::string& name = result.rig.targets[t].name;
    std::vector<std::string> by;
    for (const size_t camera : seen_by) by.push_back(result.rig.cameras[camera].name);
    if (!located) {
      text += "target " + name + ": " + located.reason() + "\n";
      continue;
    }
    const Matrix6 total = located->Total();
    const double sigma_m = std::sqrt(total.topLeftCorner<3, 3>().diagonal().maxCoeff());
    const double sigma_rad = std::sqrt(total.bottomRightCorner<3, 3>().diagonal().maxCoeff());
    text += "target " + name + " in world, by " + Join(by, ", ") + "\n  " +
            PoseText(located->world_from_target, 1000 * sigma_m, sigma_rad) + "\n  one sigma " +
            SigmasText(total.topLeftCorner<3, 3>(), 1000) + " mm; " +
            SigmasText(total.bottomRightCorner<3, 3>(), RadToDeg(1.0)) + " deg (target's x, y, z)\n  calibration " +
            SigmasText(located->by_calibration.topLeftCorner<3, 3>(), 1000) + ", images " +
            SigmasText(located->by_image.topLeftCorner<3, 3>(), 1000) + ", arm " +
            SigmasText(located->by_robot.topLeftCorner<3, 3>(), 1000) + " mm; the points fit with " +
            Significant(located->rms_px, 2) + " px (RMS)\n";
    const size_t num_symmetries = rig.targets[t]->Symmetries().size();
    if (num_symmetries > 1) {
      text +=
          "  the target looks the same in " + std::to_string(num_symmetries) + " orientations; this is one of them\n";
    }
    const auto by_source = [&](const Matrix6& covariance) {
      return Json{{"mm", SigmasJson(covariance.topLeftCorner<3, 3>(), 1000)},
                  {"deg", SigmasJson(covariance.bottomRightCorner<3, 3>(), RadToDeg(1.0))}};
    };
    list.push_back(Json{{"target", name},
                        {"cameras", by},
                        {"pose", PoseJson(located->world_from_target, "world", name)},
                        {"rms_px", located->rms_px},
                        {"symmetries", num_symmetries},
                        {"sigma",
                         {{"total", by_source(total)},
                          {"calibration", by_source(located->by_calibration)},
                          {"image", by_source(located->by_image)},
                          {"robot", by_source(located->by_robot)}}}});
  }
  if (list.empty()) {
    PrintError(text.empty() ? "no target was detected in these images" : Trim(text));
    return kWorkFailed;
  }
  Print(rig, Json{{"targets", list}}, text);
  return kDone;
}

}  // namespace

int LocateWithRig(const std::vector<std::string>& arguments) {
  const FinishedRig rig = ReadFinishedRig(arguments[0]);
  if (!FLAGS_pixels.empty()) return LocatePoint(rig);
  const std::vector<std::string> images(arguments.begin() + 1, arguments.end());
  if (images.empty()) throw InputError("a rig needs images: CAMERA=IMAGE for each camera");
  return LocateTargets(rig, images);
}

}  // namespace heba
