#include "targets/tags/tag_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"

namespace heba {
namespace {

// These constants are libapriltag's.
constexpr int kTilePx = 4;
constexpr int kMinContrast = 5;  // Minimum range of neighbouring tiles that tells dark from light, in grey levels.

// Minimum side of a region whose cells can be distinguished, in pixels of the decimated image.
constexpr int kLargePx = 32;

// Returns every `decimate`th pixel of every `decimate`th row, as libapriltag does.
cv::Mat Decimated(const cv::Mat& grey, int decimate) {
  if (decimate == 1) return grey;
  cv::Mat decimated((grey.rows - 1) / decimate + 1, (grey.cols - 1) / decimate + 1, CV_8UC1);
  for (int y = 0; y < decimated.rows; ++y) {
    const auto* const from = grey.ptr<uchar>(y * decimate);
    auto* const to = decimated.ptr<uchar>(y);
    for (int x = 0; x < decimated.cols; ++x) to[x] = from[x * decimate];
  }
  return decimated;
}

// The minimum and maximum grey value of each tile and its eight neighbours.
struct TileRange {
  cv::Mat min;
  cv::Mat max;
  double noise_grey = 0;  // Upper bound of the standard deviation of a pixel.
};

// Estimates the standard deviation of a pixel's grey value from the tiles with the smallest ranges.
double NoiseOf(const cv::Mat& min, const cv::Mat& max) {
  std::array<int, 256> counts{};
  for (int y = 0; y < min.rows; ++y) {
    const auto* const low = min.ptr<uchar>(y);
    const auto* const high = max.ptr<uchar>(y);
    for (int x = 0; x < min.cols; ++x) ++counts[static_cast<size_t>(high[x] - low[x])];
  }
  constexpr double kShare = 0.25;
  // The range of 16 normally distributed values has its kShare quantile at this many standard deviations.
  constexpr double kRangeOfSigma = 3.0;
  const double wanted = kShare * static_cast<double>(min.total());
  double sum = 0;
  for (size_t range = 0; range < counts.size(); ++range) {
    sum += counts[range];
    if (sum >= wanted) return static_cast<double>(range) / kRangeOfSigma;
  }
  return 0;
}

TileRange RangesOf(const cv::Mat& grey) {
  const cv::Size num_tiles(grey.cols / kTilePx, grey.rows / kTilePx);
  TileRange own = {cv::Mat(num_tiles, CV_8UC1), cv::Mat(num_tiles, CV_8UC1)};
  std::vector<uchar> column_min(static_cast<size_t>(grey.cols));
  std::vector<uchar> column_max(static_cast<size_t>(grey.cols));
  for (int tile_y = 0; tile_y < num_tiles.height; ++tile_y) {
    std::fill(column_min.begin(), column_min.end(), static_cast<uchar>(255));
    std::fill(column_max.begin(), column_max.end(), static_cast<uchar>(0));
    for (int y = kTilePx * tile_y; y < kTilePx * (tile_y + 1); ++y) {
      const auto* const row = grey.ptr<uchar>(y);
      for (size_t x = 0; x < column_min.size(); ++x) {
        column_min[x] = std::min(column_min[x], row[x]);
        column_max[x] = std::max(column_max[x], row[x]);
      }
    }
    for (int tile_x = 0; tile_x < num_tiles.width; ++tile_x) {
      const auto first = static_cast<std::ptrdiff_t>(kTilePx) * tile_x;
      own.min.at<uchar>(tile_y, tile_x) =
          *std::min_element(column_min.begin() + first, column_min.begin() + first + kTilePx);
      own.max.at<uchar>(tile_y, tile_x) =
          *std::max_element(column_max.begin() + first, column_max.begin() + first + kTilePx);
    }
  }
  TileRange around;
  around.noise_grey = NoiseOf(own.min, own.max);
  cv::erode(own.min, around.min, cv::Mat());
  cv::dilate(own.max, around.max, cv::Mat());
  return around;
}

// Returns a mask that is 255 where a pixel is dark (or light) relative to its surroundings and 0 elsewhere.
cv::Mat Thresholded(const cv::Mat& grey, const TileRange& ranges, bool is_light) {
  // The range of pure noise over nine tiles is 5.3 standard deviations on average, with a deviation of 0.6.
  const double min_range = std::max<double>(kMinContrast, 6.5 * ranges.noise_grey);
  cv::Mat mask(grey.size(), CV_8UC1);
  std::vector<uchar> lowest(static_cast<size_t>(grey.cols));  // Range of grey values in the mask, by column.
  std::vector<uchar> highest(static_cast<size_t>(grey.cols));
  for (int y = 0; y < grey.rows; ++y) {
    const int tile_y = std::min(y / kTilePx, ranges.min.rows - 1);
    if (y == kTilePx * tile_y) {
      for (int x = 0; x < grey.cols; ++x) {
        const int tile_x = std::min(x / kTilePx, ranges.min.cols - 1);
        const int min = ranges.min.at<uchar>(tile_y, tile_x);
        const int max = ranges.max.at<uchar>(tile_y, tile_x);
        const int middle = min + (max - min) / 2;
        const bool is_flat = max - min < min_range;
        // The range is empty where dark and light cannot be told apart.
        lowest[static_cast<size_t>(x)] = static_cast<uchar>(is_flat ? 255 : is_light ? middle + 1 : 0);
        highest[static_cast<size_t>(x)] = static_cast<uchar>(is_flat ? 0 : is_light ? 255 : middle);
      }
    }
    const auto* const from = grey.ptr<uchar>(y);
    auto* const to = mask.ptr<uchar>(y);
    for (size_t x = 0; x < lowest.size(); ++x) {
      to[x] = static_cast<uchar>(from[x] >= lowest[x] && from[x] <= highest[x] ? 255 : 0);
    }
  }
  return mask;
}

// Mean grey values of a region and of the rest of its bounding box.
struct RegionGrey {
  double inside = 0;
  double around = 0;
  double Contrast() const { return std::abs(around - inside); }
};
RegionGrey GreyOf(const cv::Mat& grey, const cv::Mat& labels, int label, const cv::Rect& box) {
  std::array<int64_t, 2> sums{};
  std::array<int64_t, 2> counts{};
  for (int y = box.y; y < box.y + box.height; ++y) {
    const auto* const row = labels.ptr<int>(y) + box.x;
    const auto* const values = grey.ptr<uchar>(y) + box.x;
    for (int x = 0; x < box.width; ++x) {
      const size_t of = row[x] == label ? 1 : 0;
      sums[of] += values[x];
      ++counts[of];
    }
  }
  const auto mean = [&](size_t of) {
    return static_cast<double>(sums[of]) / static_cast<double>(std::max<int64_t>(1, counts[of]));
  };
  return {mean(1), counts[0] == 0 ? 255 - mean(1) : mean(0)};
}

// Returns the outermost pixels of a region in each row and in each column.
std::vector<cv::Point> OutermostPixels(const cv::Mat& labels, int label, const cv::Rect& box) {
  std::vector<cv::Point> pixels;
  pixels.reserve(static_cast<size_t>(2 * (box.width + box.height)));
  std::vector<int> top(static_cast<size_t>(box.width), -1);
  std::vector<int> bottom(static_cast<size_t>(box.width), -1);
  for (int y = box.y; y < box.y + box.height; ++y) {
    const auto* const row = labels.ptr<int>(y) + box.x;
    int first = -1;
    int last = -1;
    for (int x = 0; x < box.width; ++x) {
      if (row[x] != label) continue;
      if (first < 0) first = x;
      last = x;
      int& top_y = top[static_cast<size_t>(x)];
      if (top_y < 0) top_y = y;
      bottom[static_cast<size_t>(x)] = y;
    }
    if (first < 0) continue;
    pixels.emplace_back(box.x + first, y);
    pixels.emplace_back(box.x + last, y);
  }
  for (int x = 0; x < box.width; ++x) {
    if (top[static_cast<size_t>(x)] < 0) continue;
    pixels.emplace_back(box.x + x, top[static_cast<size_t>(x)]);
    pixels.emplace_back(box.x + x, bottom[static_cast<size_t>(x)]);
  }
  return pixels;
}

using Corners = std::array<cv::Point, 4>;

double AreaOfTriangle(const cv::Point& a, const cv::Point& b, const cv::Point& c) {
  return 0.5 * std::abs((b - a).cross(c - a));
}

// Returns the four corners that remain of the points' convex hull when corners are removed one by one, always the one
// that cuts off the smallest area. Returns nothing if the hull has fewer than four.
std::optional<Corners> CornersOf(const std::vector<cv::Point>& points) {
  std::vector<cv::Point> hull;
  cv::convexHull(points, hull);
  Corners corners;
  while (hull.size() > corners.size()) {
    size_t least = 0;
    double least_area = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < hull.size(); ++k) {
      const double area =
          AreaOfTriangle(hull[(k + hull.size() - 1) % hull.size()], hull[k], hull[(k + 1) % hull.size()]);
      if (area >= least_area) continue;
      least_area = area;
      least = k;
    }
    hull.erase(hull.begin() + static_cast<std::ptrdiff_t>(least));
  }
  if (hull.size() < corners.size()) return std::nullopt;
  std::copy(hull.begin(), hull.end(), corners.begin());
  return corners;
}

double DistanceToSegment(const cv::Point& at, const cv::Point& from, const cv::Point& to) {
  const cv::Point2d along = to - from;
  const cv::Point2d offset = at - from;
  const double share = std::clamp(along.dot(offset) / std::max(1e-9, along.dot(along)), 0.0, 1.0);
  return cv::norm(offset - share * along);
}

double MeanSide(const Corners& corners) {
  double sum = 0;
  for (size_t k = 0; k < 4; ++k) sum += cv::norm(corners[(k + 1) % 4] - corners[k]);
  return 0.25 * sum;
}

double AreaPx2(const Corners& corners) {
  double area = 0;
  for (size_t k = 0; k < 4; ++k) area += 0.5 * corners[k].cross(corners[(k + 1) % 4]);
  // The corners are centres of pixels, whose own extent adds to the area.
  return std::abs(area) + 2 * MeanSide(corners) + 1;
}

// Returns whether an outline follows four straight lines, as far as lens distortion permits.
bool IsAboutQuadrilateral(const std::vector<cv::Point>& outermost, const Corners& corners) {
  constexpr double kMinReachPx = 1.6;
  constexpr double kMaxReachPx = 7;     // libapriltag accepts lines with a mean squared error of at most 10 px^2.
  constexpr double kReachRatio = 0.06;  // Maximum deviation of a bent side from its chord, relative to its length.
  constexpr double kMinShare = 0.7;
  const double reach_px = std::clamp(kReachRatio * MeanSide(corners), kMinReachPx, kMaxReachPx);
  const auto num_near = std::count_if(outermost.begin(), outermost.end(), [&](const cv::Point& pixel) {
    for (size_t k = 0; k < 4; ++k) {
      if (DistanceToSegment(pixel, corners[k], corners[(k + 1) % 4]) <= reach_px) return true;
    }
    return false;
  });
  return static_cast<double>(num_near) >= kMinShare * static_cast<double>(outermost.size());
}

// Returns whether the middle of a quad has cells of both colours, as every code does.
bool HasCells(const cv::Mat& grey, const Corners& corners, const RegionGrey& means) {
  constexpr double kMiddle = 0.7;  // Size of the middle relative to the quad.
  const cv::Point2d centre = 0.25 * cv::Point2d(corners[0] + corners[1] + corners[2] + corners[3]);
  std::array<cv::Point2d, 4> middle;
  cv::Point2d low = centre;
  cv::Point2d high = centre;
  for (size_t k = 0; k < 4; ++k) {
    middle[k] = centre + kMiddle * (cv::Point2d(corners[k]) - centre);
    low = {std::min(low.x, middle[k].x), std::min(low.y, middle[k].y)};
    high = {std::max(high.x, middle[k].x), std::max(high.y, middle[k].y)};
  }
  const double turn = (middle[1] - middle[0]).cross(middle[2] - middle[0]) < 0 ? -1.0 : 1.0;
  constexpr double kOtherKind = 0.35;  // Share of the contrast that blurred cells still reach.
  const double limit = means.inside + kOtherKind * (means.around - means.inside);
  const bool is_dark = means.inside < means.around;
  int count = 0;
  int num_other = 0;
  for (int y = static_cast<int>(std::ceil(low.y)); y <= high.y; ++y) {
    const auto* const values = grey.ptr<uchar>(y);
    for (int x = static_cast<int>(std::ceil(low.x)); x <= high.x; ++x) {
      bool is_inside = true;
      for (size_t k = 0; k < 4 && is_inside; ++k) {
        is_inside = turn * (middle[(k + 1) % 4] - middle[k]).cross(cv::Point2d(x, y) - middle[k]) >= 0;
      }
      if (!is_inside) continue;
      ++count;
      num_other += (values[x] > limit) == is_dark ? 1 : 0;
    }
  }
  constexpr double kMinShare = 0.03;
  return num_other >= kMinShare * count;
}

// Returns whether a box equals one of `boxes`, up to the sizes of the pixels that they were found with.
bool IsAmong(const std::vector<cv::Rect>& boxes, const cv::Rect& box) {
  constexpr double kSameRatio = 0.75;
  return std::any_of(boxes.begin(), boxes.end(), [&](const cv::Rect& other) {
    const int shared = (box & other).area();
    return shared > kSameRatio * (box.area() + other.area() - shared);
  });
}

// Returns the boxes with one more, merged with others as long as that adds little area.
std::vector<cv::Rect> WithMerged(std::vector<cv::Rect> boxes, cv::Rect box) {
  constexpr double kMaxRatio = 1.1;
  for (bool is_grown = true; is_grown;) {
    is_grown = false;
    for (size_t k = 0; k < boxes.size() && !is_grown; ++k) {
      const cv::Rect both = boxes[k] | box;
      const int covered = boxes[k].area() + box.area() - (boxes[k] & box).area();
      if (both.area() > kMaxRatio * covered) continue;
      box = both;
      boxes.erase(boxes.begin() + static_cast<std::ptrdiff_t>(k));
      is_grown = true;
    }
  }
  boxes.push_back(box);
  return boxes;
}

}  // namespace

