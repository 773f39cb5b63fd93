#include "targets/corners/saddle_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/geometry/homography.h"
#include "targets/images/image.h"

namespace heba {
namespace {

// The radius at which the sectors around a saddle are sampled. Squares must be larger.
constexpr double kRingRadiusPx = 3;
// The distance over which differences of grey values are taken.
constexpr int kStepPx = 2;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
// Rotates a vector by 90 degrees, clockwise in the image.
Eigen::Vector2d Clockwise(const Eigen::Vector2d& a) { return {-a.y(), a.x()}; }

cv::Mat Smooth(const cv::Mat& grey) {
  cv::Mat smooth;
  cv::GaussianBlur(grey, smooth, cv::Size(5, 5), 0, 0, cv::BORDER_REPLICATE);
  return smooth;
}

// Computes minus the determinant of the second derivatives, times kStepPx^4, with the mixed derivative doubled: this
// is about the squared contrast at a corner of four squares, independent of its rotation.
cv::Mat Saddleness(const cv::Mat& smooth) {
  cv::Mat saddleness(smooth.size(), CV_32F, cv::Scalar(0));
  for (int y = kStepPx; y < smooth.rows - kStepPx; ++y) {
    const uchar* const above = smooth.ptr<uchar>(y - kStepPx);
    const uchar* const here = smooth.ptr<uchar>(y);
    const uchar* const below = smooth.ptr<uchar>(y + kStepPx);
    auto* const to = saddleness.ptr<float>(y);
    for (int x = kStepPx; x < smooth.cols - kStepPx; ++x) {
      const auto mixed =
          static_cast<float>(above[x - kStepPx] + below[x + kStepPx] - above[x + kStepPx] - below[x - kStepPx]);
      const auto along_x = static_cast<float>(here[x - kStepPx] + here[x + kStepPx] - 2 * here[x]);
      const auto along_y = static_cast<float>(above[x] + below[x] - 2 * here[x]);
      to[x] = 0.25F * mixed * mixed - along_x * along_y;
    }
  }
  return saddleness;
}

// Returns the median difference of nearby grey values, which measures noise or a fine texture.
double TextureGrey(const cv::Mat& smooth) {
  std::array<size_t, 256> counts{};
  size_t num = 0;
  for (int y = 0; y < smooth.rows; y += 4) {
    const uchar* const row = smooth.ptr<uchar>(y);
    for (int x = 0; x + kStepPx < smooth.cols; x += 3, ++num) ++counts[std::abs(row[x + kStepPx] - row[x])];
  }
  size_t sum = 0;
  for (size_t grey = 0; grey < counts.size(); ++grey) {
    sum += counts[grey];
    if (2 * sum >= num) return static_cast<double>(grey);
  }
  return 0;
}

struct Peak {
  float saddleness;
  cv::Point at;
};

// Returns the local maxima of at least that contrast; if there are more than `most`, the highest ones.
std::vector<Peak> PeaksOf(const cv::Mat& saddleness, double min_contrast_grey, size_t most) {
  const auto least = static_cast<float>(min_contrast_grey * min_contrast_grey);
  constexpr int kReach = 2;
  const int margin = static_cast<int>(kRingRadiusPx) + 2;
  std::vector<Peak> peaks;
  for (int y = margin; y < saddleness.rows - margin; ++y) {
    const auto* const row = saddleness.ptr<float>(y);
    for (int x = margin; x < saddleness.cols - margin; ++x) {
      const float value = row[x];
      if (value < least || value < row[x - 1] || value <= row[x + 1]) continue;
      bool is_peak = true;
      for (int dy = -kReach; dy <= kReach && is_peak; ++dy) {
        const auto* const other = saddleness.ptr<float>(y + dy) + x;
        for (int dx = -kReach; dx <= kReach && is_peak; ++dx) {
          const bool is_later = dy > 0 || (dy == 0 && dx > 0);
          is_peak = (dx == 0 && dy == 0) || (is_later ? other[dx] < value : other[dx] <= value);
        }
      }
      if (is_peak) peaks.push_back({value, {x, y}});
    }
  }
  const auto is_higher = [](const Peak& a, const Peak& b) {
    if (a.saddleness != b.saddleness) return a.saddleness > b.saddleness;
    return a.at.y != b.at.y ? a.at.y < b.at.y : a.at.x < b.at.x;
  };
  if (peaks.size() > most) {
    std::nth_element(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(most), peaks.end(), is_higher);
    peaks.resize(most);
  }
  return peaks;
}

// Returns the position of the maximum of a parabola through three equidistant values, relative to the middle one.
double TopOf(double before, double here, double behind) {
  const double curvature = 2 * here - before - behind;
  return curvature > 0 ? std::clamp(0.5 * (behind - before) / curvature, -0.5, 0.5) : 0;
}

// Returns the saddle at a peak if dark and light alternate twice around it and opposite sectors are alike.
std::optional<Saddle> SaddleAt(const cv::Mat& smooth, const cv::Mat& saddleness, const cv::Point& at) {
  constexpr size_t kNumSamples = 24;
  static const std::array<Eigen::Vector2d, kNumSamples> kDirections = [] {
    std::array<Eigen::Vector2d, kNumSamples> directions;
    for (size_t i = 0; i < kNumSamples; ++i) {
      const double angle = 2 * kPi * static_cast<double>(i) / kNumSamples;
      directions[i] = {std::cos(angle), std::sin(angle)};
    }
    return directions;
  }();
  const auto value = [&](int dx, int dy) -> double { return saddleness.at<float>(at.y + dy, at.x + dx); };
  Saddle saddle;
  saddle.pixel = {at.x + TopOf(value(-1, 0), value(0, 0), value(1, 0)),
                  at.y + TopOf(value(0, -1), value(0, 0), value(0, 1))};
  std::array<double, kNumSamples> levels;
  for (size_t i = 0; i < kNumSamples; ++i) levels[i] = GreyAt(smooth, saddle.pixel + kRingRadiusPx * kDirections[i]);
  const auto [darkest, lightest] = std::minmax_element(levels.begin(), levels.end());
  const double middle = 0.5 * (*darkest + *lightest);
  // The angles at which the sectors begin, in samples, and whether the first sector is dark.
  std::array<double, 4> begins;
  size_t num_sectors = 0;
  bool is_first_dark = false;
  for (size_t i = 0; i < kNumSamples; ++i) {
    const double here = levels[i] - middle;
    const double next = levels[(i + 1) % kNumSamples] - middle;
    if ((here < 0) == (next < 0)) continue;
    if (num_sectors == 4) return std::nullopt;
    if (num_sectors == 0) is_first_dark = next < 0;
    begins[num_sectors++] = static_cast<double>(i) + here / (here - next);
  }
  if (num_sectors != 4) return std::nullopt;
  // Edges remain nearly straight under perspective and lens distortion.
  constexpr double kMaxKink = kNumSamples / 12.0;
  constexpr double kMinSector = kNumSamples / 18.0;
  for (size_t k = 0; k < 2; ++k) {
    if (std::abs(begins[k + 2] - begins[k] - 0.5 * kNumSamples) > kMaxKink) return std::nullopt;
  }
  std::array<double, 4> sectors;  // Grey values in the middles of the sectors.
  for (size_t k = 0; k < 4; ++k) {
    const double end = k < 3 ? begins[k + 1] : begins[0] + kNumSamples;
    if (end - begins[k] < kMinSector) return std::nullopt;
    sectors[k] = levels[static_cast<size_t>(std::lround(0.5 * (begins[k] + end))) % kNumSamples];
  }
  const size_t dark = is_first_dark ? 0 : 1;
  saddle.contrast_grey = std::min(sectors[1 - dark], sectors[3 - dark]) - std::max(sectors[dark], sectors[dark + 2]);
  constexpr double kMinShare = 0.4;
  if (saddle.contrast_grey < kMinShare * (*lightest - *darkest)) return std::nullopt;
  const auto direction = [&](double begin) {
    const double angle = 2 * kPi * begin / kNumSamples;
    return Eigen::Vector2d(std::cos(angle), std::sin(angle));
  };
  for (size_t k = 0; k < 2; ++k) {
    saddle.edges[k] = (direction(begins[k]) - direction(begins[k + 2])).normalized();
  }
  if (!is_first_dark) {
    std::swap(saddle.edges[0], saddle.edges[1]);
    saddle.edges[1] = -saddle.edges[1];
  }
  return saddle;
}

// An index of saddles by position.
class SaddleIndex {
 public:
  SaddleIndex(const std::vector<Saddle>& saddles, cv::Size image_px)
      : columns_(image_px.width / kCellPx + 1), rows_(image_px.height / kCellPx + 1) {
    cells_.resize(static_cast<size_t>(columns_ * rows_));
    for (size_t n = 0; n < saddles.size(); ++n) {
      const int column = LineOf(saddles[n].pixel.x(), columns_);
      cells_[static_cast<size_t>(LineOf(saddles[n].pixel.y(), rows_) * columns_ + column)].push_back(
          static_cast<int>(n));
    }
  }
  // Calls `use` with the index of every saddle in the cells that come within `reach_px`.
  template <typename Use>
  void ForEachNear(const Eigen::Vector2d& pixel, double reach_px, const Use& use) const {
    const int last_row = LineOf(pixel.y() + reach_px, rows_);
    const int last_column = LineOf(pixel.x() + reach_px, columns_);
    for (int row = LineOf(pixel.y() - reach_px, rows_); row <= last_row; ++row) {
      for (int column = LineOf(pixel.x() - reach_px, columns_); column <= last_column; ++column) {
        for (const int n : cells_[static_cast<size_t>(row * columns_ + column)]) use(n);
      }
    }
  }

