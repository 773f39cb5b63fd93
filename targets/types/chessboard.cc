// A plain chessboard, by its inner corners. Frame: origin at the first inner corner, x to the right along the columns, y
// down, z into the sheet; the square up and left of the origin is black (or, on a board whose corners have an even number
// of rows and columns together, white). id = row * columns + column.
//
// Corners come from OpenCV's finders, several of them, since each misses boards that another finds; what one gives is
// believed only if the quadrants around its corners alternate, and every corner is then refined as a saddle (RefineCorner).
#include <algorithm>
#include <cmath>
#include <limits>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "targets/corner_refinement.h"
#include "targets/target.h"

namespace heba {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

Corners FromOpenCv(const std::vector<cv::Point2f>& corners, double scale) {
  Corners pixels;
  // The centre of the first pixel stays the origin when pixels are split.
  for (const cv::Point2f& corner : corners) {
    pixels.emplace_back((corner.x + 0.5) / scale - 0.5, (corner.y + 0.5) / scale - 0.5);
  }
  return pixels;
}

// One way to find a board: all corners row by row in some order, or none.
struct Finder {
  double scale;  // The picture is enlarged by this.
  bool equalise;
  bool refine;
  bool (*find)(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners);
};

bool FindClassic(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners) {
  return cv::findChessboardCorners(
      grey, size, *corners, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
}
bool FindSectors(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners) {
  return cv::findChessboardCornersSB(grey, size, *corners, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY);
}
// Boards with dots in three squares (OpenCV's radon boards).
bool FindMarked(const cv::Mat& grey, cv::Size size, std::vector<cv::Point2f>* corners) {
  return cv::findChessboardCornersSB(grey, size, *corners,
                                     cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY | cv::CALIB_CB_MARKER);
}

// The fastest first.
constexpr Finder kFinders[] = {
    {1, false, false, &FindSectors}, {1, false, false, &FindMarked}, {1, false, true, &FindClassic},
    {2, false, true, &FindClassic}, {1, true, true, &FindClassic},   {2, false, false, &FindSectors},
};

class Chessboard final : public Target {
 public:
  Chessboard(int rows, int columns, double square_m) : rows_(rows), columns_(columns), square_m_(square_m) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        points_.push_back({row * columns_ + column, {column * square_m_, row * square_m_, 0}});
      }
    }
  }

  std::string_view type() const override { return "chessboard"; }
  const std::vector<TargetPoint>& points() const override { return points_; }

  Detection Detect(const cv::Mat& grey) const override {
    Detection detection;
    for (const Finder& finder : kFinders) {
      cv::Mat picture = grey;
      if (finder.equalise) cv::createCLAHE(3.0, cv::Size(8, 8))->apply(grey, picture);
      constexpr int kMaxEnlargedPx = 3000;
      if (finder.scale > 1) {
        if (std::max(grey.cols, grey.rows) * finder.scale > kMaxEnlargedPx * finder.scale) continue;
        cv::resize(picture, picture, {}, finder.scale, finder.scale, cv::INTER_CUBIC);
      }
      std::vector<cv::Point2f> found;
      if (!finder.find(picture, cv::Size(columns_, rows_), &found)) continue;
      Corners corners = FromOpenCv(found, finder.scale);
      if (corners.size() != points_.size()) continue;
      Arrange(grey, &corners);
      if (!CornersAreSaddles(grey, corners)) continue;
      if (finder.refine) Refine(grey, &corners);
      for (size_t i = 0; i < points_.size(); ++i) detection.ids.push_back(points_[i].id);
      detection.pixels = std::move(corners);
      return detection;
    }
    detection.reason = "no board of " + std::to_string(rows_) + " x " + std::to_string(columns_) +
                       " inner corners found; it must be seen whole, with a light rim";
    return detection;
  }

  Drawing Draw() const override {
    Drawing drawing;
    drawing.min_m = {-2 * square_m_, -2 * square_m_};
    drawing.max_m = {(columns_ + 1) * square_m_, (rows_ + 1) * square_m_};
    for (int row = -1; row < rows_; ++row) {
      for (int column = -1; column < columns_; ++column) {
        if (!IsBlack(row, column)) continue;
        drawing.AddRectangle(column * square_m_, row * square_m_, (column + 1) * square_m_, (row + 1) * square_m_, 0);
      }
    }
    return drawing;
  }

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

  // Whether the four quadrants around nearly every corner are black and white as on the board: no chance grid's are.
  bool CornersAreSaddles(const cv::Mat& grey, const Corners& corners) const {
    // Where half a turn keeps the colours, boards are printed with the first square black or white.
    const bool inverted = ColourScore(grey, corners) < 0;
    int right = 0;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const Eigen::Vector2d& here = corners[Index(row, column)];
        // Half a step along a row or a column, to a neighbour or away from it.
        const auto half_step = [&](int down, int across) -> Eigen::Vector2d {
          const int r = row + down;
          const int c = column + across;
          if (r >= 0 && c >= 0 && r < rows_ && c < columns_) return 0.5 * (corners[Index(r, c)] - here);
          return -0.5 * (corners[Index(row - down, column - across)] - here);
        };
        double black_max = 0;
        double white_min = 255;
        for (const int down : {-1, 1}) {
          for (const int across : {-1, 1}) {
            const Eigen::Vector2d p = here + 0.7 * (half_step(down, 0) + half_step(0, across));
            const cv::Point at(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
            if (at.x < 0 || at.y < 0 || at.x >= grey.cols || at.y >= grey.rows) continue;
            const double level = grey.at<uchar>(at);
            if (IsBlack(row + (down - 1) / 2, column + (across - 1) / 2) != inverted) {
              black_max = std::max(black_max, level);
            } else {
              white_min = std::min(white_min, level);
            }
          }
        }
        right += black_max < white_min ? 1 : 0;
      }
    }
    constexpr double kMinShare = 0.9;
    return right >= kMinShare * static_cast<double>(points_.size());
  }

  void Refine(const cv::Mat& grey, Corners* corners) const {
    const Corners start = *corners;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        double reach_px = std::numeric_limits<double>::infinity();
        for (const auto& [down, across] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
          const int r = row + down;
          const int c = column + across;
          if (r < 0 || c < 0 || r >= rows_ || c >= columns_) continue;
          reach_px = std::min(reach_px, (start[Index(r, c)] - start[Index(row, column)]).norm());
        }
        // Half of the way to the next corner.
        const std::optional<Eigen::Vector2d> refined =
            RefineCorner(grey, start[Index(row, column)], 0.5 * reach_px, std::max(1.5, 0.15 * reach_px));
        if (refined) (*corners)[Index(row, column)] = *refined;
      }
    }
  }

  int rows_;
  int columns_;
  double square_m_;
  std::vector<TargetPoint> points_;
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
