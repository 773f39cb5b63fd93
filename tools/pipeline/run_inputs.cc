#include "tools/pipeline/run_inputs.h"

#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/io/result_file.h"
#include "tools/files/program_digest.h"
#include "tools/run/digest.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::string DigestOrNothing(const fs::path& file) {
  try {
    return DigestOfFile(file);
  } catch (const InputError&) {
    return "";
  }
}

}  // namespace

std::string RunInputsText(const RunConfig& config) {
  const Dataset& data = config.data;
  nlohmann::ordered_json json;
  json["schema"] = "heba/inputs/1";
  json["heba"] = Version();
  json["program"] = DigestOfProgram();
  json["config"] = DigestOf(config.used);
  nlohmann::ordered_json& files = json["files"];
  for (const fs::path& file : config.data_files) files["data"].push_back(DigestOrNothing(file));
  for (size_t c = 0; c < data.has_camera.size(); ++c) {
    if (data.has_camera[c]) files["camera"].push_back(DigestOrNothing(data.camera_sources[c]));
  }
  if (config.truth) files["truth"] = DigestOrNothing(*config.truth);
  json["images"] = nlohmann::ordered_json::array();
  for (const Recording& capture : data.captures) {
    nlohmann::ordered_json entry = {capture.name};
    for (const fs::path& image : capture.images) {
      // Given detections have names of images only.
      entry.push_back(image.empty() || !data.given_detections.empty() ? "" : DigestOrNothing(image));
    }
    json["images"].push_back(entry);
  }
  json["left_out"] = nlohmann::ordered_json::array();
  for (const LeftOutImages& entry : data.left_out) json["left_out"].push_back(entry.name);
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace heba
