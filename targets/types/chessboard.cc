// A plain chessboard, by its inner corners. Frame: origin at the first inner corner, x to the right along the columns,
// y down, z into the sheet; the square up and left of the origin is black (or, on a board whose corners have an even
// number of rows and columns together, white). id = row * columns + column.
//
// A grid of saddles tells where the corners are (saddle_grid.h) or, where that is incomplete, OpenCV's finders; every
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
#include "targets/saddle_grid.h"
#include "targets/target.h"

namespace heba {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

// From a picture that was resized by `scale`: the outer edges of the first pixels meet, not their centres.
Corners FromOpenCv(const std::vector<cv::Point2f>& corners, double scale) {
  const Eigen::Vector2d half(0.5, 0.5);
  Corners pixels;
  for (const cv::Point2f& corner : corners) {
    pixels.emplace_back((Eigen::Vector2d(corner.x, corner.y) + half) / scale - half);
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

// Coarse to fine, for small boards enlarged, and last for boards that are out of focus. Saddles take a tenth of the
// time that OpenCV's finders take, whatever the picture shows.
struct Level {
  double max_side_px;  // As a finder's.
  double min_side_px;
};
constexpr Level kLevels[] = {{1000, 0}, {2000, 0}, {4000, 2000}, {500, 0}};

// Where the saddles show much of a board, but not all of it, in this order: the contrast as it is, stretched for dark
// pictures, and small boards enlarged.
constexpr Finder kFinders[] = {
    {960, 0, &FindSectors},
    {960, 0, &FindSectorsNormalised},
    {2000, 1200, &FindSectorsNormalised},
};
constexpr double kMaxEnlargement = 3;

// Of the grids of corners in the picture, or of parts of them, in inner corners: what the first two finders see if
// any size is right.
std::vector<cv::Size> SizesSeen(const cv::Mat& grey) {
  const double scale = std::min(1.0, kFinders[0].max_side_px / std::max(grey.cols, grey.rows));
  cv::Mat picture;
  cv::resize(grey, picture, {}, scale, scale, cv::INTER_AREA);
  std::vector<cv::Size> sizes;
  for (const int flags : {0, static_cast<int>(cv::CALIB_CB_NORMALIZE_IMAGE)}) {
    constexpr int kLeastSide = 3;
    std::vector<cv::Point2f> corners;
    cv::Mat meta;
    const bool is_seen = cv::findChessboardCornersSB(picture, {kLeastSide, kLeastSide}, corners,
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
    if (const std::optional<Corners> corners = FindCorners(grey)) {
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
  TargetSettings UnitLengths() const override { return {{"square", UnitLength(1, 1)}}; }

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

  // A half turn exchanges the colours of a board whose numbers of rows and columns have an odd sum.
  TargetSettings WithoutSymmetry() const override {
    if ((rows_ + columns_) % 2 != 0) return {};
    return {{"columns", std::to_string(columns_ + 1)}};
  }

 private:
  std::optional<Corners> FindCorners(const cv::Mat& grey) const {
    const cv::Size size(columns_, rows_);
    cv::Rect may_be_in;
    double last_scale = 0;
    for (const Level& level : kLevels) {
      const double scale = ScaleOf(grey, level.max_side_px, level.min_side_px);
      constexpr double kAlike = 1.4;
      if (scale < kAlike * last_scale && last_scale < kAlike * scale) continue;
      last_scale = scale;
      const SaddleGrid grid = FindSaddleGrid(Resized(grey, scale), size);
      if (std::optional<Corners> corners = Accepted(grey, grid.corners, scale, {0, 0})) return corners;
      if (may_be_in.empty() && !grid.may_be_in.empty()) {
        const cv::Rect& in = grid.may_be_in;
        const cv::Point first(cvFloor(in.x / scale), cvFloor(in.y / scale));
        const cv::Point last(cvCeil(in.br().x / scale), cvCeil(in.br().y / scale));
        may_be_in = cv::Rect(first, last) & cv::Rect(0, 0, grey.cols, grey.rows);
      }
    }
    constexpr int kMinSidePx = 16;
    if (std::min(may_be_in.width, may_be_in.height) < kMinSidePx) return std::nullopt;
    for (const Finder& finder : kFinders) {
      const cv::Mat part = grey(may_be_in);
      const double scale = ScaleOf(grey, finder.max_side_px, finder.min_side_px);
      std::vector<cv::Point2f> found;
      if (!finder.find(Resized(part, scale), size, &found)) continue;
      if (std::optional<Corners> corners = Accepted(grey, found, scale, may_be_in.tl())) return corners;
    }
    return std::nullopt;
  }

  static double ScaleOf(const cv::Mat& grey, double max_side_px, double min_side_px) {
    const double side_px = std::max(grey.cols, grey.rows);
    return std::max(std::min(1.0, max_side_px / side_px), std::min(kMaxEnlargement, min_side_px / side_px));
  }
  static cv::Mat Resized(const cv::Mat& grey, double scale) {
    if (scale == 1) return grey;
    cv::Mat picture;
    cv::resize(grey, picture, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
    return picture;
  }

  // What was found in a resized part of the picture, in this board's order and refined, if it is one.
  std::optional<Corners> Accepted(const cv::Mat& grey, const std::vector<cv::Point2f>& found, double scale,
                                  const cv::Point& first_px) const {
    if (found.size() != points_.size()) return std::nullopt;
    Corners corners = FromOpenCv(found, scale);
    for (Eigen::Vector2d& corner : corners) corner += Eigen::Vector2d(first_px.x, first_px.y);
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
    std::vector<Eigen::Vector2d> near_m;
    std::vector<Eigen::Vector2d> near_px;
    for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
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
    return MeasureCorner(grey, drawing, point.in_target.head<2>(), 0.5 * square_m_, *picture_from_board, here_px)
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
  constexpr IntRange kCorners = {3, 100};  // OpenCV's finders need three a side.
  const int rows = reader.Int("rows", kCorners);
  const int columns = reader.Int("columns", kCorners);
  const double square_m = reader.PositiveLength("square");
  return std::make_unique<Chessboard>(rows, columns, square_m);
}

}  // namespace heba
