#include "tools/pipeline/run_inputs.h"

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/io/result_file.h"
#include "tools/files/program_digest.h"
#include "tools/run/digest.h"

namespace heba {
namespace {

std::string DigestOrNothing(const std::filesystem::path& file) {
  try {
    return DigestOfFile(file);
  } catch (const InputError&) {
    return "";
  }
}

// Returns the beginning of the inputs of any run.
nlohmann::ordered_json InputsOf(const std::string& config_used) {
  nlohmann::ordered_json json;
  json["schema"] = "heba/inputs/1";
  json["heba"] = Version();
  json["program"] = DigestOfProgram();
  json["config"] = DigestOf(config_used);
  return json;
}

}  // namespace

std::string RunInputsText(const RunConfig& config) {
  nlohmann::ordered_json json = InputsOf(config.used);
  nlohmann::ordered_json files;
  if (!config.poses_file.empty()) files["poses"] = DigestOrNothing(config.poses_file);
  for (const std::filesystem::path& file : config.data_files) files["data"].push_back(DigestOrNothing(file));
  if (config.data.camera) files["camera"] = DigestOrNothing(config.data.camera_source);
  if (config.truth) files["truth"] = DigestOrNothing(*config.truth);
  json["files"] = files;
  json["images"] = nlohmann::ordered_json::array();
  for (const Capture& capture : config.data.captures) {
    json["images"].push_back({capture.name, DigestOrNothing(capture.image)});
  }
  json["left_out"] = nlohmann::ordered_json::array();
  for (const LeftOut& entry : config.data.left_out) json["left_out"].push_back(entry.name);
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string RunInputsText(const RigConfig& config) {
  nlohmann::ordered_json json = InputsOf(config.used);
  nlohmann::ordered_json files;
  for (const std::filesystem::path& file : config.data_files) files["data"].push_back(DigestOrNothing(file));
  for (size_t c = 0; c < config.data.has_camera.size(); ++c) {
    if (config.data.has_camera[c]) files["camera"].push_back(DigestOrNothing(config.data.camera_sources[c]));
  }
  if (config.truth) files["truth"] = DigestOrNothing(*config.truth);
  json["files"] = files;
  json["images"] = nlohmann::ordered_json::array();
  for (const RigRecording& capture : config.data.captures) {
    nlohmann::ordered_json entry = {capture.name};
    for (const std::filesystem::path& image : capture.images) {
      entry.push_back(image.empty() ? "" : DigestOrNothing(image));
    }
    json["images"].push_back(entry);
  }
  json["left_out"] = nlohmann::ordered_json::array();
  for (const RigLeftOut& entry : config.data.left_out) json["left_out"].push_back(entry.name);
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const RunConfig& config) {
  const std::filesystem::path inputs = output / "inputs.json";
  std::error_code error;
  if (!std::filesystem::exists(inputs, error) || !std::filesystem::exists(output / "result.json", error)) return {};
  try {
    if (ReadTextFile(inputs) != RunInputsText(config)) return std::nullopt;
    return ReadResult(output / "result.json");
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace heba
