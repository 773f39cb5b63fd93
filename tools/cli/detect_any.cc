#include "tools/cli/detect_any.h"

#include <filesystem>
#include <iostream>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/even_indices.h"
#include "heba/base/text.h"
#include "heba/io/import_text.h"
#include "heba/recognition.h"
#include "targets/images/image.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/text/console.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kMostSearched = 8;

// Returns what a person calls a recognised target.
std::string TitleOf(const RecognisedTarget& recognised) {
  std::vector<std::string> parts;
  for (const auto& [key, value] : recognised.settings) {
    if (key != "type" && !value.ends_with(" m")) parts.push_back(key + " " + value);
  }
  return std::string(recognised.target->type()) + ": " + Join(parts, ", ");
}

nlohmann::ordered_json JsonOf(const std::vector<RecognisedTarget>& found, size_t num_images) {
  nlohmann::ordered_json targets = nlohmann::ordered_json::array();
  for (const RecognisedTarget& recognised : found) {
    nlohmann::ordered_json settings;
    for (const auto& [key, value] : recognised.settings) settings[key] = value;
    targets.push_back({{"type", std::string(recognised.target->type())},
                       {"images", recognised.num_images},
                       {"points", recognised.num_points},
                       {"size_key", recognised.size_key},
                       {"settings", settings},
                       {"config", RecognisedTargetText(recognised)}});
  }
  return {{"schema", "heba/recognition/1"}, {"images", num_images}, {"targets", targets}};
}

}  // namespace

int DetectAny(const std::vector<std::string>& images) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const std::string& image : images) {
    if (!fs::exists(image, error)) throw InputError(image + ": there is no such image or folder");
    if (!fs::is_directory(image, error)) {
      files.emplace_back(image);
      continue;
    }
    const std::vector<fs::path> inside = ImagesOf(image);
    if (inside.empty()) throw InputError(image + ": contains no images");
    files.insert(files.end(), inside.begin(), inside.end());
  }
  std::vector<cv::Mat> searched;
  for (const size_t i : EvenIndices(files.size(), kMostSearched)) searched.push_back(ReadGreyImage(files[i]));
  const std::vector<RecognisedTarget> found = RecogniseTargets(searched, NumThreads());
  if (FLAGS_json) {
    std::cout << JsonOf(found, searched.size()).dump(2) << std::endl;
  } else {
    std::string text;
    for (const RecognisedTarget& recognised : found) {
      text += TitleOf(recognised) + "; seen in " + std::to_string(recognised.num_images) + " of " +
              std::to_string(searched.size()) + " images\n  target: " + RecognisedTargetText(recognised) + "\n";
    }
    std::cout << ForTerminal(text) << std::flush;
  }
  if (!found.empty()) return kDone;
  PrintError(
      images.front() + ": no target is seen in " +
      (searched.size() == 1 ? std::string("the image") : "any of " + std::to_string(searched.size()) + " images"));
  return kWorkFailed;
}

}  // namespace heba
