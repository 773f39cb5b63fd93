#include "targets/ellipse_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include <Eigen/Dense>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/median.h"
#include "heba/base/units.h"
#include "targets/blurred_ellipse.h"
#include "targets/light_areas.h"
#include "targets/rough_turn.h"

namespace heba {

double Ellipse::RadiusPx() const { return std::pow(shape.determinant(), -0.25); }

Eigen::Vector2d Ellipse::SemiAxesPx() const {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(shape, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().cwiseSqrt().cwiseInverse();
}

Eigen::Vector2d Ellipse::ExtentPx() const { return shape.inverse().diagonal().cwiseSqrt(); }

Ellipse Ellipse::FromAxes(const Eigen::Vector2d& centre_px, double semi_major_px, double semi_minor_px,
                          double angle_rad) {
  const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(angle_rad).toRotationMatrix();
  const Eigen::Vector2d weights(1 / (semi_major_px * semi_major_px), 1 / (semi_minor_px * semi_minor_px));
  return {centre_px, rotation * weights.asDiagonal() * rotation.transpose()};
}

std::string EllipseFinderOptions::Check() const {
  std::string faults;
  if (!(min_diameter_px >= 3)) faults += "min_diameter_px must be at least 3\n";
  if (!(max_diameter_px >= min_diameter_px)) faults += "max_diameter_px must be at least min_diameter_px\n";
  if (!(max_axis_ratio >= 1)) faults += "max_axis_ratio must be at least 1\n";
  if (!(min_contrast_grey > 0)) faults += "min_contrast_grey must be positive\n";
  return faults;
}

namespace {

// Outlines of so many points may have parts that do not belong to the dot,
constexpr size_t kMinPointsToSpare = 60;
// unless they are as smooth as pixels allow.
constexpr double kSmoothPx = 0.6;

struct Candidate {
  FoundEllipse found;
  double score;  // Brightness step across the outline, less for a rough outline.
};

double Bilinear(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  const double x = std::clamp(pixel.x(), 0.0, grey.cols - 1.001);
  const double y = std::clamp(pixel.y(), 0.0, grey.rows - 1.001);
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const double fx = x - column;
  const double fy = y - row;
  const uchar* upper = grey.ptr<uchar>(row) + column;
  const uchar* lower = grey.ptr<uchar>(row + 1) + column;
  return (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) + fy * ((1 - fx) * lower[0] + fx * lower[1]);
}

// Brightness on rays through the outline: what lies inside, outside, and the step between.
struct Rays {
  static constexpr int kNumRays = 24;
  std::array<double, kNumRays> inside;
  std::array<double, kNumRays> outside;
};

const std::array<Eigen::Vector2d, Rays::kNumRays>& RayDirections() {
  static const std::array<Eigen::Vector2d, Rays::kNumRays> directions = [] {
    std::array<Eigen::Vector2d, Rays::kNumRays> all;
    for (int i = 0; i < Rays::kNumRays; ++i) {
      const double angle = 2 * kPi * i / Rays::kNumRays;
      all[static_cast<size_t>(i)] = {std::cos(angle), std::sin(angle)};
    }
    return all;
  }();
  return directions;
}

Rays SampleRays(const cv::Mat& grey, const Ellipse& ellipse) {
  const Eigen::Matrix2d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(ellipse.shape).operatorInverseSqrt();
  Rays rays;
  for (size_t i = 0; i < Rays::kNumRays; ++i) {
    const Eigen::Vector2d arm = axes * RayDirections()[i];
    const double length_px = arm.norm();
    const double step_px = std::min(1.5, 0.5 * length_px);
    rays.inside[i] = Bilinear(grey, ellipse.centre_px + (1 - step_px / length_px) * arm);
    rays.outside[i] = Bilinear(grey, ellipse.centre_px + (1 + 1.5 / length_px) * arm);
  }
  return rays;
}

double MiddleOf(std::array<double, Rays::kNumRays> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// How far points are from an outline, to first order.
class OutlineDistance {
 public:
  explicit OutlineDistance(const Ellipse& outline)
      : x_(outline.centre_px.x()),
        y_(outline.centre_px.y()),
        xx_(outline.shape(0, 0)),
        xy_(outline.shape(0, 1)),
        yy_(outline.shape(1, 1)),
        radius_px_(outline.RadiusPx()) {}

  double SquarePx2(const cv::Point& point) const {
    const double dx = point.x - x_;
    const double dy = point.y - y_;
    const double mx = xx_ * dx + xy_ * dy;
    const double my = xy_ * dx + yy_ * dy;
    const double square = mx * dx + my * dy;
    if (square < 1e-18) return radius_px_ * radius_px_;
    const double off = square - std::sqrt(square);
    return off * off / (mx * mx + my * my);
  }
  double RmsPx(const std::vector<cv::Point>& points) const {
    double sum_square = 0;
    for (const cv::Point& point : points) sum_square += SquarePx2(point);
    return std::sqrt(sum_square / static_cast<double>(points.size()));
  }

 private:
  double x_;
  double y_;
  double xx_;
  double xy_;
  double yy_;
  double radius_px_;
};

struct OutlineFit {
  Ellipse ellipse;      // Around the pixels of which the outline has the outermost ones.
  double roughness_px;  // RMS distance of the outline from it.
};

// Of an outline that is taken for an ellipse's.
double MaxRoughnessPx(double radius_px) { return 0.4 + 0.03 * radius_px; }

// Its semi-axes longer by `step_px`.
Ellipse Grown(const Ellipse& ellipse, double step_px) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(ellipse.shape);
  const Eigen::Vector2d semi_axes_px = solver.eigenvalues().cwiseSqrt().cwiseInverse().array() + step_px;
  const Eigen::Matrix2d& axes = solver.eigenvectors();
  return {ellipse.centre_px, axes * semi_axes_px.cwiseAbs2().cwiseInverse().asDiagonal() * axes.transpose()};
}

// Around the pixels of which it goes through the centres.
Ellipse Around(const Ellipse& through) { return Grown(through, 0.5); }

// The ellipse with the area's moments to the second.
struct MomentEllipse {
  Ellipse ellipse;
  double area_px2;
  double fill;  // The area by the ellipse's: 1 for ellipses, less for everything else.
};

// Of the polygon `outline`, clockwise in the picture. Nothing if it has no area.
std::optional<MomentEllipse> FitMoments(const std::vector<cv::Point>& outline) {
  const cv::Point origin = outline.front();
  int64_t sum = 0;
  int64_t sum_x = 0;
  int64_t sum_y = 0;
  int64_t sum_xx = 0;
  int64_t sum_xy = 0;
  int64_t sum_yy = 0;
  cv::Point a = outline.back() - origin;
  for (const cv::Point& point : outline) {
    const cv::Point b = point - origin;
    const int64_t cross = static_cast<int64_t>(a.x) * b.y - static_cast<int64_t>(b.x) * a.y;
    sum += cross;
    sum_x += cross * (a.x + b.x);
    sum_y += cross * (a.y + b.y);
    sum_xx += cross * (a.x * a.x + a.x * b.x + b.x * b.x);
    sum_xy += cross * (2 * a.x * a.y + a.x * b.y + b.x * a.y + 2 * b.x * b.y);
    sum_yy += cross * (a.y * a.y + a.y * b.y + b.y * b.y);
    a = b;
  }
  if (sum <= 0) return std::nullopt;
  const auto twice_area = static_cast<double>(sum);
  const Eigen::Vector2d centre =
      Eigen::Vector2d(static_cast<double>(sum_x), static_cast<double>(sum_y)) / (3 * twice_area);
  Eigen::Matrix2d covariance;
  covariance << 2 * static_cast<double>(sum_xx), static_cast<double>(sum_xy), static_cast<double>(sum_xy),
      2 * static_cast<double>(sum_yy);
  covariance /= 12 * twice_area;
  covariance -= centre * centre.transpose();
  const double determinant = covariance.determinant();
  if (!(determinant > 1e-9) || !(covariance(0, 0) > 0)) return std::nullopt;
  MomentEllipse moments;
  moments.ellipse = {centre + Eigen::Vector2d(origin.x, origin.y), 0.25 * covariance.inverse()};
  moments.area_px2 = 0.5 * twice_area;
  moments.fill = moments.area_px2 / (4 * kPi * std::sqrt(determinant));
  return moments;
}

// The conic a x^2 + b x y + c y^2 + d x + e y = 1, about a place within and in units of `radius_px`, that is nearest to
// the points in the least squares of its equation. Nothing if it is no ellipse.
std::optional<Ellipse> FitConic(const std::vector<cv::Point>& points, const Eigen::Vector2d& within_px,
                                double radius_px) {
  using Row = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();  // Its lower half.
  double sum_x = 0;
  double sum_y = 0;
  for (const cv::Point& point : points) {
    const double x = (point.x - within_px.x()) / radius_px;
    const double y = (point.y - within_px.y()) / radius_px;
    const double xx = x * x;
    const double xy = x * y;
    const double yy = y * y;
    normal(0, 0) += xx * xx;
    normal(1, 0) += xx * xy;
    normal(1, 1) += xy * xy;
    normal(2, 1) += xy * yy;
    normal(2, 2) += yy * yy;
    normal(3, 0) += xx * x;
    normal(3, 1) += xx * y;
    normal(4, 1) += x * yy;
    normal(4, 2) += yy * y;
    normal(3, 3) += xx;
    normal(4, 3) += xy;
    normal(4, 4) += yy;
    sum_x += x;
    sum_y += y;
  }
  // The same sums elsewhere.
  normal(2, 0) = normal(1, 1);
  normal(4, 0) = normal(3, 1);
  normal(3, 2) = normal(4, 1);
  const Row sum(normal(3, 3), normal(4, 3), normal(4, 4), sum_x, sum_y);
  const Row conic = normal.llt().solve(sum);
  if (!conic.allFinite()) return std::nullopt;
  Eigen::Matrix2d shape;
  shape << conic[0], 0.5 * conic[1], 0.5 * conic[1], conic[2];
  if (!(shape.determinant() > 1e-6) || !(conic[0] > 0)) return std::nullopt;
  const Eigen::Vector2d centre = -0.5 * shape.inverse() * conic.tail<2>();
  shape /= 1 + centre.dot(shape * centre);
  return Ellipse{within_px + radius_px * centre, shape / (radius_px * radius_px)};
}

// Leaves out most points of long outlines: some tell enough.
void Thin(std::vector<cv::Point>* outline) {
  constexpr size_t kEnough = 60;
  const size_t stride = outline->size() / kEnough;
  if (stride < 2) return;
  size_t size = 0;
  for (size_t i = 0; i < outline->size(); i += stride) (*outline)[size++] = (*outline)[i];
  outline->resize(size);
}

// The ellipse through most of `points`, those of a large outline of which a part may be missing; `whole` is through
// all of them.
std::optional<OutlineFit> FitMost(const std::vector<cv::Point>& points, const Ellipse& whole) {
  const double radius_px = whole.RadiusPx();
  std::vector<cv::Point> used = points;
  std::vector<std::pair<double, size_t>> distances(points.size());
  constexpr int kMaxRounds = 4;
  for (int round = 1;; ++round) {
    const std::optional<Ellipse> through = FitConic(used, whole.centre_px, radius_px);
    if (!through) return std::nullopt;
    const OutlineDistance distance(*through);
    const double roughness_px = distance.RmsPx(used);
    if (roughness_px < kSmoothPx || round == kMaxRounds) return OutlineFit{Around(*through), roughness_px};
    // A round that leaves out what is farthest makes it smaller by half, about.
    constexpr double kHopeless = 4;
    if (round > 1 && roughness_px > kHopeless * MaxRoughnessPx(radius_px)) return std::nullopt;
    // The points that are nearest to the last ellipse, four fifths of them.
    for (size_t i = 0; i < points.size(); ++i) distances[i] = {distance.SquarePx2(points[i]), i};
    const size_t num_used = points.size() * 4 / 5;
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(num_used), distances.end());
    used.clear();
    for (size_t i = 0; i < num_used; ++i) used.push_back(points[distances[i].second]);
  }
}

// Areas of the pixels of `level` above `threshold`, as candidates in the pixels of the picture `grey` (light dots), of
// which `level` is a version smaller by `scale`; `is_last` if there is none that is smaller still.
void AddCandidates(const cv::Mat& grey, const cv::Mat& level, int threshold, int scale, bool is_last,
                   const EllipseFinderOptions& options, std::vector<Candidate>* candidates) {
  // Of a pyramid's level, the dots that neither the last nor the next level can show better, with a wide overlap.
  const double min_px = scale == 1 ? options.min_diameter_px : 10.0 * scale;
  const double max_px = std::min(options.max_diameter_px + 2, is_last ? 1e9 : 64.0 * scale);
  const std::vector<LightArea> areas = FindLightAreas(level, threshold, static_cast<int>(std::ceil(min_px / scale)),
                                                      static_cast<int>(std::floor(max_px / scale)));
  std::vector<cv::Point> outline;
  for (const LightArea& area : areas) {
    const double box_area = area.box.width * area.box.height;
    // Without holes that light or dirt make.
    if (area.num_pixels < 0.15 * box_area) continue;
    const double long_side = std::max(area.box.width, area.box.height);
    const double short_side = std::min(area.box.width, area.box.height);
    if (long_side > options.max_axis_ratio * (short_side + 1.5)) continue;
    const auto most_points = static_cast<size_t>(2.6 * (area.box.width + area.box.height));
    if (!TraceOutline(level, threshold, area.first, most_points, &outline) || outline.size() < 6) continue;
    const std::optional<MomentEllipse> moments = FitMoments(outline);
    if (!moments) continue;
    const double num_pixels = moments->area_px2 + 0.5 * static_cast<double>(outline.size()) + 1;  // Pick's theorem.
    if (num_pixels < 0.3 * box_area) continue;
    const size_t num_points = outline.size();
    const bool has_spare_points = num_points >= kMinPointsToSpare;
    // Of a dot from which noise or glare has taken a part, or to which a line leads.
    constexpr double kMinFill = 0.5;
    constexpr size_t kMinPointsForMoments = 24;
    if (num_points >= kMinPointsForMoments && moments->fill < kMinFill) continue;

    Thin(&outline);
    Ellipse through = moments->ellipse;
    double roughness_px = OutlineDistance(through).RmsPx(outline);
    // Of few pixels the moments are those of a polygon, the conic those of a curve.
    constexpr double kAsGoodPx = 0.4;
    if (!has_spare_points && (num_points < kMinPointsForMoments || roughness_px > kAsGoodPx)) {
      through = FitConic(outline, through.centre_px, through.RadiusPx()).value_or(through);
      roughness_px = OutlineDistance(through).RmsPx(outline);
    }
    OutlineFit fit{Around(through), roughness_px};
    if (has_spare_points && fit.roughness_px >= kSmoothPx) {
      const std::optional<OutlineFit> most = FitMost(outline, moments->ellipse);
      if (!most) continue;
      fit = *most;
    }
    const double radius = fit.ellipse.RadiusPx();
    if (fit.roughness_px > MaxRoughnessPx(radius)) continue;
    const Eigen::Vector2d axes = fit.ellipse.SemiAxesPx();
    if (2 * axes.y() * scale < options.min_diameter_px || 2 * axes.x() * scale > options.max_diameter_px) continue;
    if (axes.x() > options.max_axis_ratio * axes.y()) continue;
    const double area_tolerance = 0.08 + 0.7 / axes.y();
    if (std::abs(num_pixels / (kPi * axes.x() * axes.y()) - 1) > area_tolerance) continue;
    Ellipse ellipse = fit.ellipse;

    // To the pixels of the whole picture.
    ellipse.centre_px = (ellipse.centre_px.array() + 0.5) * scale - 0.5;
    ellipse.shape /= static_cast<double>(scale * scale);
    const Eigen::Vector2d extent = ellipse.ExtentPx();
    if (((ellipse.centre_px - extent).array() < 0.5).any()) continue;
    if (ellipse.centre_px.x() + extent.x() > grey.cols - 1.5 || ellipse.centre_px.y() + extent.y() > grey.rows - 1.5) {
      continue;
    }
    const Rays rays = SampleRays(grey, ellipse);
    const double contrast = MiddleOf(rays.inside) - MiddleOf(rays.outside);
    if (contrast < options.min_contrast_grey) continue;
    // The step is there all around.
    int num_steps = 0;
    for (int i = 0; i < Rays::kNumRays; ++i) num_steps += rays.inside[i] - rays.outside[i] > 0.25 * contrast ? 1 : 0;
    if (num_steps < 0.8 * Rays::kNumRays) continue;
    const double relative_roughness = fit.roughness_px / radius;
    candidates->push_back({{ellipse, contrast}, contrast / (1 + 5 * relative_roughness)});
  }
}

// One candidate a dot: the best of those that agree in centre and size.
std::vector<FoundEllipse> Cluster(std::vector<Candidate> candidates, DotPolarity polarity) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  constexpr double kCellPx = 48;
  const auto cell_of = [](double px) { return static_cast<int>(std::floor(px / kCellPx)); };
  std::map<std::pair<int, int>, std::vector<size_t>> cells;
  std::vector<FoundEllipse> kept;
  for (const Candidate& candidate : candidates) {
    const Ellipse& ellipse = candidate.found.ellipse;
    const double radius = ellipse.RadiusPx();
    const double reach = 0.5 * radius;
    bool is_new = true;
    for (int row = cell_of(ellipse.centre_px.y() - reach); row <= cell_of(ellipse.centre_px.y() + reach); ++row) {
      for (int column = cell_of(ellipse.centre_px.x() - reach); column <= cell_of(ellipse.centre_px.x() + reach);
           ++column) {
        const auto cell = cells.find({column, row});
        if (cell == cells.end()) continue;
        for (const size_t other : cell->second) {
          const double other_radius = kept[other].ellipse.RadiusPx();
          const double distance = (kept[other].ellipse.centre_px - ellipse.centre_px).norm();
          // A threshold near dark or light moves a blurred outline by about a pixel.
          const double tolerance_px = 0.35 * std::min(radius, other_radius) + 1.2;
          if (distance < reach && std::abs(other_radius - radius) < tolerance_px) is_new = false;
        }
      }
    }
    if (!is_new) continue;
    cells[{cell_of(ellipse.centre_px.x()), cell_of(ellipse.centre_px.y())}].push_back(kept.size());
    kept.push_back(candidate.found);
    if (polarity == DotPolarity::kDarkOnLight) kept.back().contrast_grey = -kept.back().contrast_grey;
  }
  return kept;
}

// Levels between the picture's dark and light ends, so that about each brightness step of a tenth of them is crossed.
std::vector<int> GlobalLevels(const cv::Mat& grey) {
  std::array<int64_t, 256> histogram{};
  constexpr int kEnoughRows = 256;
  const int stride = std::max(1, grey.rows / kEnoughRows);
  int64_t total = 0;
  for (int row = stride / 2; row < grey.rows; row += stride, total += grey.cols) {
    const uchar* line = grey.ptr<uchar>(row);
    for (int column = 0; column < grey.cols; ++column) ++histogram[line[column]];
  }
  const auto level_at = [&](double share) {
    int64_t sum = 0;
    for (int level = 0; level < 256; ++level) {
      sum += histogram[level];
      if (static_cast<double>(sum) >= share * static_cast<double>(total)) return level;
    }
    return 255;
  };
  const int low = level_at(0.002);
  const int high = level_at(0.998);
  constexpr int kNumLevels = 8;
  std::vector<int> levels;
  for (int i = 1; i <= kNumLevels; ++i) {
    const int level = low + (high - low) * i / (kNumLevels + 1);
    if (levels.empty() || level > levels.back()) levels.push_back(level);
  }
  return levels;
}

// Half as large; of an odd number of rows or columns the last is left out. Empty if there is but one.
cv::Mat Halved(const cv::Mat& grey) {
  if (grey.cols < 2 || grey.rows < 2) return {};
  cv::Mat half;
  const cv::Rect even(0, 0, grey.cols / 2 * 2, grey.rows / 2 * 2);
  cv::resize(grey(even), half, cv::Size(grey.cols / 2, grey.rows / 2), 0, 0, cv::INTER_AREA);
  return half;
}

// a less what `half`, of half its size, has there; 0 where that is more, and in an odd last row and column.
void SubtractDoubled(const cv::Mat& a, const cv::Mat& half, cv::Mat* difference) {
  constexpr int kLanes = cv::v_uint8x16::nlanes;
  difference->create(a.size(), CV_8UC1);
  for (int row = 0; row < a.rows; ++row) {
    const uchar* const from = a.ptr<uchar>(row);
    uchar* const to = difference->ptr<uchar>(row);
    if (row / 2 >= half.rows) {
      std::fill_n(to, a.cols, uchar{0});
      continue;
    }
    const uchar* const less = half.ptr<uchar>(row / 2);
    int k = 0;
    for (; k + kLanes <= half.cols; k += kLanes) {
      const cv::v_uint8x16 once = cv::v_load(less + k);
      cv::v_uint8x16 first;
      cv::v_uint8x16 second;
      cv::v_zip(once, once, first, second);
      cv::v_store(to + 2 * k, cv::v_load(from + 2 * k) - first);
      cv::v_store(to + 2 * k + kLanes, cv::v_load(from + 2 * k + kLanes) - second);
    }
    for (; k < half.cols; ++k) {
      to[2 * k] = static_cast<uchar>(std::max(from[2 * k] - less[k], 0));
      to[2 * k + 1] = static_cast<uchar>(std::max(from[2 * k + 1] - less[k], 0));
    }
    if (a.cols > 2 * half.cols) to[a.cols - 1] = 0;
  }
}

}  // namespace

