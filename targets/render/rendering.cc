// The image of a plane of piecewise constant albedo is a sum over its edges. Let k(x) k(y) be the kernel of a pixel,
// that is, its own box convolved with the blur, and K the integral of k. Green's theorem gives the value at pixel
// (i, j) as
//   value(i, j) = sum over edges of the integral of jump(s) K(i - x(s)) k(j - y(s)) dy(s)
// The differences value(i, j) - value(i - 1, j) are therefore accumulated from the edges within the reach of the
// kernel, by Gauss-Legendre quadrature along their projections, and each row is summed up from the left. There is no
// sampling grid and therefore no bias caused by one.
#include "targets/render/rendering.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "targets/render/clutter.h"
#include "targets/render/drawing_edges.h"

namespace heba {
namespace {

constexpr double kBackAlbedo = 0.6;  // Albedo of the back of the sheet.

// Streams of random numbers; the rows of the image use the streams from kFirstRow on.
enum Stream : uint64_t { kLight, kClutter, kFirstRow };

// The kernel k(s), a box convolved with a Gaussian, and the steps K(s) - K(s - 1) of its integral, interpolated from
// a lookup table at integer distances from any position.
class PixelKernel {
 public:
  explicit PixelKernel(double sigma_px) : sigma_px_(std::max(sigma_px, 0.02)) {
    constexpr double kReachSigmas = 4.5;  // A share of 7e-6 of a Gaussian lies beyond.
    reach_ = static_cast<int>(std::ceil(0.5 + kReachSigmas * sigma_px_));
    // This many entries keep the error of linear interpolation below 1e-5.
    num_places_ = std::clamp(static_cast<int>(64 / sigma_px_), 128, 4096);
    values_.resize((num_places_ + 1) * size());
    steps_.resize((num_places_ + 1) * size());
    for (int place = 0; place <= num_places_; ++place) {
      const double fraction = static_cast<double>(place) / num_places_;
      double* const values = &values_[place * size()];
      double* const steps = &steps_[place * size()];
      double sum = 0;
      double sum_of_steps = 0;
      for (int i = 0; i < size(); ++i) {
        const double s = i - reach_ - fraction;
        sum += values[i] = GaussianIntegral(s + 0.5) - GaussianIntegral(s - 0.5);
        sum_of_steps += steps[i] = KernelIntegral(s) - KernelIntegral(s - 1);
      }
      for (int i = 0; i < size(); ++i) {
        values[i] /= sum;
        steps[i] /= sum_of_steps;
      }
    }
  }

  double sigma_px() const { return sigma_px_; }
  // Returns the distance in pixels beyond which the kernel is zero.
  int reach() const { return reach_; }
  // Returns the length of the vectors below, whose entry i belongs to pixel floor(at) - reach + i.
  int size() const { return 2 * reach_ + 3; }
  void Values(double at, double* out) const { Interpolate(values_, at, out); }
  void Steps(double at, double* out) const { Interpolate(steps_, at, out); }

 private:
  double GaussianIntegral(double s) const { return 0.5 * std::erfc(-s / (sigma_px_ * std::sqrt(2.0))); }
  double SecondIntegral(double s) const {
    const double z = s / sigma_px_;
    return s * GaussianIntegral(s) + sigma_px_ * std::exp(-0.5 * z * z) / std::sqrt(2 * kPi);
  }
  double KernelIntegral(double s) const { return SecondIntegral(s + 0.5) - SecondIntegral(s - 0.5); }

  void Interpolate(const std::vector<double>& table, double at, double* out) const {
    const double place = (at - std::floor(at)) * num_places_;
    const int low = std::min(static_cast<int>(place), num_places_ - 1);
    const double weight = place - low;
    const double* const a = &table[low * size()];
    const double* const b = a + size();
    for (int i = 0; i < size(); ++i) out[i] = a[i] + weight * (b[i] - a[i]);
  }

  double sigma_px_;
  int reach_ = 0;
  int num_places_ = 0;
  std::vector<double> values_;
  std::vector<double> steps_;
};

// A quadratic curve in the image, given by its points at t = 0, 1/2 and 1.
struct Parabola {
  Parabola(const Eigen::Vector2d& p0, const Eigen::Vector2d& p1, const Eigen::Vector2d& p2)
      : constant(p0), linear(4 * p1 - 3 * p0 - p2), square(2 * (p0 + p2) - 4 * p1) {}
  Eigen::Vector2d At(double t) const { return constant + t * (linear + t * square); }
  Eigen::Vector2d Derivative(double t) const { return linear + 2 * t * square; }