 private:
  static constexpr int kCellPx = 16;
  static int LineOf(double px, int num_lines) {
    return std::clamp(static_cast<int>(std::floor(px / kCellPx)), 0, num_lines - 1);
  }
  int columns_;
  int rows_;
  std::vector<std::vector<int>> cells_;
};

// The directions from a saddle: along edges[0], along edges[1], and opposite to them.
constexpr size_t kNumWays = 4;
Eigen::Vector2d WayOf(const Saddle& saddle, size_t way) { return (way < 2 ? 1 : -1) * saddle.edges[way % 2]; }
constexpr size_t BackOf(size_t way) { return (way + 2) % kNumWays; }
using Links = std::array<int, kNumWays>;  // Next saddle in each direction, or -1.

// Returns the direction at `to` that continues the direction `way` at `from`, if there is one. The colours change
// sides at every corner, so that the first edge of one corner continues as the second edge of the next.
std::optional<size_t> WayOn(const Saddle& from, size_t way, const Saddle& to) {
  constexpr double kMaxSine = 0.45;
  // Illumination changes little from one corner to the next.
  constexpr double kMaxContrastRatio = 2.5;
  const auto [less, more] = std::minmax(from.contrast_grey, to.contrast_grey);
  if (more > kMaxContrastRatio * less) return std::nullopt;
  const Eigen::Vector2d direction = WayOf(from, way);
  const size_t edge = 1 - way % 2;
  if (std::abs(Cross(direction, to.edges[edge])) > kMaxSine) return std::nullopt;
  if (std::abs(Cross(WayOf(from, 1 - way % 2), to.edges[1 - edge])) > kMaxSine) return std::nullopt;
  return direction.dot(to.edges[edge]) > 0 ? edge : edge + 2;
}

// Returns whether an edge runs from one saddle to the other, with its dark side as at the first one.
bool IsEdge(const cv::Mat& smooth, const Saddle& from, size_t way, const Saddle& to) {
  const Eigen::Vector2d offset = to.pixel - from.pixel;
  const double length_px = offset.norm();
  // The dark side lies clockwise of edges[0].
  const Eigen::Vector2d towards_dark = (way % 2 == 0 ? 1 : -1) * Clockwise(offset / length_px);
  const double aside_px = std::clamp(0.15 * length_px, 1.0, 4.0);
  constexpr double kMinShare = 0.3;
  const double least = kMinShare * std::min(from.contrast_grey, to.contrast_grey);
  for (const double share : {0.3, 0.5, 0.7}) {
    const Eigen::Vector2d at = from.pixel + share * offset;
    const Eigen::Vector2d dark = at + aside_px * towards_dark;
    const Eigen::Vector2d light = at - aside_px * towards_dark;
    if (!IsInImage(smooth, dark) || !IsInImage(smooth, light)) return false;
    if (GreyAt(smooth, light) - GreyAt(smooth, dark) < least) return false;
  }
  return true;
}

// Returns the nearest saddles that are connected by edges.
Links LinksOf(const cv::Mat& smooth, const std::vector<Saddle>& saddles, const SaddleIndex& index, int here) {
  constexpr double kMinLengthPx = 3.5;
  constexpr double kMaxSine = 0.35;
  // A saddle is not a neighbour if there are this many nearer ones,
  constexpr size_t kCrowd = 64;
  // or if it is this many times as far away as another neighbour, which limits how oblique squares may be.
  constexpr double kMaxLengthRatio = 6;
  const Saddle& from = saddles[static_cast<size_t>(here)];
  Links links;
  links.fill(-1);
  double farthest_px = std::hypot(smooth.cols, smooth.rows);
  std::vector<std::pair<double, int>> near;
  double seen_px = kMinLengthPx;
  for (double reach_px = 16; seen_px < farthest_px && near.size() < kCrowd; reach_px *= 2) {
    near.clear();
    index.ForEachNear(from.pixel, reach_px, [&](int n) {
      const double length_px = (saddles[static_cast<size_t>(n)].pixel - from.pixel).norm();
      if (n != here && length_px <= reach_px) near.emplace_back(length_px, n);
    });
    std::sort(near.begin(), near.end());
    for (const auto& [length_px, n] : near) {
      if (length_px < seen_px || length_px > farthest_px) continue;
      const Saddle& to = saddles[static_cast<size_t>(n)];
      const Eigen::Vector2d direction = (to.pixel - from.pixel) / length_px;
      for (size_t way = 0; way < kNumWays; ++way) {
        if (links[way] >= 0 || direction.dot(WayOf(from, way)) <= 0) continue;
        if (std::abs(Cross(WayOf(from, way), direction)) > kMaxSine) continue;
        if (!WayOn(from, way, to) || !IsEdge(smooth, from, way, to)) continue;
        links[way] = n;
        farthest_px = std::min(farthest_px, kMaxLengthRatio * length_px);
      }
    }
    seen_px = std::nextafter(reach_px, farthest_px);
  }
  return links;
}

using Cell = std::pair<int, int>;  // Column and row.
using Grid = std::map<Cell, Eigen::Vector2d>;

// Joins saddles that are linked in both directions to grids.
class GridGrower {
 public:
  GridGrower(const std::vector<Saddle>& saddles, const std::vector<Links>& links)
      : saddles_(saddles), links_(links), is_used_(saddles.size(), false) {}

