// What a detector finds in a folder of pictures that one camera took of one target.
#pragma once

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "targets/images/image.h"
#include "targets/target.h"

namespace heba {

struct RecordedBoards {
  size_t num_points = 0;
  std::set<std::string> not_found;   // File names of pictures without any point.
  std::set<std::string> incomplete;  // With some, but not all.
  // Of cv::calibrateCamera over all pictures: shows wrong corners and poor ones.
  double rms_px = 0;
};

// In every `step`-th picture, by name, and in those called `always`.
inline RecordedBoards DetectRecorded(const Target& target, const std::filesystem::path& folder, size_t step = 1,
                                     const std::set<std::string>& always = {}) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  RecordedBoards result;
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> pictures;
  cv::Size size;
  for (size_t i = 0; i < files.size(); ++i) {
    const std::string name = files[i].filename().string();
    if (i % step != 0 && always.count(name) == 0) continue;
    const cv::Mat grey = ReadGreyImage(files[i]);
    size = grey.size();
    const Detection detection = target.Detect(grey);
    result.num_points += detection.ids.size();
    if (detection.ids.size() < target.points().size()) {
      (detection.ids.empty() ? result.not_found : result.incomplete).insert(name);
    }
    if (detection.ids.empty()) continue;
    board.emplace_back();
    pictures.emplace_back();
    for (size_t k = 0; k < detection.ids.size(); ++k) {
      const Eigen::Vector3d& place_m = target.points()[static_cast<size_t>(detection.ids[k])].in_target;
      board.back().emplace_back(static_cast<float>(place_m.x()), static_cast<float>(place_m.y()), 0.0F);
      pictures.back().emplace_back(static_cast<float>(detection.pixels[k].x()),
                                   static_cast<float>(detection.pixels[k].y()));
    }
  }
  cv::Mat matrix;
  cv::Mat distortion;
  result.rms_px = cv::calibrateCamera(board, pictures, size, matrix, distortion, cv::noArray(), cv::noArray());
  return result;
}

}  // namespace heba
