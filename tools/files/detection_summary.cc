#include "tools/files/detection_summary.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/io/result_file.h"

namespace heba {
namespace {

std::string FitText(const DetectionSummary& summary) {
  switch (summary.fit) {
    case DetectionSummary::Fit::kGivenCamera:
      return "the given camera";
    case DetectionSummary::Fit::kEstimatedCamera:
      return "a " + summary.camera_model + " camera estimated from them";
    case DetectionSummary::Fit::kHomography:
      break;
  }
  return "a homography, because these images do not determine a camera";
}

const char* FitName(DetectionSummary::Fit fit) {
  switch (fit) {
    case DetectionSummary::Fit::kGivenCamera:
      return "given_camera";
    case DetectionSummary::Fit::kEstimatedCamera:
      return "estimated_camera";
    case DetectionSummary::Fit::kHomography:
      break;
  }
  return "homography";
}

}  // namespace

int DetectionSummary::NumSeen() const {
  return static_cast<int>(
      std::count_if(images.begin(), images.end(), [](const ImageDetections& image) { return image.num_points > 0; }));
}

std::string DetectionLine(const DetectionSummary& summary, const ImageDetections& image) {
  return image.image + ": " + std::to_string(image.num_points) + " of " + std::to_string(summary.num_target_points) +
         " points" + (image.rms_px ? ", " + Significant(*image.rms_px, 3) + " px rms" : "") +
         (image.reason.empty() ? "" : " (" + image.reason + ")");
}

std::string DetectionText(const DetectionSummary& summary) {
  std::string text = "the target was detected in " + std::to_string(summary.NumSeen()) + " of " +
                     std::to_string(summary.images.size()) + " images; residuals are relative to " + FitText(summary) +
                     ", drawn magnified by up to 100\n";
  for (const ImageDetections& image : summary.images) text += DetectionLine(summary, image) + "\n";
  return text;
}

std::string DetectionSummaryToJson(const DetectionSummary& summary) {
  using Json = nlohmann::ordered_json;
  size_t num_points = 0;
  Json images = Json::array();
  for (const ImageDetections& image : summary.images) {
    num_points += image.num_points;
    images.push_back({{"image", image.image},
                      {"detected", image.num_points > 0},
                      {"points", image.num_points},
                      {"rms_px", image.rms_px ? Json(*image.rms_px) : Json(nullptr)},
                      {"reason", image.reason}});
  }
  Json json;
  json["schema"] = "heba/detection_summary/1";
  json["heba"] = Version();
  json["name"] = summary.name;
  json["captures"] = summary.images.size();
  json["seen"] = summary.NumSeen();
  json["points"] = num_points;
  json["target_points"] = summary.num_target_points;
  json["residuals"] = {{"relative_to", FitName(summary.fit)},
                       {"camera_model", summary.camera_model.empty() ? Json(nullptr) : Json(summary.camera_model)}};
  json["folder"] = summary.folder.string();
  json["images"] = images;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace heba