  // Returns the saddles that are linked with `seed`; none if it was in an earlier grid.
  Grid GridFrom(int seed) {
    if (is_used_[static_cast<size_t>(seed)]) return {};
    Grid grid;
    std::deque<Member> open = {{seed, {0, 0}, 0}};
    is_used_[static_cast<size_t>(seed)] = true;
    while (!open.empty()) {
      const Member member = open.front();
      open.pop_front();
      const Saddle& from = saddles_[static_cast<size_t>(member.saddle)];
      if (!grid.emplace(member.cell, from.pixel).second) continue;
      // The directions, counted clockwise, are edges[0], edges[1] and their opposites.
      for (size_t turn = 0; turn < kNumWays; ++turn) {
        const size_t way = (member.way + turn) % kNumWays;
        const int next = links_[static_cast<size_t>(member.saddle)][way];
        if (next < 0 || is_used_[static_cast<size_t>(next)]) continue;
        const std::optional<size_t> way_on = WayOn(from, way, saddles_[static_cast<size_t>(next)]);
        if (!way_on || links_[static_cast<size_t>(next)][BackOf(*way_on)] != member.saddle) continue;
        is_used_[static_cast<size_t>(next)] = true;
        constexpr std::array<Cell, kNumWays> kSteps = {Cell{1, 0}, Cell{0, 1}, Cell{-1, 0}, Cell{0, -1}};
        open.push_back({next,
                        {member.cell.first + kSteps[turn].first, member.cell.second + kSteps[turn].second},
                        (*way_on + kNumWays - turn) % kNumWays});
      }
    }
    return grid;
  }

