// A plain chessboard, by its inner corners. Frame: origin at the first inner corner, x to the right along the columns,
// y down, z into the sheet; the square up and left of the origin is black (or, on a board whose corners have an even
// number of rows and columns together, white). id = row * columns + column.
//
// OpenCV's finders, several of them since each misses boards that another finds, tell where the corners are; every
// corner is then refined as a saddle in the whole picture, and the board is believed only if it looks like one around
// every corner. Refining halves the error of the finders' own sub-pixel step: cv::calibrateCamera's RMS over recorded
// sets falls from 0.22, 0.21 and 0.07 px (findChessboardCornersSB with its ACCURACY) to 0.17, 0.08 and 0.05 px.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "targets/confusions.h"
#include "targets/corner_refinement.h"
#include "targets/homography.h"
#include "targets/target.h"

namespace heba {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

// From a picture that was resized by `scales` along x and y: the outer edges of the first pixels meet, not their
// centres.
Corners FromOpenCv(const std::vector<cv::Point2f>& corners, const Eigen::Vector2d& scales) {
  const Eigen::Vector2d half(0.5, 0.5);
  Corners pixels;
  for (const cv::Point2f& corner : corners) {
    pixels.emplace_back((Eigen::Vector2d(corner.x, corner.y) + half).cwiseQuotient(scales) - half);
  }
  return pixels;
}

// One way to find a board: all corners row by row in some order, or none.
struct Finder {
  // The larger side of the picture that is searched, at most and, by enlarging, at least.
  double max_side_px;
  double min_side_px;
  bool (*find)(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners);
};

bool FindSectors(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners) {
  return cv::findChessboardCornersSB(grey, size, *corners, 0);
}
bool FindSectorsNormalised(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners) {
  return cv::findChessboardCornersSB(grey, size, *corners, cv::CALIB_CB_NORMALIZE_IMAGE);
}
bool FindQuads(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners) {
  return cv::findChessboardCorners(grey, size, *corners, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE);
}

// Whether something in the picture has the contrast of a board. Linking quads takes minutes over a blank wall, whose
// noise it stretches to full contrast.
bool HasContrast(const cv::Mat& grey) {
  constexpr double kBlurPx = 1.5;
  constexpr double kMinContrastGrey = 8;
  constexpr int kMinPixels = 50;
  cv::Mat range;
  cv::GaussianBlur(grey, range, {}, kBlurPx);
  cv::morphologyEx(range, range, cv::MORPH_GRADIENT, cv::Mat::ones(7, 7, CV_8U));
  return cv::countNonZero(range > kMinContrastGrey) >= kMinPixels;
}

// In this order. The first two take as long for every picture: the contrast as it is, and stretched for dark pictures.
// Linking quads finds the smallest boards, but may take minutes on boards with round outer squares (OpenCV's radon
// boards), which the first one finds.
constexpr Finder kFinders[] = {
    {960, 0, &FindSectors},   {960, 0, &FindSectorsNormalised},
    {2000, 0, &FindQuads},    {2000, 1200, &FindSectorsNormalised},
    {3000, 3000, &FindQuads},
};
constexpr double kMaxEnlargement = 3;

// Inner corners: OpenCV's finders need as many.
constexpr int kMinSide = 3;

// Of the grids of corners in the picture, or of parts of them, in inner corners: what the first two finders see if
// any size is right.
std::vector<cv::Size> SizesSeen(const cv::Mat& grey) {
  const double scale = std::min(1.0, kFinders[0].max_side_px / std::max(grey.cols, grey.rows));
  cv::Mat picture;
  cv::resize(grey, picture, {}, scale, scale, cv::INTER_AREA);
  std::vector<cv::Size> sizes;
  for (const int flags : {0, static_cast<int>(cv::CALIB_CB_NORMALIZE_IMAGE)}) {
    std::vector<cv::Point2f> corners;
    cv::Mat meta;
    const bool is_seen = cv::findChessboardCornersSB(picture, {kMinSide, kMinSide}, corners,
                                                     flags | static_cast<int>(cv::CALIB_CB_LARGER), meta);
    if (is_seen) sizes.push_back(meta.size());
  }
  return sizes;
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
    Detection detection;
    constexpr int kMinSidePx = 16;  // OpenCV's finders throw on less.
    if (std::min(grey.cols, grey.rows) < kMinSidePx) {
      detection.reason = "the picture is too small";
      return detection;
    }
    const bool has_contrast = HasContrast(grey);
    std::optional<InVain> in_vain;
    for (const Finder& finder : kFinders) {
      if (!has_contrast) break;
      const bool is_quads = finder.find == &FindQuads;
      const bool is_enlarged = finder.min_side_px > 0;
      if (is_quads || is_enlarged) {
        if (!in_vain) in_vain = WhatIsInVain(grey);
        if ((is_quads && in_vain->quads) || (is_enlarged && in_vain->enlarged)) continue;
      }
      std::optional<Corners> corners = Find(grey, finder);
      if (!corners) continue;
      const Drawing& seen = ColourScore(grey, *corners) < 0 ? inverted_ : drawing_;
      for (const TargetPoint& point : points_) {
        const MeasuredCorner corner = Measure(grey, *corners, seen, point);
        detection.ids.push_back(point.id);
        detection.pixels.push_back(corner.pixel);
        detection.covariances_px2.emplace_back(corner.covariance_px2);
      }
      return detection;
    }
    detection.reason = "no board of " + std::to_string(rows_) + " x " + std::to_string(columns_) +
                       " inner corners found; it must be seen whole, with a light rim";
    return detection;
  }

