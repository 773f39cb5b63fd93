#include "targets/tags/tag_codes.h"

#include <algorithm>
#include <cmath>
#include <utility>

extern "C" {
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
}

#include "heba/base/error.h"
#include "targets/tags/tag_places.h"

namespace heba {

const std::array<TagFamilyName, 9> kTagFamilies = {{
    {"tag16h5", &tag16h5_create, &tag16h5_destroy},
    {"tag25h9", &tag25h9_create, &tag25h9_destroy},
    {"tag36h10", &tag36h10_create, &tag36h10_destroy},
    {"tag36h11", &tag36h11_create, &tag36h11_destroy},
    {"tagCircle21h7", &tagCircle21h7_create, &tagCircle21h7_destroy},
    {"tagCircle49h12", &tagCircle49h12_create, &tagCircle49h12_destroy},
    {"tagCustom48h12", &tagCustom48h12_create, &tagCustom48h12_destroy},
    {"tagStandard41h12", &tagStandard41h12_create, &tagStandard41h12_destroy},
    {"tagStandard52h13", &tagStandard52h13_create, &tagStandard52h13_destroy},
}};

TagCodes::TagCodes(TagFamily family, const TagGridGeometry& geometry, int max_bit_errors)
    : source_(std::move(family)), family_(*source_) {
  // Only the target's codes are used: the lookup table of codes with errors of a large family would take gigabytes.
  family_.codes += geometry.first_id;
  family_.ncodes = static_cast<uint32_t>(geometry.rows * geometry.columns);
  const int added = geometry.border_bits - 1;
  family_.width_at_border += 2 * added;
  family_.total_width += 2 * added;
  for (uint32_t bit = 0; bit < family_.nbits; ++bit) {
    bit_x_.push_back(source_->bit_x[bit] + static_cast<uint32_t>(added));
    bit_y_.push_back(source_->bit_y[bit] + static_cast<uint32_t>(added));
  }
  family_.bit_x = bit_x_.data();
  family_.bit_y = bit_y_.data();
  family_.impl = nullptr;
  // A detector builds the lookup table when a family is added and frees it when it is destroyed. This one never
  // detects, it only owns the table.
  table_owner_ = apriltag_detector_create();
  apriltag_detector_add_family_bits(table_owner_, &family_, max_bit_errors);
}

TagCodes::~TagCodes() { apriltag_detector_destroy(table_owner_); }

bool TagCodes::IsBlack(int index, int x, int y) const {
  for (uint32_t bit = 0; bit < family_.nbits; ++bit) {
    if (BitX(bit) == x && BitY(bit) == y) return !IsWhite(index, bit);
  }
  const int ring = std::min({x, y, width() - 1 - x, width() - 1 - y});
  // The quad of a reversed border lies between a black ring outside and a white one inside.
  return family_.reversed_border ? ring == -1 : ring >= 0;
}

DetectedTags TagCodes::Detect(const cv::Mat& grey, double decimate, const std::vector<cv::Rect>& searched) const {
  TagsOfFamilies found = DetectAlike({this}, grey, decimate, searched);
  return {std::move(found.tags.front()), std::move(found.searched)};
}

std::vector<std::vector<SeenTag>> TagCodes::DetectAll(const std::vector<const TagCodes*>& families, const cv::Mat& grey,
                                                      double decimate) {
  std::vector<std::vector<SeenTag>> tags(families.size());
  for (const bool is_reversed : {false, true}) {
    std::vector<size_t> alike;
    std::vector<const TagCodes*> of_alike;
    for (size_t f = 0; f < families.size(); ++f) {
      if (families[f]->family_.reversed_border != is_reversed) continue;
      alike.push_back(f);
      of_alike.push_back(families[f]);
    }
    if (alike.empty()) continue;
    std::vector<std::vector<SeenTag>> found = DetectAlike(of_alike, grey, decimate, {}).tags;
    for (size_t k = 0; k < alike.size(); ++k) tags[alike[k]] = std::move(found[k]);
  }
  return tags;
}

TagCodes::TagsOfFamilies TagCodes::DetectAlike(const std::vector<const TagCodes*>& families, const cv::Mat& grey,
                                               double decimate, const std::vector<cv::Rect>& searched) {
  CHECK(!families.empty());
  // libapriltag's tiles of 4 px do not fit into smaller images.
  constexpr int kMinDecimatedPx = 8;
  decimate =
      std::clamp(std::floor(std::min(grey.cols, grey.rows) / static_cast<double>(kMinDecimatedPx)), 1.0, decimate);
  struct Detector {
    std::vector<apriltag_family_t> families;
    apriltag_detector_t* detector = apriltag_detector_create();
    ~Detector() {
      for (apriltag_family_t& family : families) family.impl = nullptr;  // Shared lookup tables are not freed here.
      apriltag_detector_destroy(detector);
    }
  };
  Detector owner;
  TagPlaceOptions options;
  options.decimate = static_cast<int>(decimate);
  options.min_side_px = families.front()->family_.width_at_border;
  options.is_light_in_dark = families.front()->family_.reversed_border;
  for (const TagCodes* codes : families) {
    owner.families.push_back(codes->family_);
    options.min_side_px = std::min<double>(options.min_side_px, codes->family_.width_at_border);
  }
  for (apriltag_family_t& family : owner.families) {
    apriltag_detector_add_family_bits(owner.detector, &family, 0);  // The lookup table exists already.
  }
  owner.detector->nthreads = 1;
  owner.detector->quad_decimate = static_cast<float>(decimate);
  owner.detector->refine_edges = true;
  std::vector<std::vector<SeenTag>> tags(families.size());
  TagPlaces places = FindTagPlaces(grey, options, searched);
  for (const cv::Rect& place : places.boxes) {
    const cv::Mat part = grey(place);
    image_u8_t image = {part.cols, part.rows, static_cast<int32_t>(part.step[0]), part.data};
    zarray_t* found = apriltag_detector_detect(owner.detector, &image);
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* detection = nullptr;
      zarray_get(found, i, &detection);
      SeenTag tag;
      tag.index = detection->id;
      tag.num_bit_errors = detection->hamming;
      // libapriltag's first pixel has its centre at (0.5, 0.5).
      for (size_t k = 0; k < 4; ++k) {
        tag.corners_px[k] = {place.x + detection->p[k][0] - 0.5, place.y + detection->p[k][1] - 0.5};
      }
      tags[static_cast<size_t>(detection->family - owner.families.data())].push_back(tag);
    }
    apriltag_detections_destroy(found);
  }
  return {std::move(tags), std::move(places.large_px)};
}

}  // namespace heba
