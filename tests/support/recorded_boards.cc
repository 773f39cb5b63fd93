#include "tests/support/recorded_boards.h"

#include <algorithm>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "targets/images/image.h"

namespace heba {

RecordedBoards DetectRecorded(const Target& target, const std::filesystem::path& folder, size_t step,
                              const std::set<std::string>& always) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  RecordedBoards result;
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> images;
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
    images.emplace_back();
    for (size_t k = 0; k < detection.ids.size(); ++k) {
      const Eigen::Vector3d& place_m = target.points()[static_cast<size_t>(detection.ids[k])].in_target;
      board.back().emplace_back(static_cast<float>(place_m.x()), static_cast<float>(place_m.y()), 0.0F);
      images.back().emplace_back(static_cast<float>(detection.pixels[k].x()),
                                 static_cast<float>(detection.pixels[k].y()));
    }
  }
  cv::Mat matrix;
  cv::Mat distortion;
  result.rms_px = cv::calibrateCamera(board, images, size, matrix, distortion, cv::noArray(), cv::noArray());
  return result;
}

}  // namespace heba