  // The size of the board that is seen, whatever it is: boards are counted wrongly in more ways than can be tried.
  std::vector<TargetSettings> Confusions(const cv::Mat& grey) const override {
    std::vector<TargetSettings> confusions;
    for (const cv::Size& size : SizesSeen(grey)) {
      // Lying or standing as the config has it.
      const bool is_alike = (size.width >= size.height) == (columns_ >= rows_);
      confusions.push_back(is_alike ? RowsAndColumns(size.height, size.width)
                                    : RowsAndColumns(size.width, size.height));
    }
    return confusions;
  }
  const Drawing& Draw() const override { return drawing_; }

  std::vector<Rigid3d> Symmetries() const override {
    std::vector<Rigid3d> symmetries;
    for (const Rigid3d& symmetry : PlaneSymmetries(points_)) {
      // Where the middle of the black square beside the origin goes, there must be a black one.
      const Eigen::Vector3d moved = symmetry * Eigen::Vector3d(0.5 * square_m_, 0.5 * square_m_, 0);
      const auto cell = [&](double x_m) { return static_cast<int>(std::floor(x_m / square_m_)); };
      if (IsBlack(cell(moved.y()), cell(moved.x()))) symmetries.push_back(symmetry);
    }
    return symmetries;
  }

 private:
  // What is not worth looking for though this board has not been found: linking quads takes ten seconds for boards of
  // another size, a minute in an enlarged picture.
  struct InVain {
    bool quads = false;     // A board is seen that is larger than this one and its rim.
    bool enlarged = false;  // Or much of a board: it is large enough as it is.
  };
  InVain WhatIsInVain(const cv::Mat& grey) const {
    constexpr size_t kSmall = 30;  // The rim of a board of fewer corners is often taken for rows.
    constexpr double kMuch = 0.4;
    InVain in_vain;
    if (points_.size() < kSmall) return in_vain;
    const auto [short_side, long_side] = std::minmax(columns_, rows_);
    for (const cv::Size& size : SizesSeen(grey)) {
      const auto [seen_short, seen_long] = std::minmax(size.width, size.height);
      const int more_short = seen_short - short_side;
      const int more_long = seen_long - long_side;
      const bool may_be_this = more_short == 2 && more_long == 2;  // With its rim.
      const bool is_larger = !may_be_this && more_short >= 0 && more_long >= 0 && more_short + more_long > 0;
      in_vain.quads = in_vain.quads || is_larger;
      in_vain.enlarged = in_vain.enlarged || is_larger || size.area() > kMuch * static_cast<double>(points_.size());
    }
    return in_vain;
  }