std::vector<FoundEllipse> FindEllipses(const cv::Mat& grey, const EllipseFinderOptions& options) {
  CHECK_EQ(grey.type(), CV_8UC1);
  CHECK(options.Check().empty()) << options.Check();
  if (grey.cols < 24 || grey.rows < 24) return {};
  cv::Mat light_dots;
  if (options.polarity == DotPolarity::kDarkOnLight) {
    cv::bitwise_not(grey, light_dots);
  } else {
    light_dots = grey;
  }

  std::vector<Candidate> candidates;
  const int local_threshold = static_cast<int>(std::clamp(options.min_contrast_grey / 2, 4.0, 255.0));
  cv::Mat level = light_dots;
  cv::Mat smooth;
  cv::Mat mean;
  cv::Mat lighter;
  for (int scale = 1; !level.empty(); scale *= 2) {
    const cv::Mat half = Halved(level);
    const bool is_last = half.cols < 24 || half.rows < 24 || 2 * scale * 10 > options.max_diameter_px;
    const auto add = [&](const cv::Mat& picture, int threshold) {
      AddCandidates(light_dots, picture, threshold, scale, is_last, options, &candidates);
    };
    // Noise has no part in outlines, and takes long to follow.
    cv::GaussianBlur(level, smooth, cv::Size(3, 3), 0, 0, cv::BORDER_REPLICATE);
    for (const int threshold : GlobalLevels(smooth)) add(smooth, threshold);
    // Lighter than around by more than noise, in windows of half the pixels: small dots in narrow ones.
    for (const int window_px : scale == 1 ? std::array{5, 13} : std::array{13, 31}) {
      cv::boxFilter(half, mean, -1, cv::Size(window_px, window_px), cv::Point(-1, -1), true, cv::BORDER_REPLICATE);
      SubtractDoubled(smooth, mean, &lighter);
      add(lighter, local_threshold);
    }
    if (is_last) break;
    level = half;
  }
  return Cluster(std::move(candidates), options.polarity);
}

