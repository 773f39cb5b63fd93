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
    if (names.size() == 2) given.push_back({names[0], names[1], file, ReadDetections(file)});
  }
  if (given.empty()) throw InputError(folder.string() + ": has no file CAMERA.TARGET.json");
  return given;
}

std::vector<fs::path> ImagesOf(const std::string& camera, const std::vector<GivenDetections>& given) {
  std::vector<fs::path> images;
  for (const GivenDetections& of_pair : given) {
    if (of_pair.camera != camera) continue;
    for (const auto& [name, detection] : of_pair.images) {
      if (std::find(images.begin(), images.end(), name) == images.end()) images.emplace_back(name);
    }
  }
  return images;
}

std::vector<RigDetection> DetectionsOfCaptures(const RigDataset& data, const std::vector<GivenDetections>& given) {
  std::vector<std::string> targets;
  for (const RigTarget& target : data.rig.targets) targets.push_back(target.name);
  std::map<std::pair<std::string, std::string>, const GivenDetections*> of_pairs;
  for (const GivenDetections& of_pair : given) {
    if (std::find(targets.begin(), targets.end(), of_pair.target) == targets.end()) {
      throw InputError(of_pair.file.string() + ": target " + UnknownName(of_pair.target, targets));
    }
    of_pairs[{of_pair.camera, of_pair.target}] = &of_pair;
  }
  std::vector<RigDetection> detections;
  for (size_t i = 0; i < data.captures.size(); ++i) {
    for (size_t c = 0; c < data.rig.cameras.size(); ++c) {
      const std::string image = data.captures[i].images[c].string();
      if (image.empty()) continue;
      for (size_t t = 0; t < targets.size(); ++t) {
        const auto of_pair = of_pairs.find({data.rig.cameras[c].name, targets[t]});
        if (of_pair == of_pairs.end()) continue;
        const auto& images = of_pair->second->images;
        const auto found =
            std::find_if(images.begin(), images.end(), [&](const auto& entry) { return entry.first == image; });
        if (found == images.end()) continue;
        CheckGivenDetection(*data.targets[t], found->second.detection,
                            of_pair->second->file.string() + ": " + image + ": ");
        detections.push_back({i, c, t, found->second});
      }
    }
  }
  return detections;
}

}  // namespace heba
