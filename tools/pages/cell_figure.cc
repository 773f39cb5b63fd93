#include "tools/pages/cell_figure.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "tools/pages/page.h"
#include "tools/pages/page_numbers.h"
#include "tools/pages/static_chart.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

// Returns the rays of the image corners in the camera frame, clockwise from the upper left.
Json CornerRays(const Camera& camera) {
  Json rays = Json::array();
  for (const auto& [x, y] : {std::pair(0.0, 0.0), std::pair(1.0, 0.0), std::pair(1.0, 1.0), std::pair(0.0, 1.0)}) {
    const Eigen::Vector2d corner(x * camera.width_px - 0.5, y * camera.height_px - 0.5);
    // If the distortion cannot be inverted at the corner, the undistorted pinhole ray is used.
    const Eigen::Vector3d straight((corner.x() - camera.params[2]) / camera.params[0],
                                   (corner.y() - camera.params[3]) / camera.params[1], 1);
    const Eigen::Vector3d ray = UnprojectPixel(camera, corner).value_or(straight.normalized());
    rays.push_back({Rounded(ray.x(), 5), Rounded(ray.y(), 5), Rounded(ray.z(), 5)});
  }
  return rays;
}

Json BodyJson(const std::string& name, const Mount& mount, const Rigid3d& mount_from_body) {
  return Json{{"name", name},
              {"arm", mount.robot},
              {"is_carried", mount.part == Mount::Part::kGripper},
              {"mount_from_body", PagePose(mount_from_body)}};
}

// Returns the poses of a mount in the world: one, or one per capture.
std::vector<Rigid3d> WorldFromMounts(const ShownCell& cell, const Mount& mount) {
  const ShownArm& arm = cell.arms[mount.robot];
  if (mount.part == Mount::Part::kBase) return {arm.world_from_base};
  std::vector<Rigid3d> poses;
  for (const Rigid3d& base_from_gripper : arm.base_from_gripper) {
    poses.push_back(arm.world_from_base * base_from_gripper);
  }
  return poses;
}

// Returns a plan view in the world, x to the right and y upwards.
std::string PlanView(const ShownCell& cell) {
  struct Dots {
    std::string name;
    std::vector<Eigen::Vector3d> places;
    std::string colour;
  };
  std::vector<Dots> all;
  for (const ShownTarget& target : cell.targets) {
    const Eigen::Vector3d low = target.points_in_target.rowwise().minCoeff();
    const Eigen::Vector3d high = target.points_in_target.rowwise().maxCoeff();
    const Eigen::Vector3d middle = 0.5 * (low + high);
    Dots& dots = all.emplace_back(Dots{target.name, {}, "first"});
    for (const Rigid3d& mount : WorldFromMounts(cell, target.mount)) {
      dots.places.push_back(mount * target.mount_from_target * middle);
    }
  }
  for (const ShownCamera& camera : cell.cameras) {
    Dots& dots = all.emplace_back(Dots{camera.name, {}, "second"});
    for (const Rigid3d& mount : WorldFromMounts(cell, camera.mount)) {
      dots.places.push_back((mount * camera.mount_from_camera).translation);
    }
  }
  for (const ShownArm& arm : cell.arms) all.push_back({arm.name, {arm.world_from_base.translation}, "ink"});
  Eigen::Vector3d low = cell.arms.front().world_from_base.translation;
  Eigen::Vector3d high = low;
  for (const Dots& dots : all) {
    for (const Eigen::Vector3d& place : dots.places) {
      low = low.cwiseMin(place);
      high = high.cwiseMax(place);
    }
  }
  const Eigen::Vector3d middle = 500 * (low + high);
  const double reach = std::max(650 * (high - low).head<2>().maxCoeff(), 1.0);
  const std::string frame = cell.arms.size() > 1 ? "world" : "base";
  constexpr double kWidth = 560;
  constexpr double kLeft = 56;
  StaticChart chart(kWidth, kWidth - kLeft - kChartRight + kChartTop + kChartBottom,
                    {frame + " x, mm", middle.x() - reach, middle.x() + reach},
                    {frame + " y, mm (plan view)", middle.y() - reach, middle.y() + reach});
  for (const Dots& dots : all) {
    for (const Eigen::Vector3d& place : dots.places) chart.Dot(1000 * place.x(), 1000 * place.y(), 4, dots.colour);
    // What is carried has its label at the first capture.
    if (dots.places.empty()) continue;
    chart.Text(1000 * dots.places.front().x(), 1000 * dots.places.front().y(), "\u00a0\u00a0" + dots.name, "start");
  }
  return chart.Svg();
}

}  // namespace

std::string CellFigure(const ShownCell& cell) {
  Json data{
      {"arms", Json::array()}, {"cameras", Json::array()}, {"targets", Json::array()}, {"captures", Json::array()}};
  for (const ShownMoment& capture : cell.captures) {
    data["captures"].push_back(Json{{"name", capture.name}, {"used", capture.is_used}});
  }
  for (const ShownArm& arm : cell.arms) {
    Json grippers = Json::array();
    for (const Rigid3d& pose : arm.base_from_gripper) grippers.push_back(PagePose(pose));
    data["arms"].push_back(
        Json{{"name", arm.name}, {"world_from_base", PagePose(arm.world_from_base)}, {"grippers", grippers}});
  }
  for (const ShownCamera& camera : cell.cameras) {
    data["cameras"].push_back(BodyJson(camera.name, camera.mount, camera.mount_from_camera));
    data["cameras"].back()["corners"] = CornerRays(camera.camera);
  }
  for (const ShownTarget& target : cell.targets) {
    const Eigen::Vector3d low = target.points_in_target.rowwise().minCoeff();
    const Eigen::Vector3d high = target.points_in_target.rowwise().maxCoeff();
    data["targets"].push_back(BodyJson(target.name, target.mount, target.mount_from_target));
    data["targets"].back()["size"] = {low.x(), low.y(), high.x(), high.y()};
  }
  return ViewFigure("set-up", "", data, PlanView(cell));
}

}  // namespace heba