namespace {

using Parameters = BlurredEllipseParameters;
using Normal = decltype(BlurredEllipseSums::normal);

// Keeps a parameter where it is.
void Hold(int parameter, Normal* normal, Parameters* gradient) {
  normal->row(parameter).setZero();
  normal->col(parameter).setZero();
  (*normal)(parameter, parameter) = 1;
  (*gradient)[parameter] = 0;
}

// The fit of one dot, in coordinates about `start` and in its radii.
class BlurredEllipse {
 public:
  BlurredEllipse(const cv::Mat& grey, const Ellipse& start)
      : grey_(grey), origin_px_(start.centre_px), radius_px_(start.RadiusPx()) {
    const Eigen::Matrix2d shape = start.shape * radius_px_ * radius_px_;
    x_[kShapeXX] = shape(0, 0);
    x_[kShapeXY] = shape(0, 1);
    x_[kShapeYY] = shape(1, 1);
    x_[kLogSigma] = std::log(1.0 / radius_px_);
    // Slopes need some area to be told from the dot's place.
    num_free_ = radius_px_ < 3 ? kLightX : kInsideX;
  }

  Ellipse Outline() const {
    Eigen::Matrix2d shape;
    shape << x_[kShapeXX], x_[kShapeXY], x_[kShapeXY], x_[kShapeYY];
    return {origin_px_ + radius_px_ * x_.head<2>(), shape / (radius_px_ * radius_px_)};
  }
  double SigmaPx() const { return radius_px_ * std::exp(x_[kLogSigma]); }
  // At the centre, which is the mean of the outline.
  double Contrast() const {
    const double light = 1 + x_[kLightX] * x_[kCentreX] + x_[kLightY] * x_[kCentreY];
    return light * (x_[kInside] - x_[kOutside] + x_[kInsideX] * x_[kCentreX] + x_[kInsideY] * x_[kCentreY]);
  }

