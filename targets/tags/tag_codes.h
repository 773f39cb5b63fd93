// libapriltag's families and its detector, with the codes of one target.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

extern "C" {
#include <apriltag/apriltag.h>
}

#include "targets/tags/tag_layout.h"

namespace heba {

// A family of libapriltag by its name.
struct TagFamilyName {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t* family);
};
// All families that a target may name.
extern const std::array<TagFamilyName, 9> kTagFamilies;

// Owns one of libapriltag's families.
class TagFamily {
 public:
  explicit TagFamily(const TagFamilyName& name) : name_(&name), family_(name.create()) {}
  ~TagFamily() {
    if (family_ != nullptr) name_->destroy(family_);
  }
  TagFamily(TagFamily&& other) noexcept : name_(other.name_), family_(std::exchange(other.family_, nullptr)) {}
  TagFamily(const TagFamily&) = delete;
  TagFamily& operator=(const TagFamily&) = delete;
  TagFamily& operator=(TagFamily&&) = delete;

  const apriltag_family_t& operator*() const { return *family_; }
  const apriltag_family_t* operator->() const { return family_; }
  // Returns the number of cells outside the reported quad, on each side, that belong to the tag (and not to the
  // paper).
  int NumOuterCells() const {
    return family_->reversed_border ? (family_->total_width - family_->width_at_border) / 2 : 0;
  }

 private:
  const TagFamilyName* name_;
  apriltag_family_t* family_;
};

// A grid of tags as its config describes it.
struct TagGridGeometry {
  std::string family;
  int rows = 0;
  int columns = 0;
  double tag_size_m = 0;
  int border_bits = 1;
  double tag_spacing_ratio = 0;  // Ratio of the gap between tags to tag_size_m.
  int first_id = 0;
  bool corner_squares = true;

  // Returns the id of a corner of the tag with an index from 0.
  int PointId(int index, size_t corner) const { return 4 * (first_id + index) + static_cast<int>(corner); }
};

// Returns the number of bit errors that may be corrected. It is far smaller than the code distance allows, since
// every quad in an image may be misread: 0 for 16h5, 1 for 25h9, 2 (libapriltag's maximum) for 36h11.
inline int MaxBitErrors(const apriltag_family_t& family) {
  return std::clamp((static_cast<int>(family.h) - 5) / 3, 0, 2);
}

// The tags that are decoded in an image, and the large regions that were searched for them (see TagPlaces).
struct DetectedTags {
  std::vector<SeenTag> tags;
  std::vector<cv::Rect> searched;
};

// The tags of a family that are on the target, with the target's border width. Ids become indices from 0.
class TagCodes {
 public:
  TagCodes(TagFamily family, const TagGridGeometry& geometry, int max_bit_errors);
  ~TagCodes();
  TagCodes(const TagCodes&) = delete;
  TagCodes& operator=(const TagCodes&) = delete;

  // Returns the side of the quad that libapriltag reports, in cells.
  int width() const { return family_.width_at_border; }
  uint32_t num_bits() const { return family_.nbits; }
  int NumOuterCells() const { return source_.NumOuterCells(); }
  // Returns a data bit's cell; (0, 0) is the quad's top-left one.
  int BitX(uint32_t bit) const { return static_cast<int>(bit_x_[bit]); }
  int BitY(uint32_t bit) const { return static_cast<int>(bit_y_[bit]); }
  bool IsWhite(int index, uint32_t bit) const {
    return ((family_.codes[index] >> (family_.nbits - 1 - bit)) & 1u) != 0;
  }
  // Returns whether a cell is printed black; cells that are neither data nor border are paper.
  bool IsBlack(int index, int x, int y) const;

  // Returns all tags of the target that libapriltag decodes, with corners in this program's pixels. A tag may occur
  // twice. Regions in `searched` are left out (see FindTagPlaces).
  DetectedTags Detect(const cv::Mat& grey, double decimate, const std::vector<cv::Rect>& searched = {}) const;

  // Returns the tags of each of several families: each quad is found once and read in all of them.
  static std::vector<std::vector<SeenTag>> DetectAll(const std::vector<const TagCodes*>& families, const cv::Mat& grey,
                                                     double decimate);

 private:
  struct TagsOfFamilies {
    std::vector<std::vector<SeenTag>> tags;
    std::vector<cv::Rect> searched;
  };
  // Likewise for families of which all have reversed borders, or none; there must be one.
  static TagsOfFamilies DetectAlike(const std::vector<const TagCodes*>& families, const cv::Mat& grey, double decimate,
                                    const std::vector<cv::Rect>& searched);

  TagFamily source_;
  apriltag_family_t family_;
  std::vector<uint32_t> bit_x_;
  std::vector<uint32_t> bit_y_;
  apriltag_detector_t* table_owner_;
};

}  // namespace heba
