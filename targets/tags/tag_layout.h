// What tags and markers on a flat board have in common: where each lies, and whether what was decoded in a picture
// agrees with that.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace heba {

// The corners of one tag, in the same order on the board and in the picture.
using TagCorners = std::array<Eigen::Vector2d, 4>;

struct SeenTag {
  int index = 0;  // In TagLayout.
  TagCorners corners_px;
  int num_bit_errors = 0;
};

struct TagLayout {
  std::vector<TagCorners> corners_m;
  double pitch_m = 0;  // Between the centres of neighbouring tags.

  Eigen::Vector2d Centre(int index) const;
};

double MinSide(const TagCorners& corners);
double MeanSide(const TagCorners& corners);
Eigen::Vector2d CentreOf(const TagCorners& corners);

// The tags that can be one board: each agrees with tags near it up to what a lens does between neighbours. An index
// that remains more than once (two such boards) goes to the larger group. `num_bit_errors_alone` is what a tag without
// any neighbour may have.
struct ConsistentTags {
  std::vector<SeenTag> tags;  // By increasing index, each once.
  int num_dropped = 0;
};
ConsistentTags KeepConsistent(const std::vector<SeenTag>& seen, const TagLayout& layout, int num_bit_errors_alone);

// image_from_board near `at_m`, from the `num_nearest` of `tags` that are nearest to it on the board; no value
// without tags.
std::optional<Eigen::Matrix3d> LocalHomography(const std::vector<SeenTag>& tags, const TagLayout& layout,
                                               const Eigen::Vector2d& at_m, size_t num_nearest);

}  // namespace heba