  // A dot that just touches the border is as good as whole.
  bool IsInPicture() const {
    const Ellipse outline = Outline();
    const Eigen::Vector2d extent = outline.ExtentPx();
    const double beyond_px = 0.5 + 0.1 * outline.RadiusPx();
    const Eigen::Vector2d first = outline.centre_px - extent;
    const Eigen::Vector2d last = outline.centre_px + extent;
    return (first.array() > -beyond_px).all() && last.x() < grey_.cols - 1 + beyond_px &&
           last.y() < grey_.rows - 1 + beyond_px;
  }

  // Takes the pixels within `margin_px` of the outline, not all if there are more than `max_samples`.
  void Sample(double margin_px, const RefineEllipseOptions& options, double max_samples) {
    const Ellipse outline = Outline();
    const double reach_px = options.next_reach_sigmas * SigmaPx();
    const double num_expected = 4 * kPi * outline.RadiusPx() * margin_px;
    const int stride = std::max(1, static_cast<int>(std::sqrt(num_expected / max_samples)));
    const Eigen::Vector2d semi_axes_px = outline.SemiAxesPx();
    // Larger and smaller ones, beyond and within which there is nothing to take.
    const double slack_px = 1 + 0.1 * margin_px;
    const Ellipse outer = Grown(outline, margin_px + slack_px);
    const double inner_px = semi_axes_px.y() - margin_px - slack_px;
    const std::optional<Ellipse> inner =
        inner_px > 0 ? std::optional<Ellipse>(Grown(outline, -margin_px - slack_px)) : std::nullopt;
    const double extent_px = outer.ExtentPx().y();
    const int y0 = std::max(0, static_cast<int>(std::floor(outline.centre_px.y() - extent_px)));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(std::ceil(outline.centre_px.y() + extent_px)));
    pixels_.Clear();
    distances_px_.clear();
    sectors_.clear();
    for (int row = y0; row <= y1; row += stride) {
      const std::optional<Eigen::Vector2d> span = SpanOf(outer, row);
      if (!span) continue;
      const int x0 = std::max(0, static_cast<int>(std::floor(span->x())));
      const int x1 = std::min(grey_.cols - 1, static_cast<int>(std::ceil(span->y())));
      const std::optional<Eigen::Vector2d> hole = inner ? SpanOf(*inner, row) : std::nullopt;
      int column = (x0 + stride - 1) / stride * stride;
      for (; column <= x1; column += stride) {
        if (hole && column > hole->x() && column < hole->y()) {
          column = static_cast<int>(std::ceil(hole->y())) / stride * stride;
          if (column < hole->y()) column += stride;
          if (column > x1) break;
        }
        AddPixel(row, column, outline, margin_px, reach_px, options.next_outline_ratio);
      }
    }
    pixels_.Pad();
    HidePixels();
  }

