#include "targets/dots/ellipse_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include <Eigen/Dense>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/median.h"
#include "heba/base/units.h"
#include "targets/images/image.h"
#include "targets/images/light_areas.h"

namespace heba {

std::string EllipseFinderOptions::Check() const {
  std::string faults;
  if (!(min_diameter_px >= 3)) faults += "min_diameter_px must be at least 3\n";
  if (!(max_diameter_px >= min_diameter_px)) faults += "max_diameter_px must be at least min_diameter_px\n";
  if (!(max_axis_ratio >= 1)) faults += "max_axis_ratio must be at least 1\n";
  if (!(min_contrast_grey > 0)) faults += "min_contrast_grey must be positive\n";
  return faults;
}

namespace {

// Outlines of at least this many points may have parts that do not belong to the dot.
constexpr size_t kMinPointsToSpare = 60;
// Outlines with a smaller roughness are as smooth as pixels allow and are not reduced to a part.
constexpr double kSmoothPx = 0.6;

struct Candidate {
  FoundEllipse found;
  double score;  // Grey value step across the outline, reduced for a rough outline.
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

// Grey values inside and outside the outline, on rays from the centre.
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
  const Eigen::Matrix2d axes = EigenOfSymmetric(ellipse.shape).InverseRoot();
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

// Computes the distances of points from an outline, to first order.
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
  Ellipse ellipse;      // Contains the pixels whose outermost ones form the outline.
  double roughness_px;  // RMS distance of the outline from the fitted ellipse.
};

// Returns the maximum roughness of an outline that is accepted as an ellipse.
double MaxRoughnessPx(double radius_px) { return 0.4 + 0.03 * radius_px; }

// Converts the ellipse through the centres of the outermost pixels to the one that contains these pixels.
Ellipse Around(const Ellipse& through) { return through.Grown(0.5); }

// The ellipse with the centroid and the covariance of an area.
struct MomentEllipse {
  Ellipse ellipse;
  double area_px2;
  double fill;  // Area divided by that of the ellipse: 1 for ellipses, less for all other shapes.
};

// Fits an ellipse to the polygon `outline`, clockwise in the image. Returns nothing if the polygon has no area.
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

// Fits the conic a x^2 + b x y + c y^2 + d x + e y = 1 to the points by algebraic least squares, in coordinates
// relative to a position inside it, `within_px`, and in units of `radius_px`. Returns nothing if the conic is not an
// ellipse.
std::optional<Ellipse> FitConic(const std::vector<cv::Point>& points, const Eigen::Vector2d& within_px,
                                double radius_px) {
  using Row = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();  // Only the lower triangle is filled.
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
  // These entries are equal to sums computed above.
  normal(2, 0) = normal(1, 1);
  normal(4, 0) = normal(3, 1);
  normal(3, 2) = normal(4, 1);
  const Row sum(normal(3, 3), normal(4, 3), normal(4, 4), sum_x, sum_y);
  const Row conic = SolveSymmetric(normal, sum);
  if (!conic.allFinite()) return std::nullopt;
  Eigen::Matrix2d shape;
  shape << conic[0], 0.5 * conic[1], 0.5 * conic[1], conic[2];
  if (!(shape.determinant() > 1e-6) || !(conic[0] > 0)) return std::nullopt;
  const Eigen::Vector2d centre = -0.5 * shape.inverse() * conic.tail<2>();
  shape /= 1 + centre.dot(shape * centre);
  return Ellipse{within_px + radius_px * centre, shape / (radius_px * radius_px)};
}

// Returns an outline without most of its points if it is long, since some of them suffice.
std::vector<cv::Point> Thinned(std::vector<cv::Point> outline) {
  constexpr size_t kEnough = 60;
  const size_t stride = outline.size() / kEnough;
  if (stride < 2) return outline;
  size_t size = 0;
  for (size_t i = 0; i < outline.size(); i += stride) outline[size++] = outline[i];
  outline.resize(size);
  return outline;
}

// Fits an ellipse to most of `points`, which outline a large dot that may be partly hidden; `whole` is fitted to all
// of them.
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
    // A round that leaves out the farthest points reduces the roughness by about half.
    constexpr double kHopeless = 4;
    if (round > 1 && roughness_px > kHopeless * MaxRoughnessPx(radius_px)) return std::nullopt;
    // The next round uses the four fifths of the points that are nearest to the last ellipse.
    for (size_t i = 0; i < points.size(); ++i) distances[i] = {distance.SquarePx2(points[i]), i};
    const size_t num_used = points.size() * 4 / 5;
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(num_used), distances.end());
    used.clear();
    for (size_t i = 0; i < num_used; ++i) used.push_back(points[distances[i].second]);
  }
}

