#include "tools/files/detection_summary.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/io/result_file.h"

namespace heba {
namespace {
using Json = nlohmann::ordered_json;

std::string FitText(const CameraDetections& camera) {
  switch (camera.fit) {
    case CameraDetections::Fit::kGivenCamera:
      return "the given camera";
    case CameraDetections::Fit::kEstimatedCamera:
      return "a " + camera.camera_model + " camera estimated from them";
    case CameraDetections::Fit::kHomography:
      break;
  }
  return "a homography, because these images do not determine a camera";
}

const char* FitName(CameraDetections::Fit fit) {
  switch (fit) {
    case CameraDetections::Fit::kGivenCamera:
      return "given_camera";
    case CameraDetections::Fit::kEstimatedCamera:
      return "estimated_camera";
    case CameraDetections::Fit::kHomography:
      break;
  }
  return "homography";
}

Json ResidualsJson(const CameraDetections& camera) {
  return {{"relative_to", FitName(camera.fit)},
          {"camera_model", camera.camera_model.empty() ? Json(nullptr) : Json(camera.camera_model)}};
}

Json NameOrNull(const std::string& name) { return name.empty() ? Json(nullptr) : Json(name); }

// Returns a line for each image, which names the target if there are several.
std::string ImageLines(const DetectionSummary& summary, const CameraDetections& camera) {
  std::string text;
  for (const ImageDetections& image : camera.images) {
    for (size_t t = 0; t < summary.targets.size(); ++t) {
      text += image.image + ": " + DetectionLine(summary.targets[t], image.targets[t]) + "\n";
    }
  }
  return text;
}

}  // namespace

bool ImageDetections::IsSeen() const {
  return std::any_of(targets.begin(), targets.end(), [](const auto& target) { return target.num_points > 0; });
}

int CameraDetections::NumSeen() const {
  return static_cast<int>(
      std::count_if(images.begin(), images.end(), [](const ImageDetections& image) { return image.IsSeen(); }));
}

int DetectionSummary::NumSeen() const {
  int num_seen = 0;
  for (const CameraDetections& camera : cameras) num_seen += camera.NumSeen();
  return num_seen;
}

std::string DetectionLine(const SearchedTarget& target, const TargetDetections& detections) {
  return (target.name.empty() ? "" : target.name + " ") + std::to_string(detections.num_points) + " of " +
         std::to_string(target.num_points) + " points" +
         (detections.rms_px ? ", " + Significant(*detections.rms_px, 3) + " px rms" : "") +
         (detections.reason.empty() ? "" : " (" + detections.reason + ")");
}

std::string DetectionText(const DetectionSummary& summary) {
  std::string text;
  for (const CameraDetections& camera : summary.cameras) {
    text += (camera.camera.empty() ? "the target" : "camera " + camera.camera + ": a target") + " was detected in " +
            std::to_string(camera.NumSeen()) + " of " + std::to_string(camera.images.size()) +
            " images; residuals are relative to " + FitText(camera) + ", drawn magnified by up to 100\n" +
            ImageLines(summary, camera);
  }
  return text;
}

std::string DetectionSummaryToJson(const DetectionSummary& summary) {
  size_t num_images = 0;
  size_t num_points = 0;
  Json cameras = Json::array();
  Json images = Json::array();
  for (const CameraDetections& camera : summary.cameras) {
    num_images += camera.images.size();
    cameras.push_back({{"camera", NameOrNull(camera.camera)},
                       {"images", camera.images.size()},
                       {"seen", camera.NumSeen()},
                       {"residuals", ResidualsJson(camera)}});
    for (const ImageDetections& image : camera.images) {
      for (size_t t = 0; t < summary.targets.size(); ++t) {
        const TargetDetections& target = image.targets[t];
        num_points += target.num_points;
        images.push_back({{"image", image.image},
                          {"camera", NameOrNull(camera.camera)},
                          {"target", NameOrNull(summary.targets[t].name)},
                          {"detected", target.num_points > 0},
                          {"points", target.num_points},
                          {"target_points", summary.targets[t].num_points},
                          {"rms_px", target.rms_px ? Json(*target.rms_px) : Json(nullptr)},
                          {"reason", target.reason}});
      }
    }
  }
  const bool is_rig = !summary.cameras.front().camera.empty();
  Json json;
  json["schema"] = "heba/detection_summary/1";
  json["heba"] = Version();
  json["name"] = summary.name;
  json["captures"] = num_images;
  json["seen"] = summary.NumSeen();
  json["points"] = num_points;
  json["target_points"] = is_rig ? Json(nullptr) : Json(summary.targets.front().num_points);
  json["residuals"] = is_rig ? Json(nullptr) : ResidualsJson(summary.cameras.front());
  json["folder"] = summary.folder.string();
  json["cameras"] = cameras;
  json["images"] = images;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace heba