  // Brightness inside and outside from the samples. False if there are too few.
  bool StartLevels(double margin_px) {
    const double inside_px = std::min(0.5 * margin_px, 0.3 * Outline().SemiAxesPx().y());
    double outside_px = 0;
    for (const double distance_px : distances_px_) outside_px = std::max(outside_px, 0.5 * distance_px);
    double sum_inside = 0;
    double sum_outside = 0;
    int num_inside = 0;
    int num_outside = 0;
    for (size_t i = 0; i < pixels_.size(); ++i) {
      if (distances_px_[i] < -inside_px) {
        sum_inside += pixels_.grey()[i];
        ++num_inside;
      } else if (distances_px_[i] > outside_px) {
        sum_outside += pixels_.grey()[i];
        ++num_outside;
      }
    }
    if (num_inside < 1 || num_outside < 4) return false;
    x_[kInside] = sum_inside / num_inside;
    x_[kOutside] = sum_outside / num_outside;
    return true;
  }

  // To within `tolerance` of the cost. False if what comes out is no ellipse.
  bool Fit(double tolerance) {
    return pixels_.size() >= kNumBlurredEllipseParameters + 4u && Minimise(num_free_, tolerance, &x_, &sums_);
  }

  // With a slope of the inside alone (gloss, a dirty dot) where the picture asks for it.
  bool FitWithNeededSlopes(double tolerance) {
    if (!Fit(tolerance)) return false;
    if (num_free_ != kInsideX) return true;
    Parameters sloping = x_;
    BlurredEllipseSums sloping_sums;
    if (!Minimise(kNumBlurredEllipseParameters, tolerance, &sloping, &sloping_sums)) return true;
    // Chi-square of two, exceeded by chance once in 3000: rarely enough not to widen the scatter of even ones.
    constexpr double kMinGain = 16;
    if (static_cast<double>(pixels_.size()) * (sums_.cost / sloping_sums.cost - 1) > kMinGain) {
      x_ = sloping;
      sums_ = sloping_sums;
      num_free_ = kNumBlurredEllipseParameters;
    }
    return true;
  }