  Eigen::Vector2d constant;
  Eigen::Vector2d linear;
  Eigen::Vector2d square;
};

// The albedo of a scene, and the share of each pixel in which a sheet is (CV_32FC1).
struct SheetPixels {
  SheetPixels(int width_px, int height_px) : albedo(height_px, width_px, CV_32FC1), on_sheet(albedo.size(), CV_32FC1) {}
  cv::Mat albedo;
  cv::Mat on_sheet;
};

// Accumulates the contributions of edges to the image.
class EdgeSum {
 public:
  EdgeSum(int width_px, int height_px, const PixelKernel& kernel)
      : kernel_(kernel),
        width_(width_px),
        height_(height_px),
        margin_(kernel.reach() + 3),
        pad_(2 * kernel.reach() + 6),
        stride_(width_px + 2 * pad_),
        albedo_steps_(static_cast<size_t>(stride_) * (height_px + 2 * pad_)),
        sheet_steps_(albedo_steps_.size()),
        left_albedo_steps_(height_px + 2 * pad_),
        left_sheet_steps_(height_px + 2 * pad_),
        values_(kernel.size()),
        steps_(kernel.size()) {}

  // Only edges within [low, high] contribute.
  Eigen::Vector2d low() const { return {-margin_, -margin_}; }
  Eigen::Vector2d high() const { return {width_ - 1 + margin_, height_ - 1 + margin_}; }

  // Adds an edge no longer than about two pixels. `positive` is the side in the curve's direction rotated by 90
  // degrees from x towards y.
  void Add(const Parabola& curve, const SheetValue& positive, const SheetValue& negative) {
    const double albedo_jump = negative.albedo - positive.albedo;
    const double sheet_jump = negative.on_sheet - positive.on_sheet;
    // The curve is cut where it crosses the left border of the region.
    std::array<double, 4> cuts = {0, 1, 1, 1};
    int num_cuts = 1;
    bool inside = true;
    const double left = low().x();
    const double x0 = curve.constant.x() - left;
    const double x1 = curve.At(1).x() - left;
    if (x0 < 0 || x1 < 0) {
      inside = x0 >= 0;
      const std::array<double, 2> roots = Roots(curve.square.x(), curve.linear.x(), x0);
      const bool crosses_once = (x0 < 0) != (x1 < 0);
      if (crosses_once) {
        // Rounding may put the root slightly outside [0, 1].
        const auto outside = [](double t) { return std::abs(t - std::clamp(t, 0.0, 1.0)); };
        const double root = outside(roots[0]) < outside(roots[1]) ? roots[0] : roots[1];
        cuts[num_cuts++] = std::clamp(root, 0.0, 1.0);
      } else if (roots[0] > 0 && roots[1] < 1 && roots[0] < roots[1]) {
        cuts[num_cuts++] = roots[0];
        cuts[num_cuts++] = roots[1];
      }
      for (int i = 1; i < num_cuts; ++i) {
        const double sign = crosses_once ? (x1 > x0 ? 1 : -1) : (i == 1 ? 1 : -1);
        AddAtLeft(curve.At(cuts[i]).y(), -sign * albedo_jump, -sign * sheet_jump);
      }
    }
    cuts[num_cuts] = 1;
    for (int i = 0; i < num_cuts; ++i, inside = !inside) {
      if (inside) Integrate(curve, cuts[i], cuts[i + 1], albedo_jump, sheet_jump);
    }
  }

  // Returns the integral of the sums over the image; `corner` is the value of the scene at low().
  SheetPixels Pixels(const SheetValue& corner) const {
    SheetPixels pixels(width_, height_);
    double left_albedo = corner.albedo;
    double left_sheet = corner.on_sheet;
    for (int row = -pad_; row < height_; ++row) {
      left_albedo += left_albedo_steps_[row + pad_];
      left_sheet += left_sheet_steps_[row + pad_];
      if (row < 0) continue;
      const double* const albedo_steps = &albedo_steps_[static_cast<size_t>(row + pad_) * stride_];
      const double* const sheet_steps = &sheet_steps_[static_cast<size_t>(row + pad_) * stride_];
      float* const albedo_row = pixels.albedo.ptr<float>(row);
      float* const sheet_row = pixels.on_sheet.ptr<float>(row);
      double albedo_sum = left_albedo;
      double sheet_sum = left_sheet;
      for (int i = 0; i < pad_; ++i) {
        albedo_sum += albedo_steps[i];
        sheet_sum += sheet_steps[i];
      }
      for (int column = 0; column < width_; ++column) {
        albedo_row[column] = static_cast<float>(albedo_sum += albedo_steps[column + pad_]);
        sheet_row[column] = static_cast<float>(sheet_sum += sheet_steps[column + pad_]);
      }
    }
    return pixels;
  }