 private:
  struct Member {
    int saddle;
    Cell cell;
    size_t way;  // Direction along the grid's first axis; the next one clockwise is along the second.
  };

  const std::vector<Saddle>& saddles_;
  const std::vector<Links>& links_;
  std::vector<bool> is_used_;
};

// Returns the columns and rows from the first to the last with at least half as many corners as the fullest one.
cv::Rect BoundsOf(const Grid& grid) {
  std::map<int, int> columns;
  std::map<int, int> rows;
  for (const auto& [cell, pixel] : grid) {
    ++columns[cell.first];
    ++rows[cell.second];
  }
  const auto range = [](const std::map<int, int>& counts) {
    int most = 0;
    for (const auto& [line, count] : counts) most = std::max(most, count);
    std::pair<int, int> lines(0, -1);
    bool is_first = true;
    for (const auto& [line, count] : counts) {
      if (2 * count < most) continue;
      if (is_first) lines.first = line;
      is_first = false;
      lines.second = line;
    }
    return lines;
  };
  const auto [first_column, last_column] = range(columns);
  const auto [first_row, last_row] = range(rows);
  return {first_column, first_row, last_column - first_column + 1, last_row - first_row + 1};
}

// Predicts a corner that was not seen from those on both sides of it or from two on one side.
std::optional<Eigen::Vector2d> Expected(const Grid& grid, const Cell& cell) {
  const auto find = [&](int column, int row) -> const Eigen::Vector2d* {
    const auto entry = grid.find({cell.first + column, cell.second + row});
    return entry == grid.end() ? nullptr : &entry->second;
  };
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for (const auto& [column, row] : {Cell{1, 0}, Cell{0, 1}}) {
    const Eigen::Vector2d* const before = find(-column, -row);
    const Eigen::Vector2d* const behind = find(column, row);
    if (before == nullptr || behind == nullptr) continue;
    sum += 0.5 * (*before + *behind);
    ++count;
  }
  for (const auto& [column, row] : {Cell{1, 0}, Cell{0, 1}, Cell{-1, 0}, Cell{0, -1}}) {
    if (count > 0) break;
    const Eigen::Vector2d* const next = find(column, row);
    const Eigen::Vector2d* const after = find(2 * column, 2 * row);
    if (next == nullptr || after == nullptr) continue;
    sum += 2 * *next - *after;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

// Returns the grid with the missing corners within the bounds; nothing if one cannot be predicted or lies outside the
// image.
std::optional<Grid> FilledIn(Grid grid, const cv::Mat& image, const cv::Rect& bounds) {
  for (int row = bounds.y; row < bounds.y + bounds.height; ++row) {
    for (int column = bounds.x; column < bounds.x + bounds.width; ++column) {
      if (grid.count({column, row}) > 0) continue;
      const std::optional<Eigen::Vector2d> expected = Expected(grid, {column, row});
      if (!expected || !IsInImage(image, *expected)) return std::nullopt;
      grid[{column, row}] = *expected;
    }
  }
  return grid;
}

// Determines where a chessboard may be if a grid is only a part of it: the missing part must lie in the image, and
// there must be squares next to the grid.
class Continuation {
 public:
  Continuation(const cv::Mat& smooth, const Grid& grid, const cv::Rect& bounds) : smooth_(smooth), bounds_(bounds) {
    std::vector<Eigen::Vector2d> cells;
    std::vector<Eigen::Vector2d> pixels;
    for (const auto& [cell, pixel] : grid) {
      if (!bounds.contains({cell.first, cell.second})) continue;
      cells.emplace_back(cell.first, cell.second);
      pixels.push_back(pixel);
    }
    constexpr size_t kLeast = 4;
    if (cells.size() >= kLeast) pixel_from_cell_ = FitHomography(cells, pixels);
    if (!pixel_from_cell_) return;
    double sum = 0;
    int count = 0;
    for (int row = bounds.y; row + 1 < bounds.y + bounds.height; ++row) {
      for (int column = bounds.x; column + 1 < bounds.x + bounds.width; ++column, ++count) {
        sum += SignOf(column, row) * SquareGrey(column, row).value_or(0);
      }
    }
    // There are about as many squares of one colour as of the other.
    half_contrast_grey_ = count > 1 ? sum / count : 0;
  }

  // Returns the region that may contain a chessboard of `size` corners and its surroundings; empty if there is none.
  cv::Rect MayBeIn(cv::Size size) const {
    if (!pixel_from_cell_) return {};
    const int spare_columns = size.width - bounds_.width;
    const int spare_rows = size.height - bounds_.height;
    // The surroundings of a chessboard may look like more squares: a rim on all sides, or, around a small one, on any
    // side.
    constexpr int kSmall = 30;
    constexpr int kRimLines = 2;
    const bool is_with_rim = spare_columns == -kRimLines && spare_rows == -kRimLines;
    const int most_more = size.area() < kSmall ? kRimLines : 0;
    if (std::min(spare_columns, spare_rows) < -most_more && !is_with_rim) return {};
    cv::Rect region;
    for (int left = 0; left <= std::max(0, spare_columns); ++left) {
      for (int above = 0; above <= std::max(0, spare_rows); ++above) {
        const cv::Rect board(bounds_.x - left, bounds_.y - above, std::max(size.width, bounds_.width),
                             std::max(size.height, bounds_.height));
        if (IsInside(board) && HasSquares(board)) region |= RegionOf(board);
      }
    }
    return region;
  }

 private:
  // Returns the sign of the square between the corners (column, row) and (column + 1, row + 1).
  static int SignOf(int column, int row) { return ((column + row) & 1) == 0 ? 1 : -1; }
  std::optional<double> SquareGrey(int column, int row) const {
    const Eigen::Vector2d middle = ApplyHomography(*pixel_from_cell_, Eigen::Vector2d(column + 0.5, row + 0.5));
    if (!IsInImage(smooth_, middle)) return std::nullopt;
    return GreyAt(smooth_, middle);
  }

  // Returns the pixels of a chessboard, including the squares around its corners and a light rim.
  cv::Rect RegionOf(const cv::Rect& board) const {
    constexpr int kRim = 2;
    const cv::Rect image(0, 0, smooth_.cols, smooth_.rows);
    std::vector<cv::Point2f> outline;
    for (const int column : {board.x - kRim, board.x + board.width - 1 + kRim}) {
      for (const int row : {board.y - kRim, board.y + board.height - 1 + kRim}) {
        const Eigen::Vector2d pixel = ApplyHomography(*pixel_from_cell_, Eigen::Vector2d(column, row));
        const double farthest_px = 4.0 * (image.width + image.height);
        if (!(pixel.cwiseAbs().maxCoeff() < farthest_px)) return image;
        outline.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
      }
    }
    return cv::boundingRect(outline) & image;
  }

  // Returns whether all corners of the chessboard lie in the image. Its outer corners suffice, since the image is
  // convex.
  bool IsInside(const cv::Rect& board) const {
    for (const int column : {board.x, board.x + board.width - 1}) {
      for (const int row : {board.y, board.y + board.height - 1}) {
        const Eigen::Vector2d pixel = ApplyHomography(*pixel_from_cell_, Eigen::Vector2d(column, row));
        const Eigen::Vector2d nearest(std::clamp(column, bounds_.x, bounds_.x + bounds_.width - 1),
                                      std::clamp(row, bounds_.y, bounds_.y + bounds_.height - 1));
        // Lens distortion may displace points far from the part that is seen.
        constexpr double kMaxBend = 0.15;
        const double room_px = 1 + kMaxBend * (pixel - ApplyHomography(*pixel_from_cell_, nearest)).norm();
        if (!(pixel.x() > -room_px && pixel.y() > -room_px && pixel.x() < smooth_.cols - 1 + room_px &&
              pixel.y() < smooth_.rows - 1 + room_px)) {
          return false;
        }
      }
    }
    return true;
  }

  // Returns whether there are squares beyond the next row or column of corners on every side on which corners are
  // missing.
  bool HasSquares(const cv::Rect& board) const {
    return (board.x == bounds_.x || HasColumn(bounds_.x - 2)) &&
           (board.br().x == bounds_.br().x || HasColumn(bounds_.br().x)) &&
           (board.y == bounds_.y || HasRow(bounds_.y - 2)) &&
           (board.br().y == bounds_.br().y || HasRow(bounds_.br().y));
  }
  bool HasColumn(int column) const {
    return HasSquaresAt(bounds_.height + 1, [&](int n) { return cv::Point(column, bounds_.y - 1 + n); });
  }
  bool HasRow(int row) const {
    return HasSquaresAt(bounds_.width + 1, [&](int n) { return cv::Point(bounds_.x - 1 + n, row); });
  }
  // Returns whether most neighbouring squares of a line differ in brightness as they should.
  template <typename SquareOf>
  bool HasSquaresAt(int count, const SquareOf& square_of) const {
    constexpr double kMinShareOfContrast = 0.3;
    constexpr double kMinShareOfSquares = 0.6;
    int num_alternating = 0;
    for (int n = 0; n + 1 < count; ++n) {
      const cv::Point here = square_of(n);
      const cv::Point next = square_of(n + 1);
      const std::optional<double> here_grey = SquareGrey(here.x, here.y);
      const std::optional<double> next_grey = SquareGrey(next.x, next.y);
      if (!here_grey || !next_grey) continue;
      const double contrast_grey = SignOf(here.x, here.y) * (*here_grey - *next_grey);
      num_alternating +=
          contrast_grey * half_contrast_grey_ > kMinShareOfContrast * 2 * half_contrast_grey_ * half_contrast_grey_ ? 1
                                                                                                                    : 0;
    }
    return num_alternating >= kMinShareOfSquares * (count - 1);
  }

  const cv::Mat& smooth_;
  cv::Rect bounds_;
  std::optional<Eigen::Matrix3d> pixel_from_cell_;
  double half_contrast_grey_ = 0;  // Positive if the squares of sign 1 are the light ones.
};

// The saddles of an image that are linked along edges to grids of at least a number of them.
class SaddleGrids {
 public:
  // A chessboard of about `num_corners` is looked for, with some clutter around it.
  SaddleGrids(const cv::Mat& grey, size_t num_corners, size_t least_seen) {
    constexpr size_t kClutter = 3000;
    const std::vector<Saddle> saddles = FindSaddles(grey, kClutter + 2 * num_corners);
    if (saddles.size() < least_seen) return;
    smooth_ = Smooth(grey);
    const SaddleIndex index(saddles, grey.size());
    std::vector<Links> links;
    for (size_t n = 0; n < saddles.size(); ++n) {
      links.push_back(LinksOf(smooth_, saddles, index, static_cast<int>(n)));
    }
    GridGrower grower(saddles, links);
    for (size_t seed = 0; seed < saddles.size(); ++seed) {
      Grid grid = grower.GridFrom(static_cast<int>(seed));
      if (grid.size() >= least_seen) grids_.push_back(std::move(grid));
    }
  }

  // Returns the grids, that of the most contrast first.
  const std::vector<Grid>& grids() const { return grids_; }
  const cv::Mat& smooth() const { return smooth_; }

 private:
  cv::Mat smooth_;
  std::vector<Grid> grids_;
};

// Returns the fewest saddles of a grid of corners with which it counts as found: some may be hidden by glare or not be
// recognised as corners.
size_t LeastFound(size_t num_corners) { return std::max<size_t>(8, num_corners * 4 / 5); }

// Returns the corners of a grid without gaps, row by row, or column by column if it is not upright.
std::vector<cv::Point2f> CornersOf(const Grid& grid, const cv::Rect& bounds, bool is_upright) {
  std::vector<cv::Point2f> corners;
  const cv::Size size = is_upright ? bounds.size() : cv::Size(bounds.height, bounds.width);
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      const Eigen::Vector2d& pixel =
          grid.at(is_upright ? Cell{bounds.x + column, bounds.y + row} : Cell{bounds.x + row, bounds.y + column});
      corners.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    }
  }
  return corners;
}

}  // namespace

std::vector<Saddle> FindSaddles(const cv::Mat& grey, size_t max_saddles) {
  CHECK_EQ(grey.type(), CV_8UC1);
  const cv::Mat smooth = Smooth(grey);
  const cv::Mat saddleness = Saddleness(smooth);
  std::vector<Saddle> saddles;
  constexpr double kMinContrastGrey = 6;
  constexpr double kTextures = 6;      // Ratio of a saddle's contrast to the texture's that chance rarely exceeds.
  constexpr size_t kPeaksASaddle = 4;  // Most peaks caused by noise are not saddles.
  const double least_grey = std::max(kMinContrastGrey, kTextures * TextureGrey(smooth));
  for (const Peak& peak : PeaksOf(saddleness, least_grey, kPeaksASaddle * max_saddles)) {
    if (const std::optional<Saddle> saddle = SaddleAt(smooth, saddleness, peak.at)) saddles.push_back(*saddle);
  }
  std::stable_sort(saddles.begin(), saddles.end(),
                   [](const Saddle& a, const Saddle& b) { return a.contrast_grey > b.contrast_grey; });
  if (saddles.size() > max_saddles) saddles.resize(max_saddles);
  return saddles;
}

SaddleGrid FindSaddleGrid(const cv::Mat& grey, cv::Size size) {
  SaddleGrid result;
  const auto num_corners = static_cast<size_t>(size.area());
  const size_t least_found = LeastFound(num_corners);
  size_t most_seen = 0;
  const SaddleGrids grids(grey, num_corners, std::max<size_t>(6, num_corners / 4));
  for (const Grid& grid : grids.grids()) {
    const cv::Rect bounds = BoundsOf(grid);
    if (grid.size() > most_seen) {
      const Continuation continuation(grids.smooth(), grid, bounds);
      const cv::Rect region = continuation.MayBeIn(size) | continuation.MayBeIn({size.height, size.width});
      if (!region.empty()) {
        most_seen = grid.size();
        result.may_be_in = region;
      }
    }
    for (const bool is_upright : {true, false}) {
      const cv::Size wanted = is_upright ? size : cv::Size(size.height, size.width);
      if (grid.size() < least_found || bounds.size() != wanted) continue;
      const std::optional<Grid> whole = FilledIn(grid, grey, bounds);
      if (!whole) continue;
      result.corners = CornersOf(*whole, bounds, is_upright);
      return result;
    }
  }
  return result;
}

AnySaddleGrid FindLargestSaddleGrid(const cv::Mat& grey) {
  constexpr size_t kManyCorners = 500;
  constexpr size_t kFewestSeen = 6;
  AnySaddleGrid result;
  const SaddleGrids grids(grey, kManyCorners, kFewestSeen);
  const auto largest = std::max_element(grids.grids().begin(), grids.grids().end(),
                                        [](const Grid& a, const Grid& b) { return a.size() < b.size(); });
  if (largest == grids.grids().end()) return result;
  const cv::Rect bounds = BoundsOf(*largest);
  result.num_seen = largest->size();
  result.size = bounds.size();
  if (largest->size() < LeastFound(static_cast<size_t>(bounds.area()))) return result;
  const std::optional<Grid> whole = FilledIn(*largest, grey, bounds);
  if (whole) result.corners = CornersOf(*whole, bounds, true);
  return result;
}

}  // namespace heba