// The limits on an area of light pixels that may be a dot, in pixels of its level.
struct CandidateLimits {
  // A level covers the dots that neither the previous nor the next one shows better, with a wide overlap.
  double min_size_px = 10;
  double max_size_px = 64;
  // Share of the bounding box: an ellipse fills 0.79. Holes caused by glare or dirt are not counted in the area, and
  // are filled for its outline.
  double min_box_share = 0.15;
  double min_outline_share = 0.3;
  double max_outline_ratio = 2.6;  // Points of the outline by the box's width + height; a smooth outline has 1.6 to 2.
  size_t min_outline_points = 6;   // A conic has five parameters.
  // The area of the pixels agrees with that of the ellipse up to a share, and a rim of this width.
  double area_share = 0.08;
  double area_rim_px = 0.7;
  // The step between dot and paper must be present all around: at this share of the rays, by this share of its median.
  double min_step_ratio = 0.25;
  double min_rays_ratio = 0.8;
  double roughness_weight = 5;  // How much a rough outline reduces the weight of a candidate against its copies.
};
constexpr CandidateLimits kCandidate;

// Returns the areas of the pixels of `level` above `threshold` as candidates, in pixels of the full image `grey` (light
// dots). `level` is that image reduced by the factor `scale`; `is_last` tells that there is no further reduction.
std::vector<Candidate> CandidatesIn(const cv::Mat& grey, const cv::Mat& level, int threshold, int scale, bool is_last,
                                    const EllipseFinderOptions& options) {
  const double min_px = scale == 1 ? options.min_diameter_px : kCandidate.min_size_px * scale;
  const double max_px = std::min(options.max_diameter_px + 2, is_last ? 1e9 : kCandidate.max_size_px * scale);
  const std::vector<LightArea> areas = FindLightAreas(level, threshold, static_cast<int>(std::ceil(min_px / scale)),
                                                      static_cast<int>(std::floor(max_px / scale)));
  std::vector<Candidate> candidates;
  for (const LightArea& area : areas) {
    const double box_area = area.box.width * area.box.height;
    if (area.num_pixels < kCandidate.min_box_share * box_area) continue;
    const double long_side = std::max(area.box.width, area.box.height);
    const double short_side = std::min(area.box.width, area.box.height);
    if (long_side > options.max_axis_ratio * (short_side + 1.5)) continue;
    const auto most_points = static_cast<size_t>(kCandidate.max_outline_ratio * (area.box.width + area.box.height));
    std::optional<std::vector<cv::Point>> traced = TraceOutline(level, threshold, area.first, most_points);
    if (!traced || traced->size() < kCandidate.min_outline_points) continue;
    const std::optional<MomentEllipse> moments = FitMoments(*traced);
    if (!moments) continue;
    const size_t num_points = traced->size();
    const double num_pixels = moments->area_px2 + 0.5 * static_cast<double>(num_points) + 1;  // Pick's theorem.
    if (num_pixels < kCandidate.min_outline_share * box_area) continue;
    const bool has_spare_points = num_points >= kMinPointsToSpare;
    // Noise or glare may have removed a part of the dot, and a line may lead to it.
    constexpr double kMinFill = 0.5;
    constexpr size_t kMinPointsForMoments = 24;
    if (num_points >= kMinPointsForMoments && moments->fill < kMinFill) continue;

    const std::vector<cv::Point> outline = Thinned(std::move(*traced));
    Ellipse through = moments->ellipse;
    double roughness_px = OutlineDistance(through).RmsPx(outline);
    // For few pixels, the moments are those of a polygon, whereas the conic is fitted to a curve.
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
    const double area_tolerance = kCandidate.area_share + kCandidate.area_rim_px / axes.y();
    if (std::abs(num_pixels / (kPi * axes.x() * axes.y()) - 1) > area_tolerance) continue;
    Ellipse ellipse = fit.ellipse;

    // The ellipse is converted to pixels of the full image.
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
    int num_steps = 0;
    for (int i = 0; i < Rays::kNumRays; ++i) {
      num_steps += rays.inside[i] - rays.outside[i] > kCandidate.min_step_ratio * contrast ? 1 : 0;
    }
    if (num_steps < kCandidate.min_rays_ratio * Rays::kNumRays) continue;
    const double relative_roughness = fit.roughness_px / radius;
    candidates.push_back({{ellipse, contrast}, contrast / (1 + kCandidate.roughness_weight * relative_roughness)});
  }
  return candidates;
}