 private:
  // Returns the roots of a t^2 + b t + c in increasing order, or values far outside [0, 1] if there are none.
  static std::array<double, 2> Roots(double a, double b, double c) {
    constexpr double kNone = 1e9;
    const double discriminant = b * b - 4 * a * c;
    if (discriminant < 0) return {kNone, kNone};
    const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    const double first = q != 0 ? c / q : kNone;
    const double second = a != 0 ? q / a : kNone;
    return {std::min(first, second), std::max(first, second)};
  }

  // Records that an edge crosses the left border of the region at `y`; the jumps are from above to below.
  void AddAtLeft(double y, double albedo_jump, double sheet_jump) {
    if (!(y > low().y() && y < high().y())) return;
    kernel_.Steps(y, steps_.data());
    const int first = static_cast<int>(std::floor(y)) - kernel_.reach() + pad_;
    for (int i = 0; i < kernel_.size(); ++i) {
      left_albedo_steps_[first + i] += albedo_jump * steps_[i];
      left_sheet_steps_[first + i] += sheet_jump * steps_[i];
    }
  }

  void Integrate(const Parabola& curve, double begin, double end, double albedo_jump, double sheet_jump) {
    // Three nodes per panel of 1.6 sigma integrate the kernel to 1e-4.
    const double length_px = (curve.linear.norm() + curve.square.norm()) * (end - begin);
    const int num_panels = static_cast<int>(std::ceil(length_px / std::min(1.0, 1.6 * kernel_.sigma_px())));
    constexpr double kNodes[] = {-0.7745966692414834, 0.0, 0.7745966692414834};
    constexpr double kWeights[] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
    const double half = 0.5 * (end - begin) / num_panels;
    for (int panel = 0; panel < num_panels; ++panel) {
      for (int node = 0; node < 3; ++node) {
        const double t = begin + half * (2 * panel + 1 + kNodes[node]);
        const double dy = curve.Derivative(t).y() * half * kWeights[node];
        AddNode(curve.At(t), albedo_jump * dy, sheet_jump * dy);
      }
    }
  }

  void AddNode(const Eigen::Vector2d& at, double albedo_weight, double sheet_weight) {
    if (!(at.x() < high().x() && at.y() > low().y() && at.y() < high().y())) return;
    kernel_.Values(at.y(), values_.data());
    kernel_.Steps(at.x(), steps_.data());
    const int size = kernel_.size();
    const int column = static_cast<int>(std::floor(at.x())) - kernel_.reach() + pad_;
    const int row = static_cast<int>(std::floor(at.y())) - kernel_.reach() + pad_;
    const size_t first = static_cast<size_t>(row) * stride_ + column;
    const auto add = [&](std::vector<double>& sums, double weight) {
      if (weight == 0) return;
      for (int j = 0; j < size; ++j) {
        const double row_weight = weight * values_[j];
        double* const sum = &sums[first + static_cast<size_t>(j) * stride_];
        for (int i = 0; i < size; ++i) sum[i] += row_weight * steps_[i];
      }
    };
    add(albedo_steps_, albedo_weight);
    add(sheet_steps_, sheet_weight);
  }

  const PixelKernel& kernel_;
  int width_;
  int height_;
  int margin_;  // Margin around the image within which edges contribute.
  int pad_;     // Padding of the arrays, which hold the kernels of all points within the margin.
  int stride_;
  std::vector<double> albedo_steps_;
  std::vector<double> sheet_steps_;
  std::vector<double> left_albedo_steps_;
  std::vector<double> left_sheet_steps_;
  std::vector<double> values_;
  std::vector<double> steps_;
};

// The sheet of a target in front of a camera. The bending of the sheet affects where its points are seen, but not
// which side of it is visible: the sheet is assumed not to hide any part of itself.
class SheetView {
 public:
  SheetView(const Camera& camera, const Rigid3d& camera_from_target, const TargetShape& shape, const EdgeSum& sum)
      : camera_(camera),
        model_(camera.Model()),
        shape_(shape),
        origin_(camera_from_target.translation),
        rotation_(camera_from_target.RotationMatrix()),
        facing_(origin_.dot(rotation_.col(2))) {
    FindLimit(sum);
  }