  std::optional<Corners> Find(const cv::Mat& grey, const Finder& finder) const {
    const double side_px = std::max(grey.cols, grey.rows);
    const double scale =
        std::max(std::min(1.0, finder.max_side_px / side_px), std::min(kMaxEnlargement, finder.min_side_px / side_px));
    cv::Mat picture = grey;
    if (scale != 1) cv::resize(grey, picture, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
    std::vector<cv::Point2f> found;
    if (!finder.find(picture, cv::Size(columns_, rows_), &found) || found.size() != points_.size()) return std::nullopt;
    const Eigen::Vector2d scales(static_cast<double>(picture.cols) / grey.cols,
                                 static_cast<double>(picture.rows) / grey.rows);
    Corners corners = FromOpenCv(found, scales);
    Arrange(grey, &corners);
    Refine(grey, &corners);
    if (!IsBoard(grey, corners)) return std::nullopt;
    return corners;
  }

  // The square between corners (row, column) and (row + 1, column + 1).
  static bool IsBlack(int row, int column) { return ((row + column) & 1) == 0; }

  size_t Index(int row, int column) const { return static_cast<size_t>(row * columns_ + column); }

  // Mean grey of the middle of an inner square, bilinear between its corners.
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

  // Sum of white less black squares: positive if the order fits the colours.
  double ColourScore(const cv::Mat& grey, const Corners& corners) const {
    double score = 0;
    for (int row = 0; row + 1 < rows_; ++row) {
      for (int column = 0; column + 1 < columns_; ++column) {
        score += (IsBlack(row, column) ? -1 : 1) * SquareGrey(grey, corners, row, column);
      }
    }
    return score;
  }

  // Puts the corners into this board's order: seen from the front, and the black squares where they belong.
  void Arrange(const cv::Mat& grey, Corners* corners) const {
    std::vector<Eigen::Vector2d> places_m;
    for (const TargetPoint& point : points_) places_m.emplace_back(point.in_target.head<2>());
    if (!SeenFromFront(places_m, *corners, false)) {
      for (int row = 0; row < rows_; ++row) {
        const auto begin = corners->begin() + row * columns_;
        std::reverse(begin, begin + columns_);
      }
    }
    if (ColourScore(grey, *corners) >= 0) return;
    // Half a turn swaps the colours of a board with an odd and an even side, a quarter those of a square one.
    if (rows_ == columns_) {
      Corners turned(corners->size());
      for (int row = 0; row < rows_; ++row) {
        for (int column = 0; column < columns_; ++column) {
          turned[Index(row, column)] = (*corners)[Index(columns_ - 1 - column, row)];
        }
      }
      *corners = std::move(turned);
    } else {
      std::reverse(corners->begin(), corners->end());
    }
  }

  // Whether the corners are those of a board: spaced evenly, and the four quadrants around each black and white as on
  // the board, close to it and farther away. A rim narrower than a square, with something dark behind it, looks like
  // one more row from farther away only.
  bool IsBoard(const cv::Mat& grey, const Corners& corners) const {
    // Where half a turn keeps the colours, boards are printed with the first square black or white.
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

  // Whether a corner is nearly half way between those before and behind it.
  bool IsEven(const Corners& corners, int row, int column) const {
    constexpr double kMaxUnevenness = 0.35;  // Of the step: perspective and lens.
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

  // Whether the four quadrants around a corner have their colours, at `share` of a square along both of its sides.
  bool IsSaddle(const cv::Mat& grey, const Corners& corners, int row, int column, double share, bool inverted) const {
    const Eigen::Vector2d& here = corners[Index(row, column)];
    // A step along a row or a column, to a neighbour or away from it.
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

  // Puts the corners onto their saddles, those excepted that are too near to the next line or to the picture's rim.
  void Refine(const cv::Mat& grey, Corners* corners) const {
    // A window that nearly reaches the next lines: what it sees of them weighs little, and a large window is what
    // lowers the noise.
    constexpr double kWindowRatio = 0.75;
    const Corners start = *corners;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const Eigen::Vector2d& here = start[Index(row, column)];
        const double reach_px = ReachPx(start, row, column);
        (*corners)[Index(row, column)] =
            RefineCorner(grey, here, kWindowRatio * reach_px, std::max(2.0, 0.3 * reach_px)).value_or(here);
      }
    }
  }

  // By all grey values nearer to this corner than to others.
  MeasuredCorner Measure(const cv::Mat& grey, const Corners& corners, const Drawing& drawing,
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
    const std::optional<Eigen::Matrix3d> picture_from_board = FitHomography(near_m, near_px);
    if (!picture_from_board) return {here_px, Eigen::Matrix2d::Identity()};
    // What a window finds that did not see what is drawn: a guess that such a point counts for little.
    constexpr double kSaddleSigmaPx = 0.15;
    const MeasuredCorner saddle{here_px, kSaddleSigmaPx * kSaddleSigmaPx * Eigen::Matrix2d::Identity()};
    std::vector<Eigen::Vector2d> offsets;
    std::vector<Eigen::Vector2d> residuals_px;
    for (size_t k = 0; k < near_m.size(); ++k) {
      offsets.emplace_back((near_m[k] - at_m) / half_m);
      residuals_px.emplace_back(near_px[k] - Map(*picture_from_board, near_m[k]));
    }
    return MeasureCorner(grey, drawing, at_m, half_m, *picture_from_board, here_px, BendOf(offsets, residuals_px))
        .value_or(saddle);
  }

  // How far a corner is from the next lines of the board.
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
  Drawing inverted_;  // White squares on black, as boards are printed where half a turn keeps the colours.
};

}  // namespace

std::unique_ptr<Target> CreateTarget_chessboard(MapReader& reader) {
  constexpr IntRange kCorners = {kMinSide, 100};
  const int rows = reader.Int("rows", kCorners);
  const int columns = reader.Int("columns", kCorners);
  const double square_m = reader.PositiveLength("square");
  return std::make_unique<Chessboard>(rows, columns, square_m);
}

}  // namespace heba
