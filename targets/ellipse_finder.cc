#include "targets/ellipse_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "targets/light_areas.h"

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

Rays SampleRays(const cv::Mat& grey, const Ellipse& ellipse) {
  const Eigen::Matrix2d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(ellipse.shape).operatorInverseSqrt();
  Rays rays;
  for (int i = 0; i < Rays::kNumRays; ++i) {
    const double angle = 2 * kPi * i / Rays::kNumRays;
    const Eigen::Vector2d arm = axes * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const double step_px = std::min(1.5, 0.5 * arm.norm());
    const Eigen::Vector2d direction = arm.normalized();
    rays.inside[i] = Bilinear(grey, ellipse.centre_px + arm - step_px * direction);
    rays.outside[i] = Bilinear(grey, ellipse.centre_px + arm + 1.5 * direction);
  }
  return rays;
}

double Quantile(std::array<double, Rays::kNumRays> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(std::lround(share * (values.size() - 1)))];
}

struct ContourFit {
  Ellipse ellipse;
  double roughness_px;  // RMS distance of the contour from it.
};

// Root mean square of the distances of points from an outline, to first order.
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

// The ellipse through the centres of outermost pixels, as one around the pixels.
Ellipse Around(const Ellipse& through) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(through.shape);
  const Eigen::Vector2d semi_axes_px = solver.eigenvalues().cwiseSqrt().cwiseInverse().array() + 0.5;
  const Eigen::Matrix2d& axes = solver.eigenvectors();
  return {through.centre_px, axes * semi_axes_px.cwiseAbs2().cwiseInverse().asDiagonal() * axes.transpose()};
}

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
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
  Row sum = Row::Zero();
  for (const cv::Point& point : points) {
    const double x = (point.x - within_px.x()) / radius_px;
    const double y = (point.y - within_px.y()) / radius_px;
    const Row row(x * x, x * y, y * y, x, y);
    normal.noalias() += row * row.transpose();
    sum += row;
  }
  const Row conic = normal.ldlt().solve(sum);
  Eigen::Matrix2d shape;
  shape << conic[0], 0.5 * conic[1], 0.5 * conic[1], conic[2];
  if (!(shape.determinant() > 1e-6) || !(conic[0] > 0)) return std::nullopt;
  const Eigen::Vector2d centre = -0.5 * shape.inverse() * conic.tail<2>();
  shape /= 1 + centre.dot(shape * centre);
  return Ellipse{within_px + radius_px * centre, shape / (radius_px * radius_px)};
}

// The ellipse through most of the points of `outline`, a large one of which a part may be missing; `whole` is through
// all of them.
std::optional<OutlineFit> FitMost(const std::vector<cv::Point>& outline, const Ellipse& whole) {
  const double radius_px = whole.RadiusPx();
  std::vector<cv::Point> used = outline;
  std::vector<std::pair<double, size_t>> distances(outline.size());
  constexpr int kMaxRounds = 4;
  for (int round = 1;; ++round) {
    const std::optional<Ellipse> through = FitConic(used, whole.centre_px, radius_px);
    if (!through) return std::nullopt;
    const OutlineDistance distance(*through);
    const double roughness_px = distance.RmsPx(used);
    if (roughness_px < kSmoothPx || round == kMaxRounds) return OutlineFit{Around(*through), roughness_px};
    // The points that are nearest to the last ellipse, four fifths of them.
    for (size_t i = 0; i < outline.size(); ++i) distances[i] = {distance.SquarePx2(outline[i]), i};
    const size_t num_used = outline.size() * 4 / 5;
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(num_used), distances.end());
    used.clear();
    for (size_t i = 0; i < num_used; ++i) used.push_back(outline[distances[i].second]);
  }
}

