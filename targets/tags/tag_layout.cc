#include "targets/tags/tag_layout.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "heba/base/median.h"
#include "heba/base/union_find.h"
#include "heba/geometry/homography.h"

namespace heba {
namespace {

// Returns by how much the corners of two tags are off one plane: the largest residual of the homography fitted to all
// eight, as a share of the smaller tag's side. A fisheye lens bends a target by some hundredths of a side between
// neighbours, whereas a wrongly decoded tag is off by a whole side. Infinite if there is no homography.
double Misfit(const SeenTag& a, const SeenTag& b, const TagLayout& layout) {
  std::vector<Eigen::Vector2d> board_m;
  std::vector<Eigen::Vector2d> image_px;
  for (const SeenTag* tag : {&a, &b}) {
    const TagCorners& corners_m = layout.corners_m[static_cast<size_t>(tag->index)];
    board_m.insert(board_m.end(), corners_m.begin(), corners_m.end());
    image_px.insert(image_px.end(), tag->corners_px.begin(), tag->corners_px.end());
  }
  const std::optional<Eigen::Matrix3d> image_from_board = FitHomography(board_m, image_px);
  if (!image_from_board) return std::numeric_limits<double>::infinity();
  double largest_px = 0;
  for (size_t i = 0; i < board_m.size(); ++i) {
    const double residual_px = (ApplyHomography(*image_from_board, board_m[i]) - image_px[i]).norm();
    if (!std::isfinite(residual_px)) return std::numeric_limits<double>::infinity();
    largest_px = std::max(largest_px, residual_px);
  }
  return largest_px / std::min(MeanSide(a.corners_px), MeanSide(b.corners_px));
}

// Neighbours include the next but one, since a tag between them may be hidden: two steps along each axis.
bool AreNeighbours(const SeenTag& a, const SeenTag& b, const TagLayout& layout) {
  constexpr double kReach = 2.9;
  return (layout.Centre(a.index) - layout.Centre(b.index)).norm() <= kReach * layout.pitch_m;
}

}  // namespace

Eigen::Vector2d TagLayout::Centre(int index) const { return CentreOf(corners_m[static_cast<size_t>(index)]); }

double MinSide(const TagCorners& corners) {
  double side = (corners[0] - corners[3]).norm();
  for (size_t i = 0; i + 1 < 4; ++i) side = std::min(side, (corners[i + 1] - corners[i]).norm());
  return side;
}

double MeanSide(const TagCorners& corners) {
  double sum = 0;
  for (size_t i = 0; i < 4; ++i) sum += (corners[(i + 1) % 4] - corners[i]).norm();
  return sum / 4;
}

double MedianSideInCells(const std::vector<SeenTag>& tags, const Eigen::Matrix3d& pixel_from_cell) {
  const Eigen::Matrix3d cell_from_pixel = pixel_from_cell.inverse();
  std::vector<double> sides;
  for (const SeenTag& tag : tags) {
    TagCorners corners;
    for (size_t k = 0; k < 4; ++k) corners[k] = ApplyHomography(cell_from_pixel, tag.corners_px[k]);
    sides.push_back(MeanSide(corners));
  }
  return Median(sides);
}

Eigen::Vector2d CentreOf(const TagCorners& corners) { return (corners[0] + corners[1] + corners[2] + corners[3]) / 4; }

ConsistentTags KeepConsistent(const std::vector<SeenTag>& seen, const TagLayout& layout, int num_bit_errors_alone) {
  constexpr double kMaxMisfit = 0.12;
  constexpr double kMaxMisfitFarther = 0.3;
  UnionFind<size_t> groups(seen.size());  // Tags that agree with one another.
  for (size_t i = 0; i < seen.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (seen[i].index == seen[j].index) continue;
      if (!AreNeighbours(seen[i], seen[j], layout)) continue;
      if (groups.Root(i) == groups.Root(j)) continue;
      if (Misfit(seen[i], seen[j], layout) <= kMaxMisfit) groups.Unite(i, j);
    }
  }
  std::vector<size_t> group_size(seen.size(), 0);
  for (size_t i = 0; i < seen.size(); ++i) ++group_size[groups.Root(i)];
  // The largest groups come first; among single tags, those with the fewest bit errors.
  std::vector<size_t> order(seen.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t i, size_t j) {
    const size_t group_i = groups.Root(i);
    const size_t group_j = groups.Root(j);
    if (group_size[group_i] != group_size[group_j]) return group_size[group_i] > group_size[group_j];
    if (group_i != group_j && seen[group_i].num_bit_errors != seen[group_j].num_bit_errors) {
      return seen[group_i].num_bit_errors < seen[group_j].num_bit_errors;
    }
    return group_i != group_j ? group_i < group_j : i < j;
  });
  ConsistentTags kept;
  size_t end = 0;
  for (size_t begin = 0; begin < order.size(); begin = end) {
    const size_t group = groups.Root(order[begin]);
    while (end < order.size() && groups.Root(order[end]) == group) ++end;
    // A group separated from the largest one (a hand may divide a target) belongs to the same target if it fits
    // loosely: over larger distances the lens bends more.
    bool belongs =
        kept.tags.empty() ? end - begin > 1 || seen[order[begin]].num_bit_errors <= num_bit_errors_alone : false;
    std::vector<SeenTag> additional;
    for (size_t k = begin; k < end; ++k) {
      const SeenTag& tag = seen[order[k]];
      const bool repeated = std::any_of(kept.tags.begin(), kept.tags.end(),
                                        [&](const SeenTag& other) { return other.index == tag.index; }) ||
                            std::any_of(additional.begin(), additional.end(),
                                        [&](const SeenTag& other) { return other.index == tag.index; });
      if (!repeated) additional.push_back(tag);
    }
    if (!kept.tags.empty()) {
      for (const SeenTag& tag : additional) {
        const auto nearest =
            std::min_element(kept.tags.begin(), kept.tags.end(), [&](const SeenTag& a, const SeenTag& b) {
              return (layout.Centre(a.index) - layout.Centre(tag.index)).norm() <
                     (layout.Centre(b.index) - layout.Centre(tag.index)).norm();
            });
        if (Misfit(tag, *nearest, layout) <= kMaxMisfitFarther) belongs = true;
      }
    }
    if (!belongs) additional.clear();
    kept.num_dropped += static_cast<int>(end - begin - additional.size());
    kept.tags.insert(kept.tags.end(), additional.begin(), additional.end());
  }
  std::sort(kept.tags.begin(), kept.tags.end(), [](const SeenTag& a, const SeenTag& b) { return a.index < b.index; });
  return kept;
}