  // Returns a value that is positive if the normal of the plane points away from the camera; x then rotates into y in
  // the image as it does in the plane.
  double facing_m() const { return facing_; }
  // Returns whether some pixels have no ray because the distortion folds back within the image.
  bool folds() const { return folds_; }

  // Projects a point of the sheet. Returns nothing if it is not visible, or lies so far aside that it would be
  // projected onto the image of another ray.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector2d& point_in_target) {
    const Eigen::Vector3d designed(point_in_target.x(), point_in_target.y(), 0);
    const Eigen::Vector3d point_in_camera = origin_ + rotation_ * ApplyShape(designed, shape_);
    if (point_in_camera.z() < min_cosine_ * point_in_camera.norm()) return std::nullopt;
    return ProjectRay(point_in_camera);
  }
  // Returns the point at which a ray hits the sheet, in coordinates of the design; nothing if it is behind the
  // camera.
  std::optional<Eigen::Vector2d> Hit(const Eigen::Vector3d& ray_in_camera) const {
    const double approach = ray_in_camera.dot(rotation_.col(2));
    if (approach * facing_ <= 0) return std::nullopt;
    // The intersection with the plane is computed first, then repeatedly that at the height of the sheet found there.
    Eigen::Vector3d designed = Eigen::Vector3d::Zero();
    double height_m = 0;
    constexpr int kNumSteps = 8;
    for (int step = 0; step < kNumSteps; ++step) {
      const double depth = (facing_ + height_m) / approach;
      const Eigen::Vector3d point_in_target = rotation_.transpose() * (ray_in_camera * depth - origin_);
      designed = {point_in_target.x() / shape_.params[0], point_in_target.y() / shape_.params[1], 0};
      height_m = ApplyShape(designed, shape_).z();
    }
    return designed.head<2>();
  }
  SheetValue ValueAt(const DrawingEdges& drawing, const std::optional<Eigen::Vector3d>& ray_in_camera) const {
    if (!ray_in_camera || ray_in_camera->z() < min_cosine_) return {};
    const std::optional<Eigen::Vector2d> point_in_target = Hit(*ray_in_camera);
    return point_in_target ? drawing.ValueAt(*point_in_target) : SheetValue();
  }
  // Returns a ray at the limit of the visible cone, at `angle_rad` about the optical axis.
  Eigen::Vector3d LimitRay(double angle_rad) const {
    const double sine = std::sqrt(std::max(0.0, 1 - min_cosine_ * min_cosine_));
    return {sine * std::cos(angle_rad), sine * std::sin(angle_rad), min_cosine_};
  }
  std::optional<Eigen::Vector2d> ProjectRay(const Eigen::Vector3d& ray_in_camera) {
    point_ = ray_in_camera;
    if (!model_.Project(camera_.params.data(), point_, &pixel_, nullptr)) return std::nullopt;
    return Eigen::Vector2d(pixel_);
  }

 private:
  // Finds the cone of rays about the optical axis that the image contains: beyond it, the distortion may fold back
  // into the image.
  void FindLimit(const EdgeSum& sum) {
    const Eigen::Vector2d low = sum.low();
    const Eigen::Vector2d size = sum.high() - low;
    const Eigen::Vector2d middle(camera_.params[2], camera_.params[3]);
    double widest = 1;              // Cosine of the widest ray of the image.
    double first_fold = -1;         // Cosine of the narrowest ray beyond which there is no ray.
    constexpr int kNumPlaces = 64;  // Number of samples per side.
    for (int i = 0; i < 4 * kNumPlaces; ++i) {
      const double t = static_cast<double>(i % kNumPlaces) / kNumPlaces;
      const Eigen::Vector2d sides[] = {{t, 0}, {1, t}, {1 - t, 1}, {0, 1 - t}};
      const Eigen::Vector2d pixel = low + size.cwiseProduct(sides[i / kNumPlaces]);
      std::optional<Eigen::Vector3d> ray_in_camera = UnprojectPixel(camera_, pixel);
      if (!ray_in_camera) {
        folds_ = true;
        ray_in_camera = Eigen::Vector3d::UnitZ();
        double inside = 0;
        double outside = 1;
        for (int halving = 0; halving < 30; ++halving) {
          const double share = 0.5 * (inside + outside);
          const std::optional<Eigen::Vector3d> tried = UnprojectPixel(camera_, middle + share * (pixel - middle));
          (tried ? inside : outside) = share;
          if (tried) ray_in_camera = tried;
        }
        first_fold = std::max(first_fold, ray_in_camera->z());
      }
      widest = std::min(widest, ray_in_camera->z());
    }
    // The border is only sampled, so the limit gets a margin, unless it is the fold.
    constexpr double kRoomRad = 0.02;
    const double limit_rad = std::acos(std::clamp(folds_ ? first_fold : widest, -1.0, 1.0)) + (folds_ ? 0 : kRoomRad);
    min_cosine_ = limit_rad < kPi ? std::cos(limit_rad) : -1;
  }

