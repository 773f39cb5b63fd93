#include "tools/pages/cell_figure.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "tools/pages/page.h"
#include "tools/pages/page_numbers.h"

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
  return ViewFigure("set-up", "", data);
}

}  // namespace heba
