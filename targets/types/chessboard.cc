// A plain chessboard, defined by its inner corners. Frame: origin at the first inner corner, x to the right along the
// columns, y down, z into the sheet. The square above and to the left of the origin is black (or, if the numbers of
// rows and columns of corners have an even sum, possibly white). id = row * columns + column.
//
// The corners are located by a grid of saddles (saddle_grid.h) or, if that is incomplete, by OpenCV's finders. Every
// corner is then refined as a saddle in the full image, and the chessboard is accepted only if the image looks like
// one around every corner. Refinement halves the error of the finders' own sub-pixel step: the RMS of
// cv::calibrateCamera on recorded sets falls from 0.22, 0.21 and 0.07 px (findChessboardCornersSB with its ACCURACY
// flag) to 0.17, 0.08 and 0.05 px.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/config/yaml_reader.h"
#include "heba/geometry/homography.h"
#include "heba/target.h"
#include "targets/corners/corner_lattice.h"
#include "targets/corners/corner_refinement.h"
#include "targets/corners/saddle_grid.h"
#include "targets/types/likely_misconfigurations.h"

namespace heba {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

// Converts corners from pixels of an image that was resized by `scale`. The outer edges of the first pixels coincide,
// not their centres.
Corners FromOpenCv(const std::vector<cv::Point2f>& corners, double scale) {
  const Eigen::Vector2d half(0.5, 0.5);
  Corners pixels;
  for (const cv::Point2f& corner : corners) {
    pixels.emplace_back((Eigen::Vector2d(corner.x, corner.y) + half) / scale - half);
  }
  return pixels;
}

// A method that finds all corners of a chessboard, row by row in some order, or none.
struct Finder {
  // Largest and, by enlarging, smallest size of the larger side of the searched image.
  double max_side_px;
  double min_side_px;
  int flags;  // The flags of OpenCV's finder by sectors.
};

// Image sizes for the search by saddles: coarse to fine, enlarged for small chessboards, and last coarse for
// defocused images. Saddles take a tenth of the time of OpenCV's finders, whatever the image shows.
struct Level {
  double max_side_px;  // See Finder.
  double min_side_px;
};
constexpr Level kLevels[] = {{1000, 0}, {2000, 0}, {4000, 2000}, {500, 0}};

// Finders for images in which the saddles show much of a chessboard, but not all of it, in this order: with the
// original contrast, with the contrast stretched for dark images, and with small chessboards enlarged.
constexpr Finder kFinders[] = {
    {960, 0, 0},
    {960, 0, cv::CALIB_CB_NORMALIZE_IMAGE},
    {2000, 1200, cv::CALIB_CB_NORMALIZE_IMAGE},
};
constexpr double kMaxEnlargement = 3;

double ScaleOf(const cv::Mat& grey, double max_side_px, double min_side_px) {
  const double side_px = std::max(grey.cols, grey.rows);
  return std::max(std::min(1.0, max_side_px / side_px), std::min(kMaxEnlargement, min_side_px / side_px));
}

cv::Mat Resized(const cv::Mat& grey, double scale) {
  if (scale == 1) return grey;
  cv::Mat image;
  cv::resize(grey, image, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  return image;
}

// Returns the scales of an image for the search by saddles, without those that are nearly the last one again.
std::vector<double> ScalesOf(const cv::Mat& grey) {
  std::vector<double> scales;
  for (const Level& level : kLevels) {
    const double scale = ScaleOf(grey, level.max_side_px, level.min_side_px);
    constexpr double kAlike = 1.4;
    if (!scales.empty() && scale < kAlike * scales.back() && scales.back() < kAlike * scale) continue;
    scales.push_back(scale);
  }
  return scales;
}

// Smallest number of inner corners along a side that OpenCV's finders accept.
constexpr int kMinSide = 3;

// A grid of corners in the image, row by row, or a part of one.
struct SeenGrid {
  cv::Size size;
  Corners corners;
};

// OpenCV's flags of the first two finders.
constexpr int kFlagsOfFinders[] = {0, cv::CALIB_CB_NORMALIZE_IMAGE};

// Returns the grid of any size that OpenCV sees with these flags in a part of the image; nothing if there is none.
std::optional<SeenGrid> GridSeen(const cv::Mat& grey, const cv::Rect& part, int flags,
                                 double max_side_px = kFinders[0].max_side_px) {
  const double scale = std::min(1.0, max_side_px / std::max(grey.cols, grey.rows));
  cv::Mat image;
  cv::resize(grey(part), image, {}, scale, scale, cv::INTER_AREA);
  std::vector<cv::Point2f> found;
  cv::Mat meta;
  const bool is_seen = cv::findChessboardCornersSB(image, {kMinSide, kMinSide}, found,
                                                   flags | static_cast<int>(cv::CALIB_CB_LARGER), meta);
  if (!is_seen) return std::nullopt;
  SeenGrid grid{meta.size(), FromOpenCv(found, scale)};
  for (Eigen::Vector2d& corner : grid.corners) corner += Eigen::Vector2d(part.x, part.y);
  return grid;
}

// Returns the grids that the first two finders see.
std::vector<SeenGrid> GridsSeen(const cv::Mat& grey, const cv::Rect& part) {
  std::vector<SeenGrid> grids;
  for (const int flags : kFlagsOfFinders) {
    if (std::optional<SeenGrid> grid = GridSeen(grey, part, flags)) grids.push_back(std::move(*grid));
  }
  return grids;
}

// Returns whether the squares around the chessboard whose inner corners are a grid have one colour, as paper, or a
// table around it, has. In a random pattern of squares, small chessboards occur.
bool HasPaperAround(const cv::Mat& grey, const SeenGrid& grid) {
  std::vector<Eigen::Vector2d> places;
  for (int row = 0; row < grid.size.height; ++row) {
    for (int column = 0; column < grid.size.width; ++column) places.emplace_back(column, row);
  }
  const std::optional<Eigen::Matrix3d> image_from_grid = FitHomography(places, grid.corners);
  if (!image_from_grid) return false;
  std::vector<double> inside;
  std::vector<double> around;
  for (int row = -2; row <= grid.size.height; ++row) {
    for (int column = -2; column <= grid.size.width; ++column) {
      const Eigen::Vector2d at_px = ApplyHomography(*image_from_grid, {column + 0.5, row + 0.5});
      const cv::Point at(static_cast<int>(std::lround(at_px.x())), static_cast<int>(std::lround(at_px.y())));
      if (!cv::Rect({}, grey.size()).contains(at)) continue;
      const bool is_around = row == -2 || row == grid.size.height || column == -2 || column == grid.size.width;
      (is_around ? around : inside).push_back(grey.at<uchar>(at));
    }
  }
  const auto [black, white] = std::minmax_element(inside.begin(), inside.end());
  const double middle = 0.5 * (*black + *white);
  const auto num_white = std::count_if(around.begin(), around.end(), [&](double level) { return level > middle; });
  const double share = static_cast<double>(num_white) / static_cast<double>(std::max<size_t>(1, around.size()));
  constexpr double kMostOfOther = 0.25;
  return std::min(share, 1 - share) <= kMostOfOther;
}

// Returns the image without the bright dots of a projector that cover it; nothing if it has none.
std::optional<cv::Mat> WithoutSpeckle(const cv::Mat& grey) {
  constexpr int kLargeSidePx = 1500;
  constexpr double kDotGrey = 25;
  constexpr double kLeastShare = 0.03;
  constexpr int kBandPx = 128;
  const int kernel_px = std::max(grey.cols, grey.rows) > kLargeSidePx ? 7 : 5;
  cv::Mat median;
  // The dots are everywhere, so a band of rows shows whether there are any.
  const int num_rows = std::min(kBandPx, grey.rows);
  const cv::Mat band = grey.rowRange((grey.rows - num_rows) / 2, (grey.rows + num_rows) / 2);
  cv::medianBlur(band, median, kernel_px);
  cv::Mat above;
  cv::subtract(band, median, above);  // Zero where the image is darker.
  const int num_dots = cv::countNonZero(above > kDotGrey);
  if (num_dots < kLeastShare * static_cast<double>(band.total())) return std::nullopt;
  cv::medianBlur(grey, median, kernel_px);
  return median;
}

class Chessboard final : public Target {
 public:
  Chessboard(int rows, int columns, double square_m) : rows_(rows), columns_(columns), square_m_(square_m) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        points_.push_back({row * columns_ + column, {column * square_m_, row * square_m_, 0}});
      }
    }
    drawing_.min_m = {-2 * square_m_, -2 * square_m_};
    drawing_.max_m = {(columns_ + 1) * square_m_, (rows_ + 1) * square_m_};
    for (int row = -1; row < rows_; ++row) {
      for (int column = -1; column < columns_; ++column) {
        if (!IsBlack(row, column)) continue;
        drawing_.AddRectangle(column * square_m_, row * square_m_, (column + 1) * square_m_, (row + 1) * square_m_, 0);
      }
    }
    inverted_ = drawing_;
    inverted_.ground = 0;
    for (Shape& shape : inverted_.shapes) shape.albedo = 1;
  }

  std::string_view type() const override { return "chessboard"; }
  const std::vector<TargetPoint>& points() const override { return points_; }

  Detection Detect(const cv::Mat& grey) const override {
    constexpr int kMinSidePx = 16;  // OpenCV's finders throw on smaller images.
    if (std::min(grey.cols, grey.rows) < kMinSidePx) {
      Detection none;
      none.reason = "the image is too small";
      return none;
    }
    Found first = FindIn(grey);
    if (first.num_measured == points_.size()) return first.detection;
    // The dots of a projector hide corners; their median does not.
    const std::optional<cv::Mat> without_dots = WithoutSpeckle(grey);
    if (!without_dots) return first.detection;
    Found again = FindIn(*without_dots);
    Detection second = std::move(again.num_measured >= first.num_measured ? again.detection : first.detection);
    second.reason = "bright dots cover the image: switch the infrared projector off" +
                    (second.reason.empty() ? "" : "; " + second.reason);
    return second;
  }

  // Returns the size of any chessboard that is seen: chessboards are miscounted in more ways than can be tried.
  std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& grey) const override {
    std::vector<TargetSettings> confusions;
    for (const SeenGrid& grid : GridsSeen(grey, cv::Rect({}, grey.size()))) {
      const cv::Size& size = grid.size;
      // The longer side is that of the config.
      const bool is_alike = (size.width >= size.height) == (columns_ >= rows_);
      confusions.push_back(is_alike ? RowsAndColumns(size.height, size.width)
                                    : RowsAndColumns(size.width, size.height));
    }
    return confusions;
  }
  const Drawing& Draw() const override { return drawing_; }
  TargetSettings UnitLengths() const override { return {{"square", UnitLength(1, 1)}}; }
  // Returns the size of the chessboard that a grid is a part of, up to about this one's.
  cv::Size SizeAround(const cv::Mat& grey, const SeenGrid& grid) const {
    const LatticeExtent extent = ExtentOf(LatticeOf(grey, grid));
    return {extent.columns, extent.rows};
  }

  std::vector<Rigid3d> Symmetries() const override {
    std::vector<Rigid3d> symmetries;
    for (const Rigid3d& symmetry : PlaneSymmetries(points_)) {
      // A rotation is a symmetry if it maps the black square beside the origin to a black square.
      const Eigen::Vector3d moved = symmetry * Eigen::Vector3d(0.5 * square_m_, 0.5 * square_m_, 0);
      const auto cell = [&](double x_m) { return static_cast<int>(std::floor(x_m / square_m_)); };
      if (IsBlack(cell(moved.y()), cell(moved.x()))) symmetries.push_back(symmetry);
    }
    return symmetries;
  }

  // Adds a column if rows and columns have an even sum: with an odd sum, a rotation by 180 degrees exchanges the
  // colours.
  TargetSettings WithoutSymmetry() const override {
    if ((rows_ + columns_) % 2 != 0) return {};
    return {{"columns", std::to_string(columns_ + 1)}};
  }

 private:
  // The largest share of deviating grey values of a visible corner: smaller shares are left to Huber's loss.
  static constexpr double kMaxCovered = 0.05;
  // Sigma of a refined saddle at which no pattern can be fitted.
  static constexpr double kSaddleSigmaPx = 0.15;

  struct Found {
    Detection detection;
    size_t num_measured = 0;  // The corners at which the pattern fit succeeds.
  };

  // Detects the chessboard in an image as it is.
  Found FindIn(const cv::Mat& grey) const {
    Found found;
    const auto [corners, may_be_in] = FindCorners(grey);
    if (corners) {
      const Drawing& seen = ColourScore(grey, *corners) < 0 ? inverted_ : drawing_;
      std::vector<std::optional<MeasuredCorner>> measured;
      for (const TargetPoint& point : points_) measured.push_back(Measure(grey, *corners, seen, point));
      std::vector<std::optional<MeasuredCorner>> all;
      for (const TargetPoint& point : points_) {
        const auto place = static_cast<size_t>(point.id);
        std::optional<MeasuredCorner>& corner = all.emplace_back(measured[place]);
        found.num_measured += corner ? 1 : 0;
        if (!corner) {
          corner = MeasureAnyhow(grey, (*corners)[place], seen, point, PredictedByNeighbours(measured, point));
        }
      }
      found.detection = DetectionOf(all);
      return found;
    }
    Detection& detection = found.detection;
    if (!may_be_in.empty()) detection = DetectPartly(grey, may_be_in);
    found.num_measured = detection.ids.size();
    if (!detection.ids.empty()) return found;
    detection.reason = "no chessboard of " + std::to_string(rows_) + " x " + std::to_string(columns_) +
                       " inner corners found; it must be visible with a light rim" + detection.reason;
    return found;
  }

  // The measured corners around a corner say that it is here.
  struct Prediction {
    Eigen::Matrix3d image_from_board;
    Eigen::Vector2d pixel;
    double side_px;

    // Returns whether a corner is where it may be: the lens bends the lattice by less within seven corners.
    bool IsMet(const Eigen::Vector2d& corner_px) const {
      constexpr double kMostPx = 1;
      constexpr double kMostShare = 0.02;
      return (corner_px - pixel).norm() <= std::max(kMostPx, kMostShare * side_px);
    }
  };

  // Predicts a corner by the homography of the measured ones up to three rows and columns away; nothing if they are
  // few.
  std::optional<Prediction> PredictedByNeighbours(const std::vector<std::optional<MeasuredCorner>>& measured,
                                                  const TargetPoint& point) const {
    constexpr int kReach = 3;
    constexpr size_t kFewest = 6;
    const int row = point.id / columns_;
    const int column = point.id % columns_;
    std::vector<Eigen::Vector2d> places_m;
    std::vector<Eigen::Vector2d> pixels;
    for (int r = std::max(0, row - kReach); r <= std::min(rows_ - 1, row + kReach); ++r) {
      for (int c = std::max(0, column - kReach); c <= std::min(columns_ - 1, column + kReach); ++c) {
        const std::optional<MeasuredCorner>& other = measured[Index(r, c)];
        if (!other) continue;
        places_m.emplace_back(points_[Index(r, c)].in_target.head<2>());
        pixels.push_back(other->pixel);
      }
    }
    if (places_m.size() < kFewest) return std::nullopt;
    const std::optional<Eigen::Matrix3d> map = FitHomography(places_m, pixels);
    if (!map) return std::nullopt;
    const Eigen::Vector2d at_m = point.in_target.head<2>();
    const Eigen::Vector2d pixel = ApplyHomography(*map, at_m);
    return Prediction{*map, pixel, (ApplyHomography(*map, at_m + Eigen::Vector2d(square_m_, 0)) - pixel).norm()};
  }

  // Measures a corner by the grey values within a few pixels of where the corners around it predict it: near the edge
  // of a shadow, only these look as drawn. Returns nothing if they do not.
  std::optional<MeasuredCorner> MeasurePredicted(const cv::Mat& grey, const Drawing& drawing, const TargetPoint& point,
                                                 const Prediction& predicted) const {
    constexpr double kFewPx = 7;
    constexpr double kManyPx = 20;
    for (const double half_px : {kFewPx, kManyPx}) {
      const double half_m = std::min(0.5, half_px / predicted.side_px) * square_m_;
      const std::optional<MeasuredCorner> corner =
          MeasureCorner(grey, drawing, point.in_target.head<2>(), half_m, predicted.image_from_board, predicted.pixel);
      if (!corner || corner->outlier_share > kMaxCovered || !predicted.IsMet(corner->pixel)) continue;
      // A few grey values beside what covers a corner fit almost anywhere.
      if (corner->covariance_px2.trace() <= 2 * kSaddleSigmaPx * kSaddleSigmaPx) return corner;
    }
    return std::nullopt;
  }

  // Measures a corner of a chessboard that is seen completely, at which the pattern fit fails. If it fails in a small
  // window too, the refined saddle is the corner, with a sigma that gives it little weight. Returns nothing if the
  // corners around it contradict that: the edge of a shadow, or a dot, was taken for a corner.
  std::optional<MeasuredCorner> MeasureAnyhow(const cv::Mat& grey, const Eigen::Vector2d& saddle_px,
                                              const Drawing& drawing, const TargetPoint& point,
                                              const std::optional<Prediction>& predicted) const {
    if (predicted) {
      const std::optional<MeasuredCorner> corner = MeasurePredicted(grey, drawing, point, *predicted);
      if (corner) return corner;
    }
    const Eigen::Matrix2d covariance_px2 = kSaddleSigmaPx * kSaddleSigmaPx * Eigen::Matrix2d::Identity();
    if (!predicted || predicted->IsMet(saddle_px)) return MeasuredCorner{saddle_px, covariance_px2};
    constexpr double kMostMovePx = 2;
    for (const double window_ratio : {0.75, 0.4, 0.2}) {
      const std::optional<Eigen::Vector2d> again_px =
          RefineCorner(grey, predicted->pixel, window_ratio * predicted->side_px, kMostMovePx);
      if (again_px && predicted->IsMet(*again_px)) return MeasuredCorner{*again_px, covariance_px2};
    }
    return std::nullopt;
  }

  struct FoundCorners {
    std::optional<Corners> corners;
    // The region that may contain the chessboard although it is not seen completely; empty if there is none.
    cv::Rect may_be_in;
  };
  // Finds all corners and refines them.
  FoundCorners FindCorners(const cv::Mat& grey) const {
    const cv::Size size(columns_, rows_);
    cv::Rect may_be_in;
    for (const double scale : ScalesOf(grey)) {
      const SaddleGrid grid = FindSaddleGrid(Resized(grey, scale), size);
      if (std::optional<Corners> corners = Accepted(grey, grid.corners, scale, {0, 0})) return {std::move(corners), {}};
      if (may_be_in.empty() && !grid.may_be_in.empty()) {
        const cv::Rect& in = grid.may_be_in;
        const cv::Point first(cvFloor(in.x / scale), cvFloor(in.y / scale));
        const cv::Point last(cvCeil(in.br().x / scale), cvCeil(in.br().y / scale));
        may_be_in = cv::Rect(first, last) & cv::Rect(0, 0, grey.cols, grey.rows);
      }
    }
    constexpr int kMinSidePx = 16;
    if (std::min(may_be_in.width, may_be_in.height) < kMinSidePx) return {};
    for (const Finder& finder : kFinders) {
      const cv::Mat part = grey(may_be_in);
      const double scale = ScaleOf(grey, finder.max_side_px, finder.min_side_px);
      std::vector<cv::Point2f> found;
      if (!cv::findChessboardCornersSB(Resized(part, scale), size, found, finder.flags)) continue;
      if (std::optional<Corners> corners = Accepted(grey, found, scale, may_be_in.tl()))
        return {std::move(corners), {}};
    }
    return {std::nullopt, may_be_in};
  }

  // Returns the detection of the corners that were measured, which are listed by id.
  static Detection DetectionOf(const std::vector<std::optional<MeasuredCorner>>& corners) {
    Detection detection;
    for (size_t id = 0; id < corners.size(); ++id) {
      if (!corners[id]) continue;
      detection.ids.push_back(static_cast<int>(id));
      detection.pixels.push_back(corners[id]->pixel);
      detection.covariances_px2.emplace_back(corners[id]->covariance_px2);
    }
    return detection;
  }

  // Measures the corners of a partly covered chessboard from a part of its grid, which lies in `may_be_in`. The
  // visible corners must reach from the first to the last row and column, since their ids are ambiguous otherwise;
  // `reason` then continues the sentence "no board found".
  Detection DetectPartly(const cv::Mat& grey, const cv::Rect& may_be_in) const {
    Detection none;
    for (const SeenGrid& grid : GridsSeen(grey, may_be_in)) {
      const CornerLattice lattice = LatticeOf(grey, grid);
      const std::optional<Corners> corners = Complete(grey, lattice);
      if (!corners) {
        const LatticeExtent extent = ExtentOf(lattice);
        none.reason = "; the rows and columns of the " + std::to_string(extent.rows) + " x " +
                      std::to_string(extent.columns) + " visible corners are ambiguous";
        continue;
      }
      Detection visible = MeasureVisible(grey, *corners);
      if (!ReachesAllSides(visible.ids)) {
        none.reason = "; too many outer corners are covered to identify rows and columns";
        continue;
      }
      if (visible.ids.size() < points_.size()) {
        visible.reason = std::to_string(points_.size() - visible.ids.size()) + " corners are covered";
      }
      return visible;
    }
    return none;
  }

  // Grows the lattice of all corners that belong to a grid.
  CornerLattice LatticeOf(const cv::Mat& grey, const SeenGrid& grid) const {
    CornerLattice start;
    for (size_t i = 0; i < grid.corners.size(); ++i) {
      const int index = static_cast<int>(i);
      start[{index / grid.size.width, index % grid.size.width}] = grid.corners[i];
    }
    CornerLattice best;
    for (const bool is_first_black : {true, false}) {
      // One row or column more than the target has indicates a different chessboard.
      const CornerLattice lattice =
          GrowLattice(start, std::max(rows_, columns_) + 1, [&](const LatticePlace& place, const Eigen::Matrix3d& map) {
            return FindInLattice(grey, is_first_black == IsBlack(place.row, place.column), place, map);
          });
      if (lattice.size() > best.size()) best = lattice;
    }
    return best;
  }

  // Finds a corner of the lattice near its predicted position. `is_black` is the colour of the square above and to
  // the left of the corner.
  static std::optional<Eigen::Vector2d> FindInLattice(const cv::Mat& grey, bool is_black, const LatticePlace& place,
                                                      const Eigen::Matrix3d& image_from_lattice) {
    constexpr double kWindowRatio = 0.75;
    constexpr double kMinContrastGrey = 8;
    const Eigen::Vector2d at(place.column, place.row);
    const Eigen::Vector2d predicted_px = ApplyHomography(image_from_lattice, at);
    const Eigen::Vector2d side_px = ApplyHomography(image_from_lattice, at + Eigen::Vector2d(1, 0)) - predicted_px;
    const Eigen::Vector2d other_px = ApplyHomography(image_from_lattice, at + Eigen::Vector2d(0, 1)) - predicted_px;
    const double area_px2 = std::abs(side_px.x() * other_px.y() - side_px.y() * other_px.x());
    const double reach_px = area_px2 / std::max({side_px.norm(), other_px.norm(), 1e-9});
    const std::optional<Eigen::Vector2d> corner_px =
        RefineCorner(grey, predicted_px, kWindowRatio * reach_px, std::max(2.0, 0.3 * reach_px));
    if (!corner_px) return std::nullopt;
    double black_max = 0;
    double white_min = 255;
    for (const double share : {0.2, 0.35}) {
      for (const int down : {-1, 1}) {
        for (const int across : {-1, 1}) {
          const Eigen::Vector2d at_px = *corner_px + share * (across * side_px + down * other_px);
          const cv::Point pixel(static_cast<int>(std::lround(at_px.x())), static_cast<int>(std::lround(at_px.y())));
          if (pixel.x < 0 || pixel.y < 0 || pixel.x >= grey.cols || pixel.y >= grey.rows) return std::nullopt;
          const double level = grey.at<uchar>(pixel);
          if ((down == across) == is_black) {
            black_max = std::max(black_max, level);
          } else {
            white_min = std::min(white_min, level);
          }
        }
      }
    }
    if (white_min - black_max < kMinContrastGrey) return std::nullopt;
    return corner_px;
  }

  // Returns all corners in the target's order, the covered ones as predicted by their neighbours; nothing if the
  // lattice is smaller or larger than the target.
  std::optional<Corners> Complete(const cv::Mat& grey, const CornerLattice& lattice) const {
    const LatticeExtent extent = ExtentOf(lattice);
    const bool is_upright = extent.rows == rows_ && extent.columns == columns_;
    if (!is_upright && !(extent.rows == columns_ && extent.columns == rows_)) return std::nullopt;
    Corners corners;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const LatticePlace place{extent.first.row + (is_upright ? row : column),
                                 extent.first.column + (is_upright ? column : row)};
        const auto seen = lattice.find(place);
        if (seen != lattice.end()) {
          corners.push_back(seen->second);
          continue;
        }
        const std::optional<Eigen::Matrix3d> map = MapNear(lattice, place);
        if (!map) return std::nullopt;
        corners.push_back(ApplyHomography(*map, {place.column, place.row}));
      }
    }
    return Arranged(grey, std::move(corners));
  }

  Detection MeasureVisible(const cv::Mat& grey, const Corners& corners) const {
    const bool inverted = ColourScore(grey, corners) < 0;
    const Drawing& drawing = inverted ? inverted_ : drawing_;
    std::vector<std::optional<MeasuredCorner>> measured;
    for (const TargetPoint& point : points_) {
      std::optional<MeasuredCorner>& corner = measured.emplace_back();
      if (!IsSaddle(grey, corners, point.id / columns_, point.id % columns_, 0.2, inverted)) continue;
      corner = Measure(grey, corners, drawing, point);
      if (corner && corner->outlier_share > kMaxCovered) corner.reset();
    }
    std::vector<std::optional<MeasuredCorner>> all;
    for (const TargetPoint& point : points_) {
      std::optional<MeasuredCorner>& corner = all.emplace_back(measured[static_cast<size_t>(point.id)]);
      if (!corner && IsSaddle(grey, corners, point.id / columns_, point.id % columns_, 0.2, inverted)) {
        const std::optional<Prediction> predicted = PredictedByNeighbours(measured, point);
        if (predicted) corner = MeasurePredicted(grey, drawing, point, *predicted);
      }
    }
    return DetectionOf(all);
  }

  // Returns whether `ids` include enough corners of every outer row and column, and at least half of all.
  bool ReachesAllSides(const std::vector<int>& ids) const {
    int num_top = 0;
    int num_bottom = 0;
    int num_left = 0;
    int num_right = 0;
    for (const int id : ids) {
      num_top += id / columns_ == 0 ? 1 : 0;
      num_bottom += id / columns_ == rows_ - 1 ? 1 : 0;
      num_left += id % columns_ == 0 ? 1 : 0;
      num_right += id % columns_ == columns_ - 1 ? 1 : 0;
    }
    // A single corner may be something else.
    const auto is_enough = [](int num, int of) { return num >= std::max(2, of / 3); };
    return is_enough(num_top, columns_) && is_enough(num_bottom, columns_) && is_enough(num_left, rows_) &&
           is_enough(num_right, rows_) && 2 * ids.size() >= points_.size();
  }

  // Returns the corners that were found in a resized part of the image, in the target's order and refined, if they
  // are the target's. `first_px` is the first pixel of the part.
  std::optional<Corners> Accepted(const cv::Mat& grey, const std::vector<cv::Point2f>& found, double scale,
                                  const cv::Point& first_px) const {
    if (found.size() != points_.size()) return std::nullopt;
    Corners corners = FromOpenCv(found, scale);
    for (Eigen::Vector2d& corner : corners) corner += Eigen::Vector2d(first_px.x, first_px.y);
    corners = Refined(grey, Arranged(grey, std::move(corners)));
    if (!IsBoard(grey, corners)) return std::nullopt;
    return corners;
  }

  // Returns the colour of the square between the corners (row, column) and (row + 1, column + 1).
  static bool IsBlack(int row, int column) { return ((row + column) & 1) == 0; }

  size_t Index(int row, int column) const { return static_cast<size_t>(row * columns_ + column); }

  // Returns the mean grey value at points in the middle of an inner square, which are interpolated bilinearly between
  // its corners.
  double SquareGrey(const cv::Mat& grey, const Corners& corners, int row, int column) const {
    double sum = 0;
    int count = 0;
    for (const double s : {0.35, 0.5, 0.65}) {
      for (const double t : {0.35, 0.5, 0.65}) {
        const Eigen::Vector2d p =
            (1 - s) * ((1 - t) * corners[Index(row, column)] + t * corners[Index(row, column + 1)]) +
            s * ((1 - t) * corners[Index(row + 1, column)] + t * corners[Index(row + 1, column + 1)]);
        const cv::Point at(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
        if (at.x < 0 || at.y < 0 || at.x >= grey.cols || at.y >= grey.rows) continue;
        sum += grey.at<uchar>(at);
        ++count;
      }
    }
    return count > 0 ? sum / count : 0;
  }

  // Returns the sum of the white minus that of the black squares: positive if the order fits the colours.
  double ColourScore(const cv::Mat& grey, const Corners& corners) const {
    double score = 0;
    for (int row = 0; row + 1 < rows_; ++row) {
      for (int column = 0; column + 1 < columns_; ++column) {
        score += (IsBlack(row, column) ? -1 : 1) * SquareGrey(grey, corners, row, column);
      }
    }
    return score;
  }

  // Returns the corners in the target's order: seen from the front, with the black squares at their positions.
  Corners Arranged(const cv::Mat& grey, Corners corners) const {
    std::vector<Eigen::Vector2d> places_m;
    for (const TargetPoint& point : points_) places_m.emplace_back(point.in_target.head<2>());
    if (!SeenFromFront(places_m, corners, false)) {
      for (int row = 0; row < rows_; ++row) {
        const auto begin = corners.begin() + row * columns_;
        std::reverse(begin, begin + columns_);
      }
    }
    if (ColourScore(grey, corners) >= 0) return corners;
    // A rotation by 180 degrees exchanges the colours if one side is odd and the other even, one by 90 degrees if the
    // sides are equal.
    if (rows_ != columns_) {
      std::reverse(corners.begin(), corners.end());
      return corners;
    }
    Corners turned;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) turned.push_back(corners[Index(columns_ - 1 - column, row)]);
    }
    return turned;
  }

  // Returns whether the corners form a chessboard: they are spaced evenly, and the four quadrants around each are
  // black and white as drawn, both close to it and farther away. A rim narrower than a square, with something dark
  // behind it, looks like one more row only from farther away.
  bool IsBoard(const cv::Mat& grey, const Corners& corners) const {
    // If a rotation by 180 degrees keeps the colours, chessboards are printed with the first square black or white.
    const bool inverted = ColourScore(grey, corners) < 0;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        if (!IsEven(corners, row, column)) return false;
        for (const double share : {0.2, 0.35}) {
          if (!IsSaddle(grey, corners, row, column, share, inverted)) return false;
        }
      }
    }
    return true;
  }

  // Returns whether a corner is nearly half way between the previous and the next one.
  bool IsEven(const Corners& corners, int row, int column) const {
    constexpr double kMaxUnevenness = 0.35;  // Ratio to the spacing; allows for perspective and lens.
    const auto is_even = [&](const Eigen::Vector2d& before, const Eigen::Vector2d& here,
                             const Eigen::Vector2d& behind) {
      const double step_px = std::min((here - before).norm(), (behind - here).norm());
      return (before - 2 * here + behind).norm() <= kMaxUnevenness * step_px + 1;
    };
    const Eigen::Vector2d& here = corners[Index(row, column)];
    const bool along = column == 0 || column + 1 == columns_ ||
                       is_even(corners[Index(row, column - 1)], here, corners[Index(row, column + 1)]);
    const bool across =
        row == 0 || row + 1 == rows_ || is_even(corners[Index(row - 1, column)], here, corners[Index(row + 1, column)]);
    return along && across;
  }

  // Returns whether the four quadrants around a corner have their colours, at `share` of a square along both of its
  // sides.
  bool IsSaddle(const cv::Mat& grey, const Corners& corners, int row, int column, double share, bool inverted) const {
    const Eigen::Vector2d& here = corners[Index(row, column)];
    // The step along a row or a column to the next corner; at the rim, the step from the opposite one.
    const auto step = [&](int down, int across) -> Eigen::Vector2d {
      const int r = row + down;
      const int c = column + across;
      if (r >= 0 && c >= 0 && r < rows_ && c < columns_) return corners[Index(r, c)] - here;
      return here - corners[Index(row - down, column - across)];
    };
    double black_max = 0;
    double white_min = 255;
    for (const int down : {-1, 1}) {
      for (const int across : {-1, 1}) {
        const Eigen::Vector2d at_px = here + share * (step(down, 0) + step(0, across));
        const cv::Point at(static_cast<int>(std::lround(at_px.x())), static_cast<int>(std::lround(at_px.y())));
        if (at.x < 0 || at.y < 0 || at.x >= grey.cols || at.y >= grey.rows) continue;
        const double level = grey.at<uchar>(at);
        if (IsBlack(row + (down - 1) / 2, column + (across - 1) / 2) != inverted) {
          black_max = std::max(black_max, level);
        } else {
          white_min = std::min(white_min, level);
        }
      }
    }
    return black_max < white_min;
  }

  // Returns the corners moved to their saddles, except those too near to the next line or to the border of the image.
  Corners Refined(const cv::Mat& grey, const Corners& start) const {
    // The window nearly reaches the next lines: these have little weight in it, and a large window reduces the noise.
    constexpr double kWindowRatio = 0.75;
    Corners refined;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const Eigen::Vector2d& here = start[Index(row, column)];
        const double reach_px = ReachPx(start, row, column);
        refined.push_back(
            RefineCorner(grey, here, kWindowRatio * reach_px, std::max(2.0, 0.3 * reach_px)).value_or(here));
      }
    }
    return refined;
  }

  // Measures a corner by all grey values that are nearer to it than to other corners.
  std::optional<MeasuredCorner> Measure(const cv::Mat& grey, const Corners& corners, const Drawing& drawing,
                                        const TargetPoint& point) const {
    const int row = point.id / columns_;
    const int column = point.id % columns_;
    const Eigen::Vector2d at_m = point.in_target.head<2>();
    const double half_m = 0.5 * square_m_;
    std::vector<Eigen::Vector2d> near_m;
    std::vector<Eigen::Vector2d> near_px;
    const int first_row = std::clamp(row - 1, 0, rows_ - kMinSide);
    const int first_column = std::clamp(column - 1, 0, columns_ - kMinSide);
    for (int r = first_row; r < first_row + kMinSide; ++r) {
      for (int c = first_column; c < first_column + kMinSide; ++c) {
        near_m.emplace_back(points_[Index(r, c)].in_target.head<2>());
        near_px.push_back(corners[Index(r, c)]);
      }
    }
    const Eigen::Vector2d& here_px = corners[Index(row, column)];
    const std::optional<Eigen::Matrix3d> image_from_board = FitHomography(near_m, near_px);
    if (!image_from_board) return std::nullopt;
    std::vector<Eigen::Vector2d> offsets;
    std::vector<Eigen::Vector2d> residuals_px;
    for (size_t k = 0; k < near_m.size(); ++k) {
      offsets.emplace_back((near_m[k] - at_m) / half_m);
      residuals_px.emplace_back(near_px[k] - ApplyHomography(*image_from_board, near_m[k]));
    }
    return MeasureCorner(grey, drawing, at_m, half_m, *image_from_board, here_px, BendOf(offsets, residuals_px));
  }

  // Returns the distance of a corner from the next lines of the chessboard.
  double ReachPx(const Corners& corners, int row, int column) const {
    const Eigen::Vector2d& here = corners[Index(row, column)];
    double reach_px = std::numeric_limits<double>::infinity();
    for (const int down : {-1, 1}) {
      for (const int across : {-1, 1}) {
        if (row + down < 0 || row + down >= rows_ || column + across < 0 || column + across >= columns_) continue;
        const Eigen::Vector2d side = corners[Index(row + down, column)] - here;
        const Eigen::Vector2d other = corners[Index(row, column + across)] - here;
        const double area = std::abs(side.x() * other.y() - side.y() * other.x());
        reach_px = std::min(reach_px, area / std::max({side.norm(), other.norm(), 1e-9}));
      }
    }
    return reach_px;
  }

  int rows_;
  int columns_;
  double square_m_;
  std::vector<TargetPoint> points_;
  Drawing drawing_;
  Drawing inverted_;  // Exchanged colours, for prints whose first square is white although rows + columns is even.
};

}  // namespace