  // From the residuals: what counts as an outlier, and which sectors of the outline do not agree with the rest. Whether
  // those have changed.
  bool Judge() {
    std::vector<double> sizes = EdgeResiduals(pixels_, x_);
    std::array<double, kNumSectors> sums{};
    std::array<int, kNumSectors> counts{};
    for (size_t i = 0; i < pixels_.size(); ++i) {
      sums[sectors_[i]] += sizes[i] * sizes[i];
      ++counts[sectors_[i]];
      sizes[i] = std::abs(sizes[i]);
    }
    // Some tell enough.
    constexpr size_t kEnough = 500;
    const size_t stride = std::max<size_t>(1, sizes.size() / kEnough);
    size_t num_sizes = 0;
    for (size_t i = 0; i < sizes.size(); i += stride) sizes[num_sizes++] = sizes[i];
    sizes.resize(num_sizes);
    // Where the flat parts are saturated, the edge alone has residuals: those are no outliers.
    bend_ = std::max(2.5 * 1.4826 * Median(std::move(sizes)), 0.05 * std::abs(Contrast()));

    std::vector<double> squares;
    for (int i = 0; i < kNumSectors; ++i) {
      sums[i] /= std::max(counts[i], 1);
      squares.push_back(sums[i]);
    }
    const double limit = std::max(4 * Median(std::move(squares)), std::pow(0.12 * Contrast(), 2));
    bool changed = false;
    for (int i = 0; i < kNumSectors; ++i) {
      const bool hidden = sums[i] > limit;
      changed = changed || hidden != hidden_[i];
      hidden_[i] = hidden;
    }
    HidePixels();
    return changed;
  }

