#include "tools/text/run_notes.h"

#include <algorithm>
#include <map>
#include <set>

#include "heba/base/text.h"
#include "solvers/initial/usable_views.h"

namespace heba {

std::vector<std::string> DetectionNotes(const Dataset& data, const std::vector<TargetDetection>& detections) {
  std::vector<std::string> notes;
  for (size_t c = 0; c < data.rig.cameras.size(); ++c) {
    for (size_t t = 0; t < data.targets.size(); ++t) {
      int num_seen = 0;
      int num_images = 0;
      for (const TargetDetection& detection : detections) {
        if (detection.camera != c || detection.target != t) continue;
        ++num_images;
        num_seen += static_cast<int>(detection.detection.detection.ids.size()) >= kMinPosePoints ? 1 : 0;
      }
      notes.push_back(data.name + ": camera " + data.rig.cameras[c].name + " sees target " + data.rig.targets[t].name +
                      " in " + std::to_string(num_seen) + " of " + std::to_string(num_images) + " images");
    }
  }
  return notes;
}

std::vector<std::string> LeftOutNotes(const std::vector<ImageResult>& images) {
  // The images of one camera, in the order of the captures, that were left out for the same reasons.
  struct Group {
    const ImageResult* first = nullptr;
    const ImageResult* last = nullptr;
    std::map<std::string, std::set<std::string>> targets_of;  // By the reason; an empty one is that of used targets.
    int num_images = 0;
  };
  std::vector<Group> groups;
  for (const ImageResult& image : images) {
    const bool is_used = std::all_of(image.targets.begin(), image.targets.end(),
                                     [](const TargetInImage& target) { return target.reason.empty(); });
    if (is_used) continue;
    std::map<std::string, std::set<std::string>> targets_of;
    for (const TargetInImage& target : image.targets) targets_of[target.reason].insert(target.target);
    const auto known = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
      return group.first->camera == image.camera &&
             std::equal(group.targets_of.begin(), group.targets_of.end(), targets_of.begin(), targets_of.end(),
                        [](const auto& a, const auto& b) { return a.first == b.first; });
    });
    Group& group = known == groups.end() ? groups.emplace_back(Group{&image, &image, {}, 0}) : *known;
    group.last = &image;
    ++group.num_images;
    for (const auto& [reason, targets] : targets_of) group.targets_of[reason].insert(targets.begin(), targets.end());
  }
  std::vector<std::string> notes;
  for (const Group& group : groups) {
    std::vector<std::string> texts;
    for (const auto& [reason, targets] : group.targets_of) {
      if (reason.empty()) continue;
      const std::vector<std::string> names(targets.begin(), targets.end());
      texts.push_back((names.size() == 1 ? "target " : "targets ") + Join(names, ", ") + ": " + reason);
    }
    const std::string& camera = group.first->camera;
    const std::string which = group.num_images == 1
                                  ? group.first->capture + ", camera " + camera
                                  : "camera " + camera + ": " + std::to_string(group.num_images) + " images, from " +
                                        group.first->capture + " to " + group.last->capture;
    notes.push_back(which + ": " + Join(texts, "; "));
  }
  return notes;
}

}  // namespace heba