  const Camera& camera_;
  const CameraModel& model_;
  TargetShape shape_;
  Eigen::Vector3d origin_;
  Eigen::Matrix3d rotation_;
  double facing_;
  double min_cosine_ = -1;
  bool folds_ = false;
  Points3 point_ = Points3::Zero(3, 1);
  Points2 pixel_ = Points2::Zero(2, 1);
};

// Projects edges into the image, in steps short enough to be approximated by a parabola.
class EdgeTracer {
 public:
  EdgeTracer(SheetView& view, EdgeSum& sum) : view_(view), sum_(sum), low_(sum.low()), high_(sum.high()) {}

  void Trace(const AlbedoEdge& edge) {
    edge_ = &edge;
    // There are several intervals because a long edge may be visible only in its middle.
    constexpr int kNumStarts = 8;
    Sample last = At(0);
    for (int i = 1; i <= kNumStarts; ++i) {
      const Sample next = At(static_cast<double>(i) / kNumStarts);
      Trace(last, next, 0);
      last = next;
    }
  }

 private:
  struct Sample {
    double t = 0;
    std::optional<Eigen::Vector2d> pixel;  // Nothing if the point is not seen.
  };

  Sample At(double t) { return {t, view_.Project(edge_->At(t))}; }

  void Trace(const Sample& first, const Sample& last, int depth) {
    constexpr int kMaxDepth = 40;
    const Sample middle = At(0.5 * (first.t + last.t));
    const int num_seen = (first.pixel ? 1 : 0) + (middle.pixel ? 1 : 0) + (last.pixel ? 1 : 0);
    if (num_seen == 0 || depth > kMaxDepth) return;
    if (num_seen == 3) {
      const double length_px = (*middle.pixel - *first.pixel).norm() + (*last.pixel - *middle.pixel).norm();
      const Eigen::Vector2d low = first.pixel->cwiseMin(*middle.pixel).cwiseMin(*last.pixel);
      const Eigen::Vector2d high = first.pixel->cwiseMax(*middle.pixel).cwiseMax(*last.pixel);
      if ((high.array() + length_px < low_.array()).any() || (low.array() - length_px > high_.array()).any()) return;
      constexpr double kMaxStepPx = 1.5;
      if (length_px < kMaxStepPx) {
        const bool turned = view_.facing_m() < 0;
        sum_.Add(Parabola(*first.pixel, *middle.pixel, *last.pixel), turned ? edge_->negative : edge_->positive,
                 turned ? edge_->positive : edge_->negative);
        return;
      }
    }
    Trace(first, middle, depth + 1);
    Trace(middle, last, depth + 1);
  }