  RefinedEllipse Result() const {
    RefinedEllipse refined;
    refined.ellipse = Outline();
    refined.blur_sigma_px = SigmaPx();
    refined.contrast_grey = Contrast();
    refined.visible_ratio =
        1 - static_cast<double>(std::count(hidden_.begin(), hidden_.end(), true)) / static_cast<double>(kNumSectors);
    const std::vector<double> residuals = EdgeResiduals(pixels_, x_);
    double sum_square = 0;
    double sum_weighted = 0;
    double num_samples = 0;
    for (size_t i = 0; i < residuals.size(); ++i) {
      if (hidden_[sectors_[i]]) continue;
      const double square = residuals[i] * residuals[i];
      sum_square += square;
      sum_weighted += square <= bend_ * bend_ ? square : bend_ * std::abs(residuals[i]);
      num_samples += 1;
    }
    refined.residual_ratio = std::sqrt(sum_square / num_samples) / std::abs(refined.contrast_grey);
    const Normal covariance = sums_.normal.ldlt().solve(Normal::Identity());
    // Rounding alone has a variance of 1/12.
    const double variance = std::max(sum_weighted / std::max(num_samples - num_free_, 1.0), 1.0 / 12);
    refined.centre_covariance_px2 = radius_px_ * radius_px_ * variance * covariance.topLeftCorner<2, 2>();
    return refined;
  }

 private:
  static constexpr int kNumSectors = 24;

  // The columns between which a row is inside.
  static std::optional<Eigen::Vector2d> SpanOf(const Ellipse& ellipse, int row) {
    const double v = row - ellipse.centre_px.y();
    const double a = ellipse.shape(0, 0);
    const double b = ellipse.shape(0, 1) * v;
    const double square = b * b - a * (ellipse.shape(1, 1) * v * v - 1);
    if (!(square > 0)) return std::nullopt;
    const double middle = ellipse.centre_px.x() - b / a;
    const double half = std::sqrt(square) / a;
    return Eigen::Vector2d(middle - half, middle + half);
  }

  void AddPixel(int row, int column, const Ellipse& outline, double margin_px, double reach_px,
                double next_outline_ratio) {
    const double ux = column - outline.centre_px.x();
    const double uy = row - outline.centre_px.y();
    const double mx = outline.shape(0, 0) * ux + outline.shape(0, 1) * uy;
    const double my = outline.shape(0, 1) * ux + outline.shape(1, 1) * uy;
    const double rho = std::sqrt(ux * mx + uy * my);
    const double g = std::sqrt(mx * mx + my * my);
    const double distance_px = rho > 1e-6 ? (rho - 1) * rho / g : -radius_px_;
    if (std::abs(distance_px) > margin_px) return;
    if (next_outline_ratio > 0 && rho > 1) {
      const double gradient = g / rho;  // Of rho, 1/px.
      const double gap_px = (next_outline_ratio - 1) / gradient;
      if ((next_outline_ratio - rho) / gradient < std::min(reach_px, 0.5 * gap_px)) return;
    }
    const double grey = grey_.type() == CV_32FC1 ? grey_.at<float>(row, column) : grey_.ptr<uchar>(row)[column];
    pixels_.Add((column - origin_px_.x()) / radius_px_, (row - origin_px_.y()) / radius_px_, grey);
    distances_px_.push_back(distance_px);
    sectors_.push_back(static_cast<size_t>(RoughTurn(ux, uy) * kNumSectors));
  }