// Keeps one candidate per dot: the best of those that agree in centre and size.
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
          // A threshold near the dark or light level moves a blurred outline by about a pixel.
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

// Returns thresholds between the dark and the light end of the image's grey values, so close that about every step of
// a tenth of that range crosses one.
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

// Returns the image at half size; the last of an odd number of rows or columns is left out. Empty if there is only
// one.
cv::Mat Halved(const cv::Mat& grey) {
  if (grey.cols < 2 || grey.rows < 2) return {};
  cv::Mat half;
  const cv::Rect even(0, 0, grey.cols / 2 * 2, grey.rows / 2 * 2);
  cv::resize(grey(even), half, cv::Size(grey.cols / 2, grey.rows / 2), 0, 0, cv::INTER_AREA);
  return half;
}

// Returns `a` minus `half`, enlarged to twice its size. Negative differences, and those in an odd last row or column,
// are 0.
cv::Mat MinusDoubled(const cv::Mat& a, const cv::Mat& half) {
  constexpr int kLanes = cv::v_uint8x16::nlanes;
  cv::Mat difference(a.size(), CV_8UC1);
  for (int row = 0; row < a.rows; ++row) {
    const uchar* const from = a.ptr<uchar>(row);
    uchar* const to = difference.ptr<uchar>(row);
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
  return difference;
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
  cv::Mat level = light_dots;
  cv::Mat smooth;
  cv::Mat mean;
  for (int scale = 1; !level.empty(); scale *= 2) {
    const cv::Mat half = Halved(level);
    const bool is_last = half.cols < 24 || half.rows < 24 || 2 * scale * 10 > options.max_diameter_px;
    const auto add = [&](const cv::Mat& image, int threshold) {
      const std::vector<Candidate> more = CandidatesIn(light_dots, image, threshold, scale, is_last, options);
      candidates.insert(candidates.end(), more.begin(), more.end());
    };
    // Smoothing keeps noise out of the outlines, which would take long to trace.
    cv::GaussianBlur(level, smooth, cv::Size(3, 3), 0, 0, cv::BORDER_REPLICATE);
    for (const int threshold : GlobalLevels(smooth)) add(smooth, threshold);
    constexpr double kNoises = 2.5;
    const int local_threshold =
        static_cast<int>(std::clamp(std::max(options.min_contrast_grey / 2, kNoises * NoiseGrey(smooth)), 4.0, 255.0));
    // The local threshold finds pixels that exceed the mean around them by more than the noise, in windows measured
    // in pixels of half size; narrow windows find small dots.
    for (const int window_px : scale == 1 ? std::array{5, 13} : std::array{13, 31}) {
      cv::boxFilter(half, mean, -1, cv::Size(window_px, window_px), cv::Point(-1, -1), true, cv::BORDER_REPLICATE);
      add(MinusDoubled(smooth, mean), local_threshold);
    }
    if (is_last) break;
    level = half;
  }
  return Cluster(std::move(candidates), options.polarity);
}

}  // namespace heba
