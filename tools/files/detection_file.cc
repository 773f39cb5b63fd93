#include "tools/files/detection_file.h"

#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/json_reader.h"

namespace heba {
namespace {

constexpr const char* kDetectionSchema = "heba/detections/1";

}  // namespace

std::string DetectionsToJson(const NamedDetections& detections) {
  using Json = nlohmann::ordered_json;
  Json json;
  json["schema"] = kDetectionSchema;
  json["captures"] = Json::array();
  for (const auto& [image, seen] : detections) {
    Json pixels = Json::array();
    for (const Eigen::Vector2d& pixel : seen.detection.pixels) pixels.push_back({pixel.x(), pixel.y()});
    json["captures"].push_back(Json{{"image", image},
                                    {"image_size", {seen.width_px, seen.height_px}},
                                    {"ids", seen.detection.ids},
                                    {"pixels", pixels},
                                    {"reason", seen.detection.reason}});
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void WriteDetections(const Dataset& data, const std::vector<TargetDetection>& detections,
                     const std::filesystem::path& folder) {
  const bool has_names = !data.rig.cameras[0].name.empty();
  if (has_names) std::filesystem::create_directory(folder / "detections");
  for (size_t c = 0; c < data.rig.cameras.size(); ++c) {
    for (size_t t = 0; t < data.targets.size(); ++t) {
      NamedDetections of_pair;
      for (const TargetDetection& detection : detections) {
        if (detection.camera != c || detection.target != t) continue;
        const Recording& recording = data.captures[detection.capture];
        of_pair.emplace_back(has_names ? recording.images[c].filename().string() : recording.name, detection.detection);
      }
      const std::string pair = data.rig.cameras[c].name + "." + data.rig.targets[t].name + ".json";
      WriteFileAtomically(folder / (has_names ? "detections/" + pair : "detections.json"), DetectionsToJson(of_pair));
    }
  }
}

NamedDetections ReadDetections(const std::filesystem::path& path) {
  constexpr size_t kMaxBytes = size_t{128} << 20;
  const nlohmann::ordered_json json = ReadJsonFile(path, kMaxBytes);
  const JsonReader root(json, path.string());
  const std::string schema = root.Has("schema") ? root.Get("schema").Text() : kDetectionSchema;
  if (schema != kDetectionSchema) root.Fail("has the schema " + Quoted(schema) + ", not '" + kDetectionSchema + "'");
  std::vector<std::pair<std::string, CaptureDetection>> captures;
  for (const JsonReader& entry : root.Get("captures").List()) {
    CaptureDetection capture;
    constexpr int kMaxSize = 100000;
    constexpr int kMaxId = 1000000000;
    const std::vector<JsonReader> size = entry.Get("image_size").List();
    if (size.size() != 2) entry.Get("image_size").Fail("two whole numbers are needed: [width, height]");
    capture.width_px = size[0].Int(0, kMaxSize);
    capture.height_px = size[1].Int(0, kMaxSize);
    for (const JsonReader& id : entry.Get("ids").List()) capture.detection.ids.push_back(id.Int(0, kMaxId));
    for (const JsonReader& pixel : entry.Get("pixels").List()) {
      const std::vector<double> uv = pixel.Numbers(2);
      // The fit of a tag at the edge may place a corner slightly outside.
      constexpr double kRoomPx = 5;
      const bool is_inside = uv[0] >= -kRoomPx && uv[1] >= -kRoomPx && uv[0] <= capture.width_px + kRoomPx &&
                             uv[1] <= capture.height_px + kRoomPx;
      if (capture.width_px > 0 && !is_inside) pixel.Fail("lies outside of the image");
      capture.detection.pixels.emplace_back(uv[0], uv[1]);
    }
    if (capture.detection.ids.size() != capture.detection.pixels.size()) {
      entry.Fail(std::to_string(capture.detection.ids.size()) + " ids, but " +
                 std::to_string(capture.detection.pixels.size()) + " pixels");
    }
    if (entry.Has("reason")) capture.detection.reason = entry.Get("reason").Text();
    captures.emplace_back(entry.Get("image").Text(), std::move(capture));
  }
  return captures;
}

}  // namespace heba
