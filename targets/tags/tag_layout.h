// Common parts of flat targets with tags or markers: the position of each tag, and whether the tags decoded in an
// image are consistent with these positions.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace heba {

// The corners of a tag, in the same order on the target and in the image.
using TagCorners = std::array<Eigen::Vector2d, 4>;

struct SeenTag {
  int index = 0;  // Index in TagLayout::corners_m.
  TagCorners corners_px;
  int num_bit_errors = 0;
};

struct TagLayout {
  std::vector<TagCorners> corners_m;
  double pitch_m = 0;  // Distance between the centres of neighbouring tags.

  Eigen::Vector2d Centre(int index) const;
};

double MinSide(const TagCorners& corners);
double MeanSide(const TagCorners& corners);
Eigen::Vector2d CentreOf(const TagCorners& corners);

// Returns the median side of tags in cells of a grid.
double MedianSideInCells(const std::vector<SeenTag>& tags, const Eigen::Matrix3d& pixel_from_cell);

struct ConsistentTags {
  std::vector<SeenTag> tags;  // Sorted by index, each once.
  int num_dropped = 0;
};
// Keeps the tags that can belong to one target: each agrees with tags near it up to the distortion of a lens between
// neighbours. If several tags with the same index remain (two such targets are visible), the one in the larger group
// is kept. A tag without any neighbour is kept only if it has at most `num_bit_errors_alone` bit errors.
ConsistentTags KeepConsistent(const std::vector<SeenTag>& seen, const TagLayout& layout, int num_bit_errors_alone);

// Returns which tags contradict those around them: most of their neighbours lie on one plane with them far less well
// than the neighbours themselves, and than the tags of this image as a rule: more than three times as badly, by at
// least 0.3 px. A tag with fewer than two neighbours contradicts none.
std::vector<bool> ContradictNeighbours(const std::vector<SeenTag>& tags, const TagLayout& layout);

// Fits image_from_board near `at_m` to the `num_nearest` of `tags` that are nearest to it on the target. Returns
// nothing if there are no tags or their corners are degenerate.
std::optional<Eigen::Matrix3d> LocalHomography(const std::vector<SeenTag>& tags, const TagLayout& layout,
                                               const Eigen::Vector2d& at_m, size_t num_nearest);

}  // namespace heba