std::unique_ptr<Target> CreateTarget_chessboard(MapReader& reader) {
  constexpr IntRange kCorners = {kMinSide, 100};
  const int rows = reader.Int("rows", kCorners);
  const int columns = reader.Int("columns", kCorners);
  const double square_m = reader.PositiveLength("square");
  return std::make_unique<Chessboard>(rows, columns, square_m);
}

std::vector<TargetSettings> ProposeTargets_chessboard(const cv::Mat& grey) {
  constexpr int kMostCorners = 40;
  const Chessboard largest(kMostCorners, kMostCorners, 1);
  std::vector<TargetSettings> proposals;
  const auto propose = [&](const SeenGrid& grid) {
    constexpr int kFewCorners = 20;
    if (grid.size.area() <= kFewCorners && !HasPaperAround(grey, grid)) return;
    for (const cv::Size& size : {grid.size, largest.SizeAround(grey, grid)}) {
      if (std::min(size.width, size.height) < kMinSide) continue;
      TargetSettings proposal = RowsAndColumns(std::min(size.width, size.height), std::max(size.width, size.height));
      proposal.emplace_back("square", UnitLength(1, 1));
      if (std::find(proposals.begin(), proposals.end(), proposal) == proposals.end()) proposals.push_back(proposal);
    }
  };
  size_t num_seen = 0;
  for (const double scale : ScalesOf(grey)) {
    const AnySaddleGrid grid = FindLargestSaddleGrid(Resized(grey, scale));
    num_seen = std::max(num_seen, grid.num_seen);
    if (!grid.corners.empty()) propose({grid.size, FromOpenCv(grid.corners, scale)});
    if (!proposals.empty()) return proposals;
  }
  // OpenCV's finders, which take far longer, find more only where the saddles show something.
  if (num_seen == 0) return proposals;
  bool is_any_seen = false;
  // Small squares need more pixels.
  constexpr double kFineSidePx = 1920;
  for (const double max_side_px : {kFinders[0].max_side_px, kFineSidePx}) {
    const bool is_needed = max_side_px != kFineSidePx || std::max(grey.cols, grey.rows) > kFinders[0].max_side_px;
    if (!is_needed || is_any_seen) break;
    for (const int flags : kFlagsOfFinders) {
      const std::optional<SeenGrid> grid = GridSeen(grey, cv::Rect({}, grey.size()), flags, max_side_px);
      is_any_seen |= grid.has_value();
      if (grid) propose(*grid);
      if (!proposals.empty()) return proposals;
    }
  }
  return proposals;
}

}  // namespace heba