// Areas of the pixels of `level` above `threshold`, as candidates in the pixels of the picture `grey` (light dots), of
// which `level` is a version smaller by `scale`.
void AddCandidates(const cv::Mat& grey, const cv::Mat& level, int threshold, int scale,
                   const EllipseFinderOptions& options, std::vector<Candidate>* candidates) {
  // Of a pyramid's level, the dots that the next level cannot show better, with a wide overlap.
  const double min_px = scale == 1 ? options.min_diameter_px : 10.0 * scale;
  const std::vector<LightArea> areas =
      FindLightAreas(level, threshold, static_cast<int>(std::ceil(min_px / scale)),
                     static_cast<int>(std::floor((options.max_diameter_px + 2) / scale)));
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
    const bool has_spare_points = outline.size() >= kMinPointsToSpare;
    // Of a dot from which noise or glare has taken a part, or to which a line leads.
    constexpr double kMinFill = 0.5;
    constexpr size_t kMinPointsForMoments = 24;
    if (outline.size() >= kMinPointsForMoments && moments->fill < kMinFill) continue;

    // Of few pixels the moments are those of a polygon, the conic those of a curve.
    Ellipse through = moments->ellipse;
    if (!has_spare_points) through = FitConic(outline, through.centre_px, through.RadiusPx()).value_or(through);
    OutlineFit fit{Around(through), OutlineDistance(through).RmsPx(outline)};
    if (has_spare_points && fit.roughness_px >= kSmoothPx) {
      const std::optional<OutlineFit> most = FitMost(outline, moments->ellipse);
      if (!most) continue;
      fit = *most;
    }
    const double radius = fit.ellipse.RadiusPx();
    if (fit.roughness_px > 0.4 + 0.03 * radius) continue;
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
    const double contrast = Quantile(rays.inside, 0.5) - Quantile(rays.outside, 0.5);
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
  for (int row = 0; row < grey.rows; ++row) {
    const uchar* line = grey.ptr<uchar>(row);
    for (int column = 0; column < grey.cols; ++column) ++histogram[line[column]];
  }
  const int64_t total = static_cast<int64_t>(grey.rows) * grey.cols;
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

}  // namespace

std::vector<FoundEllipse> FindEllipses(const cv::Mat& grey, const EllipseFinderOptions& options) {
  CHECK_EQ(grey.type(), CV_8UC1);
  CHECK(options.Check().empty()) << options.Check();
  if (grey.cols < 8 || grey.rows < 8) return {};
  cv::Mat light_dots;
  if (options.polarity == DotPolarity::kDarkOnLight) {
    cv::bitwise_not(grey, light_dots);
  } else {
    light_dots = grey;
  }

  std::vector<Candidate> candidates;
  cv::Mat level = light_dots;
  for (int scale = 1; level.cols >= 24 && level.rows >= 24 && scale * 10 <= options.max_diameter_px; scale *= 2) {
    if (scale > 1) {
      cv::Mat smaller;
      // Pairs of pixels: an odd last row or column is left out.
      const cv::Rect even(0, 0, level.cols / 2 * 2, level.rows / 2 * 2);
      cv::resize(level(even), smaller, cv::Size(level.cols / 2, level.rows / 2), 0, 0, cv::INTER_AREA);
      level = smaller;
    }
    // Noise has no part in outlines, and takes long to follow.
    cv::Mat smooth;
    cv::GaussianBlur(level, smooth, cv::Size(3, 3), 0, 0, cv::BORDER_REPLICATE);
    for (const int threshold : GlobalLevels(smooth)) {
      AddCandidates(light_dots, smooth, threshold, scale, options, &candidates);
    }
    for (const int window_px : {scale == 1 ? 11 : 61, 25}) {
      // Lighter than around by more than noise.
      cv::Mat mean;
      cv::boxFilter(smooth, mean, -1, cv::Size(window_px, window_px), cv::Point(-1, -1), true, cv::BORDER_REPLICATE);
      cv::subtract(smooth, mean, mean);
      const int threshold = static_cast<int>(std::max(4.0, options.min_contrast_grey / 2));
      AddCandidates(light_dots, mean, threshold, scale, options, &candidates);
    }
  }
  return Cluster(std::move(candidates), options.polarity);
}