TagPlaces FindTagPlaces(const cv::Mat& grey, const TagPlaceOptions& options, const std::vector<cv::Rect>& searched) {
  CHECK_EQ(grey.type(), CV_8UC1);
  CHECK_GE(options.decimate, 1);
  const int decimate = options.decimate;
  const cv::Rect whole(0, 0, grey.cols, grey.rows);
  const cv::Mat decimated = Decimated(grey, decimate);
  if (std::min(decimated.cols, decimated.rows) < 2 * kTilePx) return {{whole}, {}};
  const TileRange ranges = RangesOf(decimated);
  // Regions of pure noise differ from their surroundings by less than two standard deviations.
  const double min_contrast = std::max<double>(kMinContrast, 2.5 * ranges.noise_grey);
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centres;
  // libapriltag connects dark pixels along their sides, and light ones at their corners too.
  const int connectivity = options.is_light_in_dark ? 8 : 4;
  const int num_labels = cv::connectedComponentsWithStats(Thresholded(decimated, ranges, options.is_light_in_dark),
                                                          labels, stats, centres, connectivity, CV_32S);
  // libapriltag accepts quads of 95 percent of this area, measured by outlines that are half a pixel off.
  const double min_area_px2 = 0.8 * std::pow(std::max(3.0, options.min_side_px / decimate), 2);
  const int tile_px = kTilePx * decimate;
  TagPlaces places;
  for (int label = 1; label < num_labels; ++label) {
    const auto* const entry = stats.ptr<int>(label);
    const cv::Rect region(entry[cv::CC_STAT_LEFT], entry[cv::CC_STAT_TOP], entry[cv::CC_STAT_WIDTH],
                          entry[cv::CC_STAT_HEIGHT]);
    if (region.area() < min_area_px2) continue;
    const cv::Rect region_px(decimate * region.x, decimate * region.y, decimate * region.width,
                             decimate * region.height);
    if (IsAmong(searched, region_px)) continue;
    const RegionGrey means = GreyOf(decimated, labels, label, region);
    if (means.Contrast() < min_contrast) continue;
    const std::vector<cv::Point> outermost = OutermostPixels(labels, label, region);
    const std::optional<Corners> corners = CornersOf(outermost);
    if (!corners || AreaPx2(*corners) < min_area_px2 || !IsAboutQuadrilateral(outermost, *corners)) continue;
    const bool is_large = std::min(region.width, region.height) >= kLargePx;
    if (is_large && !HasCells(decimated, *corners, means)) continue;
    // The box includes the pixels that the same tiles and their neighbours threshold, and the paper that a tag is
    // decoded against.
    const int room_px = decimate * (2 * kTilePx + std::max(region.width, region.height) / 4);
    const int left = std::max(0, (region_px.x - room_px) / tile_px * tile_px);
    const int top = std::max(0, (region_px.y - room_px) / tile_px * tile_px);
    const int right = (region_px.br().x + room_px) / tile_px * tile_px + tile_px;
    const int bottom = (region_px.br().y + room_px) / tile_px * tile_px + tile_px;
    places.boxes = WithMerged(std::move(places.boxes), cv::Rect(left, top, right - left, bottom - top) & whole);
    // A region at the border of the image may have an edge of its own that becomes visible in a finer image.
    const bool is_inside =
        region.x > 0 && region.y > 0 && region.br().x < decimated.cols && region.br().y < decimated.rows;
    if (is_inside && is_large) places.large_px.push_back(region_px);
  }
  return places;
}

}  // namespace heba