std::vector<bool> ContradictNeighbours(const std::vector<SeenTag>& tags, const TagLayout& layout) {
  constexpr size_t kNumJudges = 4;
  std::vector<double> misfits;  // The median over the nearest neighbours of each tag, the lower one of two.
  std::vector<std::vector<size_t>> judges_of;
  for (const SeenTag& tag : tags) {
    std::vector<std::pair<double, size_t>> near;  // The distance, and the place.
    for (size_t k = 0; k < tags.size(); ++k) {
      if (tags[k].index == tag.index || !AreNeighbours(tag, tags[k], layout)) continue;
      near.emplace_back((layout.Centre(tag.index) - layout.Centre(tags[k].index)).norm(), k);
    }
    std::sort(near.begin(), near.end());
    if (near.size() > kNumJudges) near.resize(kNumJudges);
    std::vector<size_t>& judges = judges_of.emplace_back();
    std::vector<double> of_tag;
    for (const auto& [distance_m, k] : near) {
      judges.push_back(k);
      of_tag.push_back(Misfit(tag, tags[k], layout));
    }
    std::sort(of_tag.begin(), of_tag.end());
    misfits.push_back(of_tag.size() < 2 ? 0 : of_tag[(of_tag.size() - 1) / 2]);
  }
  constexpr double kMostPx = 0.3;
  constexpr double kTimesUsual = 3;
  std::vector<bool> contradict;
  for (size_t i = 0; i < tags.size(); ++i) {
    // A lens bends the target most near the border of the image: its neighbours there show what is usual.
    std::vector<double> usual;
    for (const size_t k : judges_of[i]) usual.push_back(misfits[k]);
    const double limit = usual.empty() ? 0 : kTimesUsual * std::max(Median(usual), Median(misfits));
    contradict.push_back((misfits[i] - limit) * MeanSide(tags[i].corners_px) > kMostPx);
  }
  return contradict;
}

std::optional<Eigen::Matrix3d> LocalHomography(const std::vector<SeenTag>& tags, const TagLayout& layout,
                                               const Eigen::Vector2d& at_m, size_t num_nearest) {
  if (tags.empty()) return std::nullopt;
  std::vector<const SeenTag*> nearest;
  for (const SeenTag& tag : tags) nearest.push_back(&tag);
  const size_t num_used = std::min(num_nearest, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(num_used), nearest.end(),
                    [&](const SeenTag* a, const SeenTag* b) {
                      return (layout.Centre(a->index) - at_m).squaredNorm() <
                             (layout.Centre(b->index) - at_m).squaredNorm();
                    });
  std::vector<Eigen::Vector2d> board_m;
  std::vector<Eigen::Vector2d> image_px;
  for (size_t i = 0; i < num_used; ++i) {
    const TagCorners& corners_m = layout.corners_m[static_cast<size_t>(nearest[i]->index)];
    board_m.insert(board_m.end(), corners_m.begin(), corners_m.end());
    image_px.insert(image_px.end(), nearest[i]->corners_px.begin(), nearest[i]->corners_px.end());
  }
  return FitHomography(board_m, image_px);
}

}  // namespace heba
