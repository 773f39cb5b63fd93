#include "targets/guided_detection.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "heba/base/error.h"

namespace heba {
namespace {

size_t IndexOf(const Target& target, int id) {
  const std::vector<TargetPoint>& points = target.points();
  const auto found = std::lower_bound(points.begin(), points.end(), id,
                                      [](const TargetPoint& point, int wanted) { return point.id < wanted; });
  CHECK(found != points.end() && found->id == id) << "detected id " << id << " is not on the target";
  return static_cast<size_t>(found - points.begin());
}

// The range [begin, end) of points that were measured together.
struct Block {
  size_t begin = 0;
  size_t end = 0;
};
std::vector<Block> BlocksOf(const Detection& detection) {
  std::vector<Block> blocks;
  size_t begin = 0;
  for (size_t k = 0; begin < detection.ids.size(); ++k) {
    const size_t size =
        k < detection.covariances_px2.size() ? static_cast<size_t>(detection.covariances_px2[k].rows()) / 2 : 1;
    blocks.push_back({begin, begin + size});
    begin += size;
  }
  return blocks;
}

Detection WithBlock(Detection detection, const Detection& from, const Block& block, size_t index,
                    const Eigen::Vector2d& shift_px) {
  for (size_t i = block.begin; i < block.end; ++i) {
    detection.ids.push_back(from.ids[i]);
    detection.pixels.emplace_back(from.pixels[i] + shift_px);
  }
  if (!from.covariances_px2.empty()) detection.covariances_px2.push_back(from.covariances_px2[index]);
  return detection;
}

}  // namespace

GuidedDetection DetectGuided(const Target& target, const cv::Mat& grey, const Detection& first,
                             const std::vector<std::optional<Eigen::Vector2d>>& expected_px, double tolerance_px) {
  CHECK_EQ(expected_px.size(), target.points().size());
  GuidedDetection result;
  result.detection.reason = first.reason;
  std::set<int> seen;
  const auto is_there = [&](const Detection& detection, const Block& block, const Eigen::Vector2d& shift_px) {
    for (size_t i = block.begin; i < block.end; ++i) {
      const std::optional<Eigen::Vector2d>& expected = expected_px[IndexOf(target, detection.ids[i])];
      if (!expected || !((detection.pixels[i] + shift_px - *expected).norm() <= tolerance_px)) return false;
    }
    return true;
  };
  const std::vector<Block> first_blocks = BlocksOf(first);
  for (size_t k = 0; k < first_blocks.size(); ++k) {
    const Block& block = first_blocks[k];
    if (!is_there(first, block, Eigen::Vector2d::Zero())) {
      result.num_dropped += static_cast<int>(block.end - block.begin);
      continue;
    }
    for (size_t i = block.begin; i < block.end; ++i) seen.insert(first.ids[i]);
    result.detection = WithBlock(std::move(result.detection), first, block, k, Eigen::Vector2d::Zero());
  }

  Eigen::Vector2d min_px = Eigen::Vector2d::Constant(1e9);
  Eigen::Vector2d max_px = Eigen::Vector2d::Constant(-1e9);
  bool is_any_missing = false;
  for (size_t i = 0; i < expected_px.size(); ++i) {
    if (!expected_px[i]) continue;
    min_px = min_px.cwiseMin(*expected_px[i]);
    max_px = max_px.cwiseMax(*expected_px[i]);
    is_any_missing = is_any_missing || seen.count(target.points()[i].id) == 0;
  }
  if (!is_any_missing) return result;
  // The margin leaves room for what is drawn around the outermost points.
  const double room_px = 30 + tolerance_px + 0.3 * (max_px - min_px).maxCoeff();
  const cv::Rect whole(0, 0, grey.cols, grey.rows);
  const cv::Rect wanted(static_cast<int>(std::floor(min_px.x() - room_px)),
                        static_cast<int>(std::floor(min_px.y() - room_px)),
                        static_cast<int>(std::ceil(max_px.x() - min_px.x() + 2 * room_px)),
                        static_cast<int>(std::ceil(max_px.y() - min_px.y() + 2 * room_px)));
  const cv::Rect part = wanted & whole;
  if (part.empty() || part == whole) return result;
  const Detection second = target.Detect(grey(part));
  const Eigen::Vector2d shift_px(part.x, part.y);
  const std::vector<Block> second_blocks = BlocksOf(second);
  for (size_t k = 0; k < second_blocks.size(); ++k) {
    const Block& block = second_blocks[k];
    const bool is_new = std::none_of(second.ids.begin() + static_cast<std::ptrdiff_t>(block.begin),
                                     second.ids.begin() + static_cast<std::ptrdiff_t>(block.end),
                                     [&](int id) { return seen.count(id) > 0; });
    if (!is_new || !is_there(second, block, shift_px)) continue;
    for (size_t i = block.begin; i < block.end; ++i) seen.insert(second.ids[i]);
    // Either all points of a detection have covariances or none has.
    if (!result.detection.ids.empty() && second.covariances_px2.empty() != result.detection.covariances_px2.empty()) {
      continue;
    }
    result.detection = WithBlock(std::move(result.detection), second, block, k, shift_px);
    result.num_added += static_cast<int>(block.end - block.begin);
  }
  return result;
}

}  // namespace heba
