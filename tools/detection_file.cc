#include "tools/detection_file.h"

#include <nlohmann/json.hpp>

namespace heba {

std::string DetectionsToJson(const std::vector<Capture>& captures, const std::vector<CaptureDetection>& detections) {
  using Json = nlohmann::ordered_json;
  Json json;
  json["schema"] = "heba/detections/1";
  json["captures"] = Json::array();
  for (size_t i = 0; i < captures.size(); ++i) {
    Json pixels = Json::array();
    for (const Eigen::Vector2d& pixel : detections[i].detection.pixels) pixels.push_back({pixel.x(), pixel.y()});
    json["captures"].push_back(Json{{"image", captures[i].name},
                                    {"image_size", {detections[i].width_px, detections[i].height_px}},
                                    {"ids", detections[i].detection.ids},
                                    {"pixels", pixels},
                                    {"reason", detections[i].detection.reason}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace heba