  // What hidden parts show does not count.
  void HidePixels() {
    for (size_t i = 0; i < pixels_.size(); ++i) pixels_.SetWeight(i, hidden_[sectors_[i]] ? 0 : 1);
  }

  // Levenberg-Marquardt, until what a step may gain is less than `tolerance` of the cost. False if a step cannot be
  // found.
  bool Minimise(int num_free, double tolerance, Parameters* x, BlurredEllipseSums* sums) const {
    // A pixel's own width is that of a Gaussian of 0.29 px.
    const double min_log_sigma = std::log(0.29 / radius_px_);
    *sums = SumEdge(pixels_, *x, num_free, bend_);
    double damping = 1e-3;
    constexpr int kMaxIterations = 30;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      Parameters gradient = sums->gradient;
      Normal normal = sums->normal;
      if ((*x)[kLogSigma] <= min_log_sigma && gradient[kLogSigma] > 0) Hold(kLogSigma, &normal, &gradient);
      bool improved = false;
      while (!improved && damping < 1e8) {
        Normal damped = normal;
        damped.diagonal() *= 1 + damping;
        const Eigen::LLT<Normal> cholesky(damped);
        if (cholesky.info() != Eigen::Success) {
          damping *= 10;
          continue;
        }
        const Parameters step = -cholesky.solve(gradient);
        if (!step.allFinite()) return false;
        Parameters next = *x + step;
        next[kLogSigma] = std::max(next[kLogSigma], min_log_sigma);
        const bool is_ellipse = next[kShapeXX] > 0.05 &&
                                next[kShapeXX] * next[kShapeYY] - next[kShapeXY] * next[kShapeXY] > 0.05 &&
                                next.head<2>().norm() < 0.7 && next[kLogSigma] < 1;
        if (is_ellipse && damping < 1 && -gradient.dot(step) <= tolerance * sums->cost) {
          *x = next;
          return true;
        }
        if (!is_ellipse) {
          damping *= 10;
          continue;
        }
        const BlurredEllipseSums next_sums = SumEdge(pixels_, next, num_free, bend_);
        if (next_sums.cost <= sums->cost) {
          improved = true;
          *x = next;
          *sums = next_sums;
          damping = std::max(damping * 0.1, 1e-9);
        } else {
          damping *= 10;
        }
      }
      if (!improved) return true;
    }
    return true;
  }

  const cv::Mat& grey_;
  const Eigen::Vector2d origin_px_;
  const double radius_px_;
  Parameters x_ = Parameters::Zero();
  int num_free_ = kNumBlurredEllipseParameters;
  double bend_ = 1e6;  // Grey levels; nothing is an outlier at first.
  std::array<bool, kNumSectors> hidden_{};
  EdgePixels pixels_;
  std::vector<double> distances_px_;  // Of each pixel from the outline that it was taken for.
  std::vector<size_t> sectors_;
  BlurredEllipseSums sums_;  // Of the last fit.
};

}  // namespace

std::optional<RefinedEllipse> RefineEllipse(const cv::Mat& grey, const Ellipse& start,
                                            const RefineEllipseOptions& options) {
  CHECK(grey.type() == CV_8UC1 || grey.type() == CV_32FC1);
  const double radius_px = start.RadiusPx();
  if (!(radius_px > 1) || !start.centre_px.allFinite()) return std::nullopt;
  const double max_margin_px = std::max(options.max_margin_px, 1.5);
  BlurredEllipse fit(grey, start);
  if (!fit.IsInPicture()) return std::nullopt;

  // Coarsely, from some of the pixels in a wide margin.
  const double first_margin_px = std::min(std::max(3.0, 0.15 * radius_px), max_margin_px);
  constexpr double kMaxFirstSamples = 800;
  constexpr double kCoarsely = 1e-3;
  constexpr double kExactly = 1e-7;
  fit.Sample(first_margin_px, options, kMaxFirstSamples);
  if (!fit.StartLevels(first_margin_px) || !fit.Fit(kCoarsely)) return std::nullopt;
  fit.Judge();
  // Then from those that the blurred edge concerns, again as long as parts turn out to be hidden.
  constexpr int kMaxRounds = 5;
  const auto margin_px = [&] {
    return std::min(std::clamp(4 * fit.SigmaPx(), 3.0, std::max(radius_px, 3.0)), max_margin_px);
  };
  for (int round = 0; round < kMaxRounds; ++round) {
    if (!fit.IsInPicture()) return std::nullopt;
    const double used_px = margin_px();
    fit.Sample(used_px, options, std::numeric_limits<double>::infinity());
    if (!fit.Fit(kCoarsely)) return std::nullopt;
    const bool other_parts = fit.Judge();
    if (!other_parts && std::abs(margin_px() - used_px) < 0.2 * used_px) break;
  }
  if (!fit.FitWithNeededSlopes(kExactly) || !fit.IsInPicture()) return std::nullopt;
  if (!(std::abs(fit.Contrast()) > 1)) return std::nullopt;
  const RefinedEllipse refined = fit.Result();
  if (!refined.centre_covariance_px2.allFinite() || !std::isfinite(refined.residual_ratio)) return std::nullopt;
  return refined;
}

}  // namespace heba