namespace {

// Parameters of the blurred ellipse.
enum Parameter {
  kCentreX,
  kCentreY,
  kShapeXX,
  kShapeXY,
  kShapeYY,
  kLogSigma,
  kOutside,
  kInside,
  kLightX,  // Relative to the light at the origin.
  kLightY,
  kInsideX,
  kInsideY,
  kNumParameters
};
using Parameters = Eigen::Matrix<double, kNumParameters, 1>;
using Normal = Eigen::Matrix<double, kNumParameters, kNumParameters>;

// The brightness that the model gives to a pixel, and its derivatives. The distance from the outline, to first order
// (exact on the outline and for circles), is (rho - 1) rho / |M u| with rho^2 = u' M u.
bool Predict(const Parameters& x, const Eigen::Vector2d& pixel, double* grey, Parameters* jacobian) {
  const Eigen::Vector2d u = pixel - x.head<2>();
  const Eigen::Vector2d mu(x[kShapeXX] * u.x() + x[kShapeXY] * u.y(), x[kShapeXY] * u.x() + x[kShapeYY] * u.y());
  const double q = u.dot(mu);
  const double g = mu.norm();
  if (!(q > 1e-8) || !(g > 1e-8)) return false;
  const double rho = std::sqrt(q);
  const double distance = (q - rho) / g;
  const double sigma = std::exp(x[kLogSigma]);
  const double z = distance / sigma;
  const bool is_flat = std::abs(z) > 7;
  const double share = is_flat ? (z < 0 ? 1 : 0) : 0.5 * std::erfc(z / std::sqrt(2.0));  // Of the inside.
  const double light = 1 + x[kLightX] * pixel.x() + x[kLightY] * pixel.y();
  const double outside = x[kOutside];
  const double inside = x[kInside] + x[kInsideX] * pixel.x() + x[kInsideY] * pixel.y();
  const double evenly_lit = outside + (inside - outside) * share;
  *grey = light * evenly_lit;
  if (jacobian == nullptr) return true;
  (*jacobian)[kOutside] = light * (1 - share);
  (*jacobian)[kLightX] = evenly_lit * pixel.x();
  (*jacobian)[kLightY] = evenly_lit * pixel.y();
  (*jacobian)[kInside] = light * share;
  (*jacobian)[kInsideX] = light * share * pixel.x();
  (*jacobian)[kInsideY] = light * share * pixel.y();
  if (is_flat) {
    jacobian->head<6>().setZero();
    return true;
  }

  const double by_z = -light * (inside - outside) * std::exp(-0.5 * z * z) / std::sqrt(2 * kPi);
  const double by_distance = by_z / sigma;
  const double by_q = by_distance * (1 - 0.5 / rho) / g;
  const double by_g = -by_distance * distance / g;
  // dg = (M u)' d(M u) / g.
  const Eigen::Vector2d m_mu(x[kShapeXX] * mu.x() + x[kShapeXY] * mu.y(), x[kShapeXY] * mu.x() + x[kShapeYY] * mu.y());
  jacobian->head<2>() = -2 * by_q * mu - by_g / g * m_mu;
  (*jacobian)[kShapeXX] = by_q * u.x() * u.x() + by_g / g * mu.x() * u.x();
  (*jacobian)[kShapeXY] = by_q * 2 * u.x() * u.y() + by_g / g * (mu.x() * u.y() + mu.y() * u.x());
  (*jacobian)[kShapeYY] = by_q * u.y() * u.y() + by_g / g * mu.y() * u.y();
  (*jacobian)[kLogSigma] = -by_z * z;
  return true;
}

// Huber's cost and weight with the bend at `bend`.
double HuberCost(double r, double bend) {
  const double size = std::abs(r);
  return size <= bend ? r * r : bend * (2 * size - bend);
}
double HuberWeight(double r, double bend) { return std::abs(r) <= bend ? 1 : bend / std::abs(r); }

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
    const Eigen::Vector2d extent = outline.ExtentPx().array() + margin_px + 1;
    const int x0 = std::max(0, static_cast<int>(std::floor(outline.centre_px.x() - extent.x())));
    const int x1 = std::min(grey_.cols - 1, static_cast<int>(std::ceil(outline.centre_px.x() + extent.x())));
    const int y0 = std::max(0, static_cast<int>(std::floor(outline.centre_px.y() - extent.y())));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(std::ceil(outline.centre_px.y() + extent.y())));
    const bool is_float = grey_.type() == CV_32FC1;
    samples_.clear();
    for (int row = y0; row <= y1; row += stride) {
      const uchar* line = grey_.ptr<uchar>(row);
      for (int column = x0; column <= x1; column += stride) {
        const Eigen::Vector2d u = Eigen::Vector2d(column, row) - outline.centre_px;
        const Eigen::Vector2d mu = outline.shape * u;
        const double rho = std::sqrt(u.dot(mu));
        const double distance_px = rho > 1e-6 ? (rho - 1) * rho / mu.norm() : -radius_px_;
        if (std::abs(distance_px) > margin_px) continue;
        if (options.next_outline_ratio > 0 && rho > 1) {
          const double gradient = mu.norm() / rho;  // Of rho, 1/px.
          const double gap_px = (options.next_outline_ratio - 1) / gradient;
          if ((options.next_outline_ratio - rho) / gradient < std::min(reach_px, 0.5 * gap_px)) continue;
        }
        PixelSample sample;
        sample.pixel = (Eigen::Vector2d(column, row) - origin_px_) / radius_px_;
        sample.grey = is_float ? grey_.at<float>(row, column) : line[column];
        sample.distance_px = distance_px;
        sample.sector = static_cast<int>((std::atan2(u.y(), u.x()) / (2 * kPi) + 0.5) * kNumSectors) % kNumSectors;
        samples_.push_back(sample);
      }
    }
  }

  // Brightness inside and outside from the samples. False if there are too few.
  bool StartLevels(double margin_px) {
    const double inside_px = std::min(0.5 * margin_px, 0.3 * Outline().SemiAxesPx().y());
    double outside_px = 0;
    for (const PixelSample& sample : samples_) outside_px = std::max(outside_px, 0.5 * sample.distance_px);
    double sum_inside = 0;
    double sum_outside = 0;
    int num_inside = 0;
    int num_outside = 0;
    for (const PixelSample& sample : samples_) {
      if (sample.distance_px < -inside_px) {
        sum_inside += sample.grey;
        ++num_inside;
      } else if (sample.distance_px > outside_px) {
        sum_outside += sample.grey;
        ++num_outside;
      }
    }
    if (num_inside < 1 || num_outside < 4) return false;
    x_[kInside] = sum_inside / num_inside;
    x_[kOutside] = sum_outside / num_outside;
    return true;
  }

  // False if what comes out is no ellipse.
  bool Fit() { return samples_.size() >= kNumParameters + 4u && Minimise(num_free_, &x_); }

  // With a slope of the inside alone (gloss, a dirty dot) where the picture asks for it.
  bool FitWithNeededSlopes() {
    if (!Fit()) return false;
    if (num_free_ != kInsideX) return true;
    Parameters sloping = x_;
    if (!Minimise(kNumParameters, &sloping)) return true;
    // Chi-square of two, exceeded by chance once in 3000: rarely enough not to widen the scatter of even ones.
    constexpr double kMinGain = 16;
    if (static_cast<double>(samples_.size()) * (Cost(x_) / Cost(sloping) - 1) > kMinGain) {
      x_ = sloping;
      num_free_ = kNumParameters;
    }
    return true;
  }

  // From the residuals: what counts as an outlier, and which sectors of the outline do not agree with the rest. Whether
  // those have changed.
  bool Judge() {
    std::vector<double> sizes;
    std::array<double, kNumSectors> sums{};
    std::array<int, kNumSectors> counts{};
    for (const PixelSample& sample : samples_) {
      double predicted;
      if (!Predict(x_, sample.pixel, &predicted, nullptr)) continue;
      const double residual = predicted - sample.grey;
      sizes.push_back(std::abs(residual));
      sums[sample.sector] += residual * residual;
      ++counts[sample.sector];
    }
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    // Where the flat parts are saturated, the edge alone has residuals: those are no outliers.
    bend_ = std::max(2.5 * 1.4826 * *middle, 0.05 * std::abs(Contrast()));

    std::vector<double> squares;
    for (int i = 0; i < kNumSectors; ++i) {
      sums[i] /= std::max(counts[i], 1);
      squares.push_back(sums[i]);
    }
    const auto middle_square = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
    std::nth_element(squares.begin(), middle_square, squares.end());
    const double limit = std::max(4 * *middle_square, std::pow(0.12 * Contrast(), 2));
    bool changed = false;
    for (int i = 0; i < kNumSectors; ++i) {
      const bool hidden = sums[i] > limit;
      changed = changed || hidden != hidden_[i];
      hidden_[i] = hidden;
    }
    return changed;
  }

  RefinedEllipse Result() const {
    RefinedEllipse refined;
    refined.ellipse = Outline();
    refined.blur_sigma_px = SigmaPx();
    refined.contrast_grey = Contrast();
    refined.visible_ratio =
        1 - static_cast<double>(std::count(hidden_.begin(), hidden_.end(), true)) / static_cast<double>(kNumSectors);
    double sum_square = 0;
    double sum_weighted = 0;
    double num_samples = 0;
    for (const PixelSample& sample : samples_) {
      double predicted;
      if (hidden_[sample.sector] || !Predict(x_, sample.pixel, &predicted, nullptr)) continue;
      const double residual = predicted - sample.grey;
      sum_square += residual * residual;
      sum_weighted += HuberWeight(residual, bend_) * residual * residual;
      num_samples += 1;
    }
    refined.residual_ratio = std::sqrt(sum_square / num_samples) / std::abs(refined.contrast_grey);
    Parameters gradient;
    const Normal normal = NormalMatrix(x_, num_free_, &gradient);
    const Normal covariance = normal.ldlt().solve(Normal::Identity());
    // Rounding alone has a variance of 1/12.
    const double variance = std::max(sum_weighted / std::max(num_samples - num_free_, 1.0), 1.0 / 12);
    refined.centre_covariance_px2 = radius_px_ * radius_px_ * variance * covariance.topLeftCorner<2, 2>();
    return refined;
  }

 private:
  static constexpr int kNumSectors = 24;
  struct PixelSample {
    Eigen::Vector2d pixel;
    double grey;
    double distance_px;
    int sector;
  };

  double Cost(const Parameters& x) const {
    double cost = 0;
    for (const PixelSample& sample : samples_) {
      double grey;
      if (hidden_[sample.sector] || !Predict(x, sample.pixel, &grey, nullptr)) continue;
      cost += HuberCost(grey - sample.grey, bend_);
    }
    return cost;
  }

  Normal NormalMatrix(const Parameters& x, int num_free, Parameters* gradient) const {
    Normal normal = Normal::Zero();
    gradient->setZero();
    for (const PixelSample& sample : samples_) {
      double grey;
      Parameters row;
      if (hidden_[sample.sector] || !Predict(x, sample.pixel, &grey, &row)) continue;
      const double residual = grey - sample.grey;
      const double weight = HuberWeight(residual, bend_);
      normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      *gradient += weight * residual * row;
    }
    normal = normal.selfadjointView<Eigen::Lower>();
    for (int i = num_free; i < kNumParameters; ++i) Hold(i, &normal, gradient);
    return normal;
  }

  // Levenberg-Marquardt. False if a step cannot be found.
  bool Minimise(int num_free, Parameters* x) const {
    // A pixel's own width is that of a Gaussian of 0.29 px.
    const double min_log_sigma = std::log(0.29 / radius_px_);
    double cost = Cost(*x);
    double damping = 1e-3;
    constexpr int kMaxIterations = 30;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      Parameters gradient;
      Normal normal = NormalMatrix(*x, num_free, &gradient);
      if ((*x)[kLogSigma] <= min_log_sigma && gradient[kLogSigma] > 0) Hold(kLogSigma, &normal, &gradient);
      bool improved = false;
      bool converged = false;
      while (!improved && damping < 1e8) {
        Normal damped = normal;
        damped.diagonal() *= 1 + damping;
        const Parameters step = damped.ldlt().solve(-gradient);
        if (!step.allFinite()) return false;
        Parameters next = *x + step;
        next[kLogSigma] = std::max(next[kLogSigma], min_log_sigma);
        const bool is_ellipse = next[kShapeXX] > 0.05 &&
                                next[kShapeXX] * next[kShapeYY] - next[kShapeXY] * next[kShapeXY] > 0.05 &&
                                next.head<2>().norm() < 0.7 && next[kLogSigma] < 1;
        const double next_cost = is_ellipse ? Cost(next) : cost;
        if (is_ellipse && next_cost <= cost) {
          improved = true;
          converged = cost - next_cost <= 1e-7 * cost || step.head<6>().norm() < 1e-6;
          *x = next;
          cost = next_cost;
          damping = std::max(damping * 0.1, 1e-9);
        } else {
          damping *= 10;
        }
      }
      if (!improved || converged) return true;
    }
    return true;
  }

  const cv::Mat& grey_;
  const Eigen::Vector2d origin_px_;
  const double radius_px_;
  Parameters x_ = Parameters::Zero();
  int num_free_ = kNumParameters;
  double bend_ = 1e6;  // Grey levels; nothing is an outlier at first.
  std::array<bool, kNumSectors> hidden_{};
  std::vector<PixelSample> samples_;
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
  constexpr double kMaxFirstSamples = 2500;
  fit.Sample(first_margin_px, options, kMaxFirstSamples);
  if (!fit.StartLevels(first_margin_px) || !fit.Fit()) return std::nullopt;
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
    if (!fit.Fit()) return std::nullopt;
    const bool other_parts = fit.Judge();
    if (!other_parts && std::abs(margin_px() - used_px) < 0.2 * used_px) break;
  }
  if (!fit.FitWithNeededSlopes() || !fit.IsInPicture()) return std::nullopt;
  if (!(std::abs(fit.Contrast()) > 1)) return std::nullopt;
  const RefinedEllipse refined = fit.Result();
  if (!refined.centre_covariance_px2.allFinite() || !std::isfinite(refined.residual_ratio)) return std::nullopt;
  return refined;
}

}  // namespace heba
