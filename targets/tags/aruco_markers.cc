#include "targets/tags/aruco_markers.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace heba {
namespace {

// A quadrangle that may be a marker. Its corners run clockwise in the image and are pixels, so that all distances and
// areas are exact.
struct Candidate {
  std::array<cv::Point, 4> corners;
  int perimeter_px = 0;  // The number of pixels of the outline.
};

int64_t Cross(const cv::Point& a, const cv::Point& b) {
  return static_cast<int64_t>(a.x) * b.y - static_cast<int64_t>(a.y) * b.x;
}

double SquaredDistance(const cv::Point& a, const cv::Point& b) {
  const cv::Point d = a - b;
  return static_cast<double>(d.ddot(d));
}

// Returns twice the area of a quadrangle.
int64_t DoubleArea(const std::array<cv::Point, 4>& corners) {
  return Cross(corners[2] - corners[0], corners[3] - corners[1]);
}

// Returns the quadrangle that an outline is, if it may be that of a marker in an image of this size.
std::optional<Candidate> CandidateOf(const std::vector<cv::Point>& outline, const cv::Size& size) {
  constexpr double kToleranceOfPerimeter = 0.03;
  constexpr double kLeastSideOfPerimeter = 0.05;
  constexpr int kLeastToBorderPx = 3;
  const auto perimeter_px = static_cast<double>(outline.size());
  std::vector<cv::Point> polygon;
  cv::approxPolyDP(outline, polygon, kToleranceOfPerimeter * perimeter_px, /*closed=*/true);
  if (polygon.size() != 4 || !cv::isContourConvex(polygon)) return std::nullopt;
  const double least_side_px = kLeastSideOfPerimeter * perimeter_px;
  const cv::Rect inner(kLeastToBorderPx, kLeastToBorderPx, size.width - 2 * kLeastToBorderPx,
                       size.height - 2 * kLeastToBorderPx);
  Candidate candidate;
  candidate.perimeter_px = static_cast<int>(outline.size());
  for (size_t k = 0; k < 4; ++k) {
    if (!inner.contains(polygon[k])) return std::nullopt;
    if (SquaredDistance(polygon[k], polygon[(k + 1) % 4]) < least_side_px * least_side_px) return std::nullopt;
    candidate.corners[k] = polygon[k];
  }
  const cv::Point& first = candidate.corners[0];
  const bool is_clockwise = Cross(candidate.corners[1] - first, candidate.corners[2] - first) >= 0;
  if (!is_clockwise) std::swap(candidate.corners[1], candidate.corners[3]);
  return candidate;
}

// Returns the quadrangles of all thresholds, those of the smallest window first.
std::vector<Candidate> AllCandidates(const cv::Mat& grey) {
  constexpr int kWindowsPx[] = {3, 13, 23, 33, 43, 53};
  constexpr int kLeastDarker = 7;  // Grey levels than the mean of the window.
  constexpr double kLeastPerimeterOfSide = 0.01;
  constexpr double kMostPerimeterOfSide = 4;
  const double side_px = std::max(grey.cols, grey.rows);
  const auto least_perimeter_px = static_cast<size_t>(kLeastPerimeterOfSide * side_px);
  const auto most_perimeter_px = static_cast<size_t>(kMostPerimeterOfSide * side_px);
  std::vector<Candidate> candidates;
  cv::Mat dark;
  std::vector<std::vector<cv::Point>> outlines;
  for (const int window_px : kWindowsPx) {
    cv::blur(grey, dark, {window_px, window_px}, {-1, -1}, cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
    // Differences are cut off at 0; what remains is dark.
    cv::subtract(dark, grey, dark);
    cv::subtract(dark, cv::Scalar(kLeastDarker - 1), dark);
    cv::findContours(dark, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    for (const std::vector<cv::Point>& outline : outlines) {
      if (outline.size() < least_perimeter_px || outline.size() > most_perimeter_px) continue;
      if (const std::optional<Candidate> candidate = CandidateOf(outline, grey.size())) {
        candidates.push_back(*candidate);
      }
    }
  }
  return candidates;
}

// Returns whether two candidates lie on each other: with the corners paired in one of the four ways, the RMS of the
// distances is less than 5 % of the shorter perimeter.
bool AreNear(const Candidate& a, const Candidate& b) {
  constexpr double kMostDistanceOfPerimeter = 0.05;
  const double most_px = kMostDistanceOfPerimeter * std::min(a.perimeter_px, b.perimeter_px);
  const double most_px2 = most_px * most_px;
  // The distance of the centres is the least that this RMS can be.
  const cv::Point between = a.corners[0] + a.corners[1] + a.corners[2] + a.corners[3] - b.corners[0] - b.corners[1] -
                            b.corners[2] - b.corners[3];
  if (static_cast<double>(between.ddot(between)) >= 16 * most_px2) return false;
  for (size_t shift = 0; shift < 4; ++shift) {
    double sum_px2 = 0;
    for (size_t k = 0; k < 4; ++k) sum_px2 += SquaredDistance(a.corners[(k + shift) % 4], b.corners[k]);
    if (sum_px2 / 4 < most_px2) return true;
  }
  return false;
}

// Returns the largest candidate of each group of those that lie on one another. A candidate joins the group of the
// first one near it; two groups are not united.
std::vector<Candidate> LargestOfNear(const std::vector<Candidate>& candidates) {
  constexpr size_t kNone = std::numeric_limits<size_t>::max();
  std::vector<size_t> group_of(candidates.size(), kNone);
  std::vector<Candidate> largest;  // One of each group.
  const auto join = [&](size_t candidate, size_t group) {
    group_of[candidate] = group;
    if (DoubleArea(candidates[candidate].corners) >= DoubleArea(largest[group].corners)) {
      largest[group] = candidates[candidate];
    }
  };
  for (size_t i = 0; i < candidates.size(); ++i) {
    for (size_t j = i + 1; j < candidates.size(); ++j) {
      if (group_of[i] != kNone && group_of[j] != kNone) continue;
      if (!AreNear(candidates[i], candidates[j])) continue;
      if (group_of[i] == kNone && group_of[j] == kNone) {
        group_of[i] = largest.size();
        largest.push_back(candidates[i]);
      }
      if (group_of[i] == kNone) {
        join(i, group_of[j]);
      } else {
        join(j, group_of[i]);
      }
    }
    if (group_of[i] == kNone) {
      group_of[i] = largest.size();
      largest.push_back(candidates[i]);
    }
  }
  return largest;
}

}  // namespace

ArucoMarkers FindArucoMarkers(const cv::Mat& grey, const ArucoDictionary& dictionary) {
  ArucoMarkers found;
  if (grey.empty()) return found;
  for (const Candidate& candidate : LargestOfNear(AllCandidates(grey))) {
    TagCorners outline;
    for (size_t k = 0; k < 4; ++k) outline[k] = {candidate.corners[k].x, candidate.corners[k].y};
    if (const std::optional<SeenTag> marker = ReadArucoMarker(grey, outline, dictionary)) {
      found.markers.push_back(*marker);
    } else {
      found.rejected.push_back(outline);
    }
  }
  return found;
}

std::optional<SeenTag> ReadArucoMarker(const cv::Mat& grey, const TagCorners& outline,
                                       const ArucoDictionary& dictionary) {
  constexpr int kCellPx = 4;
  constexpr double kLeastStddevGrey = 5;
  constexpr double kMostWhiteInBorder = 0.35;  // Of the number of cells inside the border.
  constexpr double kOfCorrectableBits = 0.6;
  const int size = dictionary.size();
  const int num_cells = size + 2;
  const int side_px = kCellPx * num_cells;
  std::array<cv::Point2f, 4> corners;
  for (size_t k = 0; k < 4; ++k) {
    corners[k] = {static_cast<float>(outline[k].x()), static_cast<float>(outline[k].y())};
  }
  const auto last_px = static_cast<float>(side_px - 1);
  const std::array<cv::Point2f, 4> square = {{{0, 0}, {last_px, 0}, {last_px, last_px}, {0, last_px}}};
  cv::Mat marker;
  cv::warpPerspective(grey, marker, cv::getPerspectiveTransform(corners.data(), square.data()), {side_px, side_px},
                      cv::INTER_NEAREST);
  // Where all is of one colour, there is no marker. The edge of the border does not count.
  const cv::Rect inner(kCellPx / 2, kCellPx / 2, side_px - kCellPx, side_px - kCellPx);
  cv::Scalar mean_grey;
  cv::Scalar stddev_grey;
  cv::meanStdDev(marker(inner), mean_grey, stddev_grey);
  if (stddev_grey[0] < kLeastStddevGrey) return std::nullopt;
  cv::threshold(marker, marker, 0, 1, cv::THRESH_BINARY | cv::THRESH_OTSU);
  uint64_t code = 0;
  int num_white_in_border = 0;
  for (int row = 0; row < num_cells; ++row) {
    for (int column = 0; column < num_cells; ++column) {
      int num_white_px = 0;
      for (int y = row * kCellPx; y < (row + 1) * kCellPx; ++y) {
        const uchar* const line = marker.ptr<uchar>(y) + column * kCellPx;
        for (int x = 0; x < kCellPx; ++x) num_white_px += line[x];
      }
      const bool is_white = 2 * num_white_px > kCellPx * kCellPx;
      if (row == 0 || column == 0 || row == num_cells - 1 || column == num_cells - 1) {
        num_white_in_border += is_white ? 1 : 0;
      } else {
        code = code << 1 | (is_white ? 1 : 0);
      }
    }
  }
  if (num_white_in_border > static_cast<int>(kMostWhiteInBorder * size * size)) return std::nullopt;
  const auto max_bit_errors = static_cast<int>(kOfCorrectableBits * dictionary.num_correctable_bits());
  const std::optional<IdentifiedMarker> identified = dictionary.Identify(code, max_bit_errors);
  if (!identified) return std::nullopt;
  SeenTag seen;
  seen.index = identified->index;
  seen.corners_px = outline;
  std::rotate(seen.corners_px.begin(), seen.corners_px.begin() + (4 - identified->turns) % 4, seen.corners_px.end());
  return seen;
}

}  // namespace heba
