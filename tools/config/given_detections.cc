#include "tools/config/given_detections.h"

#include <algorithm>
#include <map>
#include <set>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "tools/files/detection_file.h"

namespace heba {

namespace fs = std::filesystem;

namespace {

// Returns the detection in an image; null if the file does not list it.
const CaptureDetection* Find(const GivenDetections& of_pair, const std::string& image) {
  const auto found = std::find_if(of_pair.images.begin(), of_pair.images.end(),
                                  [&](const auto& entry) { return entry.first == image; });
  return found == of_pair.images.end() ? nullptr : &found->second;
}

// Throws InputError unless every image has a name, and is listed once.
void CheckNames(const GivenDetections& of_pair) {
  std::set<std::string> names;
  for (const auto& entry : of_pair.images) {
    const std::string& name = entry.first;
    if (name.empty()) throw InputError(of_pair.file.string() + ": an image has no name");
    if (!names.insert(name).second) throw InputError(of_pair.file.string() + ": lists the image " + name + " twice");
  }
}

}  // namespace

void CheckGivenDetection(const Target& target, const Detection& detection, const std::string& where) {
  std::set<int> known;
  for (const TargetPoint& point : target.points()) known.insert(point.id);
  std::set<int> seen;
  for (const int id : detection.ids) {
    if (known.count(id) == 0) throw InputError(where + "the target has no point " + std::to_string(id));
    if (!seen.insert(id).second) throw InputError(where + "point " + std::to_string(id) + " is listed twice");
  }
  for (const Eigen::Vector2d& pixel : detection.pixels) {
    constexpr double kFarthestPx = 1e6;
    if (!(pixel.cwiseAbs().maxCoeff() <= kFarthestPx)) {
      throw InputError(where + "a point lies outside any possible image");
    }
  }
}

std::vector<GivenDetections> ReadGivenDetections(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw InputError(folder.string() +
                     ": is no folder; several cameras need one, with CAMERA.TARGET.json for each pair");
  }
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<GivenDetections> given;
  for (const fs::path& file : files) {
    const std::vector<std::string> names = Split(file.stem().string(), '.');
    if (names.size() != 2) continue;
    given.push_back({names[0], names[1], file, ReadDetections(file)});
    CheckNames(given.back());
  }
  if (given.empty()) throw InputError(folder.string() + ": has no file CAMERA.TARGET.json");
  return given;
}

std::vector<fs::path> ImagesOf(const std::string& camera, const std::vector<GivenDetections>& given) {
  std::vector<fs::path> images;
  for (const GivenDetections& of_pair : given) {
    if (of_pair.camera != camera) continue;
    std::vector<fs::path> of_target;
    for (const auto& entry : of_pair.images) of_target.emplace_back(entry.first);
    if (images.empty()) images = of_target;
    if (images == of_target) continue;
    images.insert(images.end(), of_target.begin(), of_target.end());
    std::sort(images.begin(), images.end());
    images.erase(std::unique(images.begin(), images.end()), images.end());
  }
  return images;
}

std::vector<TargetDetection> DetectionsOfCaptures(const Dataset& data, const std::vector<GivenDetections>& given) {
  std::vector<std::string> targets;
  for (const ProblemTarget& target : data.rig.targets) targets.push_back(target.name);
  std::map<std::pair<std::string, std::string>, const GivenDetections*> of_pairs;
  for (const GivenDetections& of_pair : given) {
    if (std::find(targets.begin(), targets.end(), of_pair.target) == targets.end()) {
      throw InputError(of_pair.file.string() + ": target " + UnknownName(of_pair.target, targets));
    }
    of_pairs[{of_pair.camera, of_pair.target}] = &of_pair;
  }
  std::vector<TargetDetection> detections;
  for (size_t i = 0; i < data.captures.size(); ++i) {
    for (size_t c = 0; c < data.rig.cameras.size(); ++c) {
      const std::string image = data.captures[i].images[c].string();
      if (image.empty()) continue;
      for (size_t t = 0; t < targets.size(); ++t) {
        TargetDetection& detection = detections.emplace_back(TargetDetection{i, c, t, {}});
        const auto of_pair = of_pairs.find({data.rig.cameras[c].name, targets[t]});
        const CaptureDetection* const found = of_pair == of_pairs.end() ? nullptr : Find(*of_pair->second, image);
        if (found == nullptr) continue;
        CheckGivenDetection(*data.targets[t], found->detection, of_pair->second->file.string() + ": " + image + ": ");
        detection.detection = *found;
      }
    }
  }
  // An image has one size, in whichever file it is listed.
  for (TargetDetection& detection : detections) {
    if (detection.detection.width_px > 0) continue;
    const auto sized = std::find_if(detections.begin(), detections.end(), [&](const TargetDetection& other) {
      return other.camera == detection.camera && other.detection.width_px > 0;
    });
    if (sized == detections.end()) continue;
    detection.detection.width_px = sized->detection.width_px;
    detection.detection.height_px = sized->detection.height_px;
  }
  return detections;
}

}  // namespace heba