  SheetView& view_;
  EdgeSum& sum_;
  Eigen::Vector2d low_;
  Eigen::Vector2d high_;
  const AlbedoEdge* edge_ = nullptr;
};

// Adds the edge at which the visible sheet ends because the distortion folds back within the image.
void AddFold(const DrawingEdges& drawing, SheetView& view, EdgeSum& sum) {
  constexpr int kNumSteps = 100000;
  std::optional<Eigen::Vector2d> last = view.ProjectRay(view.LimitRay(0));
  for (int i = 1; i <= kNumSteps; ++i) {
    const double middle_rad = 2 * kPi * (i - 0.5) / kNumSteps;
    const std::optional<Eigen::Vector2d> next = view.ProjectRay(view.LimitRay(2 * kPi * i / kNumSteps));
    const SheetValue inside = view.ValueAt(drawing, view.LimitRay(middle_rad));
    if (last && next && inside.on_sheet != 0) {
      sum.Add(Parabola(*last, 0.5 * (*last + *next), *next), inside, SheetValue());
    }
    last = next;
  }
}

// Returns the visible drawing: the back of the sheet has no print.
Drawing SeenDrawing(const Drawing& drawing, double facing_m) {
  const bool from_front = (facing_m > 0) != drawing.y_up;
  if (from_front) return drawing;
  Drawing back = drawing;
  back.ground = kBackAlbedo;
  back.shapes.clear();
  return back;
}

// Returns the pixels of points on the border of the sheet.
std::vector<Eigen::Vector2d> OutlinePx(const Drawing& drawing, SheetView& view) {
  std::vector<Eigen::Vector2d> outline_px;
  constexpr int kNumPlaces = 16;  // Number of points per side.
  for (int i = 0; i < 4 * kNumPlaces; ++i) {
    const double t = static_cast<double>(i % kNumPlaces) / kNumPlaces;
    const Eigen::Vector2d sides[] = {{t, 0}, {1, t}, {1 - t, 1}, {0, 1 - t}};
    const Eigen::Vector2d place = sides[i / kNumPlaces];
    const Eigen::Vector2d point_in_target = drawing.min_m + place.cwiseProduct(drawing.max_m - drawing.min_m);
    if (const std::optional<Eigen::Vector2d> pixel = view.Project(point_in_target)) outline_px.push_back(*pixel);
  }
  return outline_px;
}

// Returns the scene at the centres of the pixels.
SheetPixels SampledAtCentres(const DrawingEdges& drawing, const Camera& camera, const SheetView& view) {
  SheetPixels pixels(camera.width_px, camera.height_px);
  for (int y = 0; y < camera.height_px; ++y) {
    for (int x = 0; x < camera.width_px; ++x) {
      const SheetValue value = view.ValueAt(drawing, UnprojectPixel(camera, Eigen::Vector2d(x, y)));
      pixels.albedo.at<float>(y, x) = static_cast<float>(value.albedo);
      pixels.on_sheet.at<float>(y, x) = static_cast<float>(value.on_sheet);
    }
  }
  return pixels;
}

// The relative light at each pixel, at most 1.
class Light {
 public:
  Light(int width_px, int height_px, const RenderOptions& options)
      : middle_(0.5 * (width_px - 1), 0.5 * (height_px - 1)), loss_(options.light_gradient) {
    const double angle = Rng(options.seed, kLight).Uniform(0, 2 * kPi);
    slope_ = Eigen::Vector2d(std::cos(angle), std::sin(angle)) / std::max(1.0, middle_.norm());
    scale_ = 1 / std::max(1.0, middle_.squaredNorm());
  }
  double At(int x_px, int y_px) const {
    const Eigen::Vector2d from_middle = Eigen::Vector2d(x_px, y_px) - middle_;
    const double slope = 0.5 * (1 + slope_.dot(from_middle));
    const double vignette = scale_ * from_middle.squaredNorm();
    return 1 - loss_ * 0.5 * (slope + vignette);
  }

 private:
  Eigen::Vector2d middle_;
  double loss_;
  Eigen::Vector2d slope_;
  double scale_;
};

template <class Grey>
cv::Mat Exposed(const cv::Mat& albedo, const RenderOptions& options) {
  constexpr double kUnitsPerGrey = sizeof(Grey) == 1 ? 1 : 257;
  const Light light(albedo.cols, albedo.rows, options);
  cv::Mat image(albedo.size(), cv::DataType<Grey>::type);
  for (int y = 0; y < albedo.rows; ++y) {
    Rng rng(options.seed, kFirstRow + static_cast<uint64_t>(y));
    const float* const albedo_row = albedo.ptr<float>(y);
    Grey* const row = image.ptr<Grey>(y);
    for (int x = 0; x < albedo.cols; ++x) {
      double grey = options.black_grey + (options.white_grey - options.black_grey) * albedo_row[x];
      if (options.light_gradient > 0) grey *= light.At(x, y);
      if (options.noise_sigma_grey > 0) grey += options.noise_sigma_grey * rng.Normal();
      row[x] = static_cast<Grey>(std::lround(std::clamp(grey, 0.0, 255.0) * kUnitsPerGrey));
    }
  }
  return image;
}

}  // namespace

