#include "targets/ellipse_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/units.h"

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
  return values[static_cast<size_t>(share * (values.size() - 1) + 0.5)];
}

// Contours of the light areas of `binary`, as candidates in the pixels of the picture `grey` (light dots), of which
// `binary` is a version smaller by `scale`.
void AddCandidates(const cv::Mat& grey, const cv::Mat& binary, int scale, const EllipseFinderOptions& options,
                   std::vector<Candidate>* candidates) {
  std::vector<std::vector<cv::Point>> contours;
  std::vector<cv::Vec4i> hierarchy;
  cv::findContours(binary, contours, hierarchy, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  // Of a pyramid's level, the dots that the next level cannot show better, with a wide overlap.
  const double min_px = scale == 1 ? options.min_diameter_px : 10.0 * scale;
  for (size_t index = 0; index < contours.size(); ++index) {
    const std::vector<cv::Point>& contour = contours[index];
    const bool is_hole = hierarchy[index][3] >= 0;
    if (is_hole || contour.size() < 6) continue;
    const cv::Rect box = cv::boundingRect(contour);
    const double long_side_px = scale * std::max(box.width, box.height);
    if (long_side_px < min_px || long_side_px > options.max_diameter_px + 2) continue;
    if (box.x <= 0 || box.y <= 0 || box.x + box.width >= binary.cols || box.y + box.height >= binary.rows) continue;
    // A chain of n pixels turns once around an area of about n^2 / 4 pi if it is round.
    const double num_points = static_cast<double>(contour.size());
    const double area = cv::contourArea(contour) + num_points / 2 + 1;  // Pick's theorem: the number of pixels.
    if (area < 0.3 * box.width * box.height) continue;
    if (num_points > 2.6 * (box.width + box.height)) continue;

    const cv::RotatedRect fit = cv::fitEllipse(contour);
    // The contour runs through the centres of the outermost pixels.
    const double semi_a = fit.size.width / 2 + 0.5;
    const double semi_b = fit.size.height / 2 + 0.5;
    if (!(std::min(semi_a, semi_b) > 0.5) || !std::isfinite(semi_a) || !std::isfinite(semi_b)) continue;
    if (2 * std::min(semi_a, semi_b) * scale < options.min_diameter_px ||
        2 * std::max(semi_a, semi_b) * scale > options.max_diameter_px) {
      continue;
    }
    if (std::max(semi_a, semi_b) > options.max_axis_ratio * std::min(semi_a, semi_b)) continue;
    const double area_ratio = area / (kPi * semi_a * semi_b);
    const double area_tolerance = 0.08 + 0.7 / std::min(semi_a, semi_b);
    if (std::abs(area_ratio - 1) > area_tolerance) continue;

    Ellipse ellipse = Ellipse::FromAxes({fit.center.x, fit.center.y}, semi_a, semi_b, fit.angle * kPi / 180);
    // RMS distance of the contour from the ellipse through it.
    const Ellipse through = Ellipse::FromAxes(ellipse.centre_px, std::max(semi_a - 0.5, 0.5),
                                              std::max(semi_b - 0.5, 0.5), fit.angle * kPi / 180);
    double sum_square = 0;
    for (const cv::Point& point : contour) {
      const Eigen::Vector2d offset(point.x - ellipse.centre_px.x(), point.y - ellipse.centre_px.y());
      const double rho = std::sqrt(offset.dot(through.shape * offset));
      const double gradient = rho > 1e-9 ? (through.shape * offset).norm() / rho : 1;
      sum_square += std::pow((rho - 1) / gradient, 2);
    }
    const double roughness = std::sqrt(sum_square / num_points);
    if (roughness > 0.4 + 0.03 * std::sqrt(semi_a * semi_b)) continue;

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
    const double relative_roughness = scale * roughness / ellipse.RadiusPx();
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
    cv::Mat binary;
    for (const int threshold : GlobalLevels(level)) {
      cv::threshold(level, binary, threshold, 255, cv::THRESH_BINARY);
      AddCandidates(light_dots, binary, scale, options, &candidates);
    }
    for (const int window_px : {11, 25, 61}) {
      // Lighter than around by more than noise.
      cv::Mat mean;
      cv::boxFilter(level, mean, -1, cv::Size(window_px, window_px), cv::Point(-1, -1), true, cv::BORDER_REPLICATE);
      cv::subtract(level, mean, binary);
      cv::threshold(binary, binary, std::max(4.0, options.min_contrast_grey / 2), 255, cv::THRESH_BINARY);
      AddCandidates(light_dots, binary, scale, options, &candidates);
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
  kOutsideX,
  kOutsideY,
  kInsideX,
  kInsideY,
  kNumParameters
};
using Parameters = Eigen::Matrix<double, kNumParameters, 1>;
using Normal = Eigen::Matrix<double, kNumParameters, kNumParameters>;

struct Sample {
  Eigen::Vector2d pixel;  // Relative to the start's centre, in its radii.
  double grey;
};

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
  const double outside = x[kOutside] + x[kOutsideX] * pixel.x() + x[kOutsideY] * pixel.y();
  const double inside = x[kInside] + x[kInsideX] * pixel.x() + x[kInsideY] * pixel.y();
  *grey = outside + (inside - outside) * share;
  if (jacobian == nullptr) return true;
  (*jacobian)[kOutside] = 1 - share;
  (*jacobian)[kOutsideX] = (1 - share) * pixel.x();
  (*jacobian)[kOutsideY] = (1 - share) * pixel.y();
  (*jacobian)[kInside] = share;
  (*jacobian)[kInsideX] = share * pixel.x();
  (*jacobian)[kInsideY] = share * pixel.y();
  if (is_flat) {
    jacobian->head<6>().setZero();
    return true;
  }

  const double by_z = -(inside - outside) * std::exp(-0.5 * z * z) / std::sqrt(2 * kPi);
  const double by_distance = by_z / sigma;
  const double by_q = by_distance * (1 - 0.5 / rho) / g;
  const double by_g = -by_distance * distance / g;
  // dg = (M u)' d(M u) / g.
  const Eigen::Vector2d m_mu(x[kShapeXX] * mu.x() + x[kShapeXY] * mu.y(),
                             x[kShapeXY] * mu.x() + x[kShapeYY] * mu.y());
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

double Cost(const Parameters& x, const std::vector<Sample>& samples, double bend) {
  double cost = 0;
  for (const Sample& sample : samples) {
    double grey;
    if (Predict(x, sample.pixel, &grey, nullptr)) cost += HuberCost(grey - sample.grey, bend);
  }
  return cost;
}

// Keeps a parameter where it is.
void Hold(int parameter, Normal* normal, Parameters* gradient) {
  normal->row(parameter).setZero();
  normal->col(parameter).setZero();
  (*normal)(parameter, parameter) = 1;
  (*gradient)[parameter] = 0;
}

Normal NormalMatrix(const Parameters& x, const std::vector<Sample>& samples, double bend, int num_free,
                    Parameters* gradient) {
  Normal normal = Normal::Zero();
  gradient->setZero();
  for (const Sample& sample : samples) {
    double grey;
    Parameters row;
    if (!Predict(x, sample.pixel, &grey, &row)) continue;
    const double residual = grey - sample.grey;
    const double weight = HuberWeight(residual, bend);
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    *gradient += weight * residual * row;
  }
  normal = normal.selfadjointView<Eigen::Lower>();
  for (int i = num_free; i < kNumParameters; ++i) Hold(i, &normal, gradient);
  return normal;
}

// Levenberg-Marquardt. False if it leaves what can be an ellipse.
bool Fit(const std::vector<Sample>& samples, double bend, int num_free, double min_log_sigma, Parameters* x) {
  double cost = Cost(*x, samples, bend);
  double damping = 1e-3;
  for (int iteration = 0; iteration < 30; ++iteration) {
    Parameters gradient;
    Normal normal = NormalMatrix(*x, samples, bend, num_free, &gradient);
    if ((*x)[kLogSigma] <= min_log_sigma && gradient[kLogSigma] > 0) Hold(kLogSigma, &normal, &gradient);
    bool improved = false;
    double change = 0;
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
      const double next_cost = is_ellipse ? Cost(next, samples, bend) : cost + 1;
      if (is_ellipse && next_cost <= cost) {
        change = cost - next_cost;
        *x = next;
        improved = true;
        damping = std::max(damping * 0.1, 1e-9);
        if (step.head<6>().norm() < 1e-6) change = 0;
        cost = next_cost;
      } else {
        damping *= 10;
      }
    }
    if (!improved || change <= 1e-7 * cost) return true;
  }
  return true;
}

}  // namespace

std::optional<RefinedEllipse> RefineEllipse(const cv::Mat& grey, const Ellipse& start,
                                            const RefineEllipseOptions& options) {
  CHECK_EQ(grey.type(), CV_8UC1);
  const double radius_px = start.RadiusPx();
  const Eigen::Vector2d origin_px = start.centre_px;
  if (!(radius_px > 1) || !origin_px.allFinite()) return std::nullopt;

  Parameters x = Parameters::Zero();
  x[kShapeXX] = start.shape(0, 0) * radius_px * radius_px;
  x[kShapeXY] = start.shape(0, 1) * radius_px * radius_px;
  x[kShapeYY] = start.shape(1, 1) * radius_px * radius_px;
  x[kLogSigma] = std::log(1.0 / radius_px);

  constexpr int kNumRounds = 3;
  constexpr double kMinSlopeGain = 14;  // Chi-square of four, exceeded by chance once in a hundred.
  std::vector<Sample> samples;
  double bend = 0;
  double margin_px = 0;
  // Slopes need some area to be told from the dot's place.
  int num_free = radius_px < 3 ? static_cast<int>(kOutsideX) : static_cast<int>(kNumParameters);
  // A pixel's own width is that of a Gaussian of 0.29 px.
  const double min_log_sigma = std::log(0.29 / radius_px);
  const double max_margin_px = std::max(options.max_margin_px, 1.5);
  for (int round = 0; round < kNumRounds; ++round) {
    Eigen::Matrix2d shape;
    shape << x[kShapeXX], x[kShapeXY], x[kShapeXY], x[kShapeYY];
    const Ellipse current{origin_px + radius_px * x.head<2>(), shape / (radius_px * radius_px)};
    const double sigma_px = radius_px * std::exp(x[kLogSigma]);
    const double wanted_px = round == 0 ? std::max(3.0, 0.15 * radius_px) : std::clamp(4 * sigma_px, 3.0, radius_px);
    margin_px = std::min(wanted_px, max_margin_px);
    const Eigen::Vector2d extent = current.ExtentPx();
    // A dot that just touches the border is as good as whole.
    const double beyond_px = 0.1 * current.RadiusPx();
    if (((current.centre_px - extent).array() < -0.5 - beyond_px).any() ||
        current.centre_px.x() + extent.x() > grey.cols - 0.5 + beyond_px ||
        current.centre_px.y() + extent.y() > grey.rows - 0.5 + beyond_px) {
      return std::nullopt;
    }
    // The first round need not use all pixels.
    constexpr double kMaxFirstSamples = 2500;
    const double num_expected = 4 * kPi * current.RadiusPx() * margin_px;
    const int stride = round > 0 ? 1 : std::max(1, static_cast<int>(std::sqrt(num_expected / kMaxFirstSamples)));
    const Eigen::Vector2d reach = extent.array() + margin_px + 1;
    const double inside_px = std::min(0.5 * margin_px, 0.3 * current.SemiAxesPx().y());
    const int x0 = std::max(0, static_cast<int>(std::floor(current.centre_px.x() - reach.x())));
    const int x1 = std::min(grey.cols - 1, static_cast<int>(std::ceil(current.centre_px.x() + reach.x())));
    const int y0 = std::max(0, static_cast<int>(std::floor(current.centre_px.y() - reach.y())));
    const int y1 = std::min(grey.rows - 1, static_cast<int>(std::ceil(current.centre_px.y() + reach.y())));
    samples.clear();
    double sum_inside = 0;
    double sum_outside = 0;
    int num_inside = 0;
    int num_outside = 0;
    for (int row = y0; row <= y1; row += stride) {
      const uchar* line = grey.ptr<uchar>(row);
      for (int column = x0; column <= x1; column += stride) {
        const Eigen::Vector2d u = Eigen::Vector2d(column, row) - current.centre_px;
        const Eigen::Vector2d mu = current.shape * u;
        const double rho = std::sqrt(u.dot(mu));
        const double distance_px = rho > 1e-6 ? (rho - 1) * rho / mu.norm() : -radius_px;
        if (std::abs(distance_px) > margin_px) continue;
        samples.push_back({(Eigen::Vector2d(column, row) - origin_px) / radius_px, static_cast<double>(line[column])});
        if (distance_px < -inside_px) {
          sum_inside += line[column];
          ++num_inside;
        } else if (distance_px > 0.5 * margin_px) {
          sum_outside += line[column];
          ++num_outside;
        }
      }
    }
    if (num_inside < 1 || num_outside < 4 || samples.size() < num_free + 4u) return std::nullopt;
    if (round == 0) {
      x[kInside] = sum_inside / num_inside;
      x[kOutside] = sum_outside / num_outside;
      bend = 1e6;
    }
    if (!Fit(samples, bend, num_free, min_log_sigma, &x)) return std::nullopt;
    if (round == kNumRounds - 1 && num_free > kOutsideX) {
      // Slopes cost a third of the precision: only where the picture asks for them.
      Parameters even = x;
      even.tail<kNumParameters - kOutsideX>().setZero();
      const double cost = Cost(x, samples, bend);
      if (Fit(samples, bend, kOutsideX, min_log_sigma, &even) &&
          static_cast<double>(samples.size()) * (Cost(even, samples, bend) / cost - 1) < kMinSlopeGain) {
        x = even;
        num_free = kOutsideX;
      }
    }
    std::vector<double> sizes;
    for (const Sample& sample : samples) {
      double predicted;
      if (Predict(x, sample.pixel, &predicted, nullptr)) sizes.push_back(std::abs(predicted - sample.grey));
    }
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    // Where the flat parts are saturated, the edge alone has residuals: those are no outliers.
    bend = std::max(2.5 * 1.4826 * *middle, 0.05 * std::abs(x[kInside] - x[kOutside]));
  }

  RefinedEllipse refined;
  Eigen::Matrix2d shape;
  shape << x[kShapeXX], x[kShapeXY], x[kShapeXY], x[kShapeYY];
  refined.ellipse = {origin_px + radius_px * x.head<2>(), shape / (radius_px * radius_px)};
  refined.blur_sigma_px = radius_px * std::exp(x[kLogSigma]);
  // The planes' difference at the centre is their mean difference on the outline.
  refined.contrast_grey = x[kInside] - x[kOutside] + (x[kInsideX] - x[kOutsideX]) * x[kCentreX] +
                          (x[kInsideY] - x[kOutsideY]) * x[kCentreY];
  double sum_square = 0;
  double sum_weighted = 0;
  int num_outliers = 0;
  for (const Sample& sample : samples) {
    double predicted;
    if (!Predict(x, sample.pixel, &predicted, nullptr)) continue;
    const double residual = predicted - sample.grey;
    sum_square += residual * residual;
    sum_weighted += HuberWeight(residual, bend) * residual * residual;
    if (std::abs(residual) > std::max(bend, 0.15 * std::abs(refined.contrast_grey))) ++num_outliers;
  }
  const double num_samples = static_cast<double>(samples.size());
  if (!(std::abs(refined.contrast_grey) > 1)) return std::nullopt;
  refined.residual_ratio = std::sqrt(sum_square / num_samples) / std::abs(refined.contrast_grey);
  refined.outlier_ratio = num_outliers / num_samples;
  Parameters gradient;
  const Normal normal = NormalMatrix(x, samples, bend, num_free, &gradient);
  const Normal covariance = normal.ldlt().solve(Normal::Identity());
  const double variance = std::max(sum_weighted / (num_samples - num_free), 0.08);
  refined.centre_stddev_px = radius_px * std::sqrt(0.5 * variance * (covariance(0, 0) + covariance(1, 1)));
  if (!std::isfinite(refined.centre_stddev_px)) return std::nullopt;
  return refined;
}

}  // namespace heba
