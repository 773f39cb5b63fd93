#include "tools/pipeline/run_inputs.h"

#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/io/result_file.h"
#include "tools/files/program_digest.h"
#include "tools/run/captures.h"
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

// Returns the text for a data set and the other files of its config.
std::string InputsText(const std::string& config_used, const Dataset& data, const std::vector<fs::path>& data_files,
                       const std::optional<fs::path>& truth) {
  nlohmann::ordered_json json;
  json["schema"] = "heba/inputs/1";
  json["heba"] = Version();
  json["program"] = DigestOfProgram();
  json["config"] = DigestOf(config_used);
  nlohmann::ordered_json& files = json["files"];
  for (const fs::path& file : data_files) files["data"].push_back(DigestOrNothing(file));
  for (size_t c = 0; c < data.has_camera.size(); ++c) {
    if (data.has_camera[c]) files["camera"].push_back(DigestOrNothing(data.camera_sources[c]));
  }
  if (truth) files["truth"] = DigestOrNothing(*truth);
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

}  // namespace

std::string RunInputsText(const PairConfig& config) {
  Dataset data = AsDataset(config.data);
  for (const LeftOut& entry : config.data.left_out) data.left_out.push_back({entry.name, entry.reason, "", {}});
  std::vector<fs::path> files = config.data_files;
  if (!config.poses_file.empty()) files.push_back(config.poses_file);
  return InputsText(config.used, data, files, config.truth);
}

std::string RunInputsText(const RunConfig& config) {
  return InputsText(config.used, config.data, config.data_files, config.truth);
}

}  // namespace heba