std::string RenderOptions::Check() const {
  std::vector<std::string> faults;
  const auto check = [&faults](bool good, const std::string& fault) {
    if (!good) faults.push_back(fault);
  };
  check(blur_sigma_px >= 0 && blur_sigma_px <= 50, "the blur must be from 0 to 50 px");
  check(noise_sigma_grey >= 0 && noise_sigma_grey <= 255, "the noise must be from 0 to 255 grey");
  check(black_grey >= 0 && black_grey <= 255, "black must be from 0 to 255 grey");
  check(white_grey >= 0 && white_grey <= 255, "white must be from 0 to 255 grey");
  check(light_gradient >= 0 && light_gradient < 1, "the uneven light must be at least 0 and less than 1");
  check(shape.params[0] > 0 && shape.params[1] > 0, "the scales of the shape must be greater than zero");
  check(background_albedo >= 0 && background_albedo <= 1, "the background albedo must be from 0 to 1");
  return Join(faults, "; ");
}

namespace {

// A sheet as the camera sees it, and the pixels of points on its border.
struct SeenSheet {
  SheetPixels pixels;
  std::vector<Eigen::Vector2d> outline_px;
};

SeenSheet RenderSheet(const RenderedSheet& sheet, const Camera& camera, const RenderOptions& options) {
  const PixelKernel kernel(options.blur_sigma_px);
  EdgeSum sum(camera.width_px, camera.height_px, kernel);
  SheetView view(camera, sheet.camera_from_target, sheet.shape, sum);
  const DrawingEdges seen(SeenDrawing(*sheet.drawing, view.facing_m()));

  SheetValue corner;
  // A sheet seen edge-on has no area.
  if (view.facing_m() != 0) {
    EdgeTracer tracer(view, sum);
    for (const AlbedoEdge& edge : seen.edges()) tracer.Trace(edge);
    if (view.folds()) AddFold(seen, view, sum);
    corner = view.ValueAt(seen, UnprojectPixel(camera, sum.low()));
  }
  SeenSheet rendered{options.is_point_sampled ? SampledAtCentres(seen, camera, view) : sum.Pixels(corner), {}};
  if (options.clutter) rendered.outline_px = OutlinePx(*sheet.drawing, view);
  return rendered;
}

}  // namespace

cv::Mat RenderView(const Drawing& drawing, const Camera& camera, const Rigid3d& camera_from_target,
                   const RenderOptions& options) {
  return RenderScene({{&drawing, camera_from_target, options.shape}}, camera, options);
}

cv::Mat RenderScene(const std::vector<RenderedSheet>& sheets, const Camera& camera, const RenderOptions& options) {
  CHECK(options.Check().empty()) << options.Check();
  std::vector<RenderedSheet> far_to_near = sheets;
  std::stable_sort(far_to_near.begin(), far_to_near.end(), [](const RenderedSheet& a, const RenderedSheet& b) {
    return a.camera_from_target.translation.norm() > b.camera_from_target.translation.norm();
  });
  cv::Mat albedo(camera.height_px, camera.width_px, CV_32FC1, cv::Scalar(0));
  cv::Mat on_sheet(camera.height_px, camera.width_px, CV_32FC1, cv::Scalar(0));
  std::vector<Eigen::Vector2d> outlines_px;
  for (const RenderedSheet& sheet : far_to_near) {
    const SeenSheet seen = RenderSheet(sheet, camera, options);
    albedo = seen.pixels.albedo + albedo.mul(1 - seen.pixels.on_sheet);
    on_sheet = seen.pixels.on_sheet + on_sheet.mul(1 - seen.pixels.on_sheet);
    outlines_px.insert(outlines_px.end(), seen.outline_px.begin(), seen.outline_px.end());
  }

  if (options.clutter) {
    cv::Mat background = DrawClutter(camera.width_px, camera.height_px, outlines_px, Rng(options.seed, kClutter));
    if (options.blur_sigma_px > 0 && !options.is_point_sampled) {
      cv::GaussianBlur(background, background, cv::Size(), options.blur_sigma_px, 0, cv::BORDER_REPLICATE);
    }
    albedo += background.mul(1 - on_sheet);
  } else {
    albedo += options.background_albedo * (1 - on_sheet);
  }

  const bool is_deep = options.depth == GreyDepth::k16Bit;
  return is_deep ? Exposed<uint16_t>(albedo, options) : Exposed<uint8_t>(albedo, options);
}

}  // namespace heba
