#include "targets/render/rendering.h"
#include "targets/render/drawing_edges.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "heba/base/parallel.h"
#include "heba/base/units.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kUnitsPerGrey = 257;  // Units of a 16-bit image per grey level.

Eigen::Matrix3d Rotation(double x_rad, double y_rad, double z_rad) {
  return (Eigen::AngleAxisd(x_rad, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(y_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(z_rad, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

// Returns a camera in which 1 mm at a distance of 1 m is 1 px, with the principal point (100, 75).
Camera PinholeCamera() { return {"pinhole", 200, 150, {1000, 1000, 100, 75}}; }

Drawing WhiteSheet(double half_width_m, double half_height_m) {
  Drawing drawing;
  drawing.min_m = {-half_width_m, -half_height_m};
  drawing.max_m = {half_width_m, half_height_m};
  return drawing;
}

RenderOptions Deep(double blur_sigma_px) {
  RenderOptions options;
  options.blur_sigma_px = blur_sigma_px;
  options.depth = GreyDepth::k16Bit;
  return options;
}

double Grey(const cv::Mat& image, int x, int y) { return image.at<uint16_t>(y, x) / kUnitsPerGrey; }

bool SameBytes(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

// Returns the integral from minus infinity to `s` of the cumulative distribution function of a Gaussian with standard
// deviation `sigma`.
double SecondIntegral(double s, double sigma) {
  if (sigma == 0) return std::max(0.0, s);
  const double z = s / sigma;
  return s * 0.5 * std::erfc(-z / std::sqrt(2.0)) + sigma * std::exp(-0.5 * z * z) / std::sqrt(2 * kPi);
}
// Returns the share of a pixel's kernel (box and Gaussian) to the left of a straight vertical edge that is `s` px to
// the right of the centre of the pixel.
double KernelShare(double s, double sigma) { return SecondIntegral(s + 0.5, sigma) - SecondIntegral(s - 0.5, sigma); }

// Returns a number as a part of a test name, with an underscore as the decimal point.
std::string NameOf(double number) {
  std::ostringstream text;
  text << number;
  std::string name = text.str();
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

// Returns the sums over all pixels of x, y and 1, each weighted by the share of the pixel that is black.
Eigen::Vector3d BlackMoments(const cv::Mat& image) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) sum += (220 - Grey(image, x, y)) / 190 * Eigen::Vector3d(x, y, 1);
  }
  return sum;
}

struct DiscPosition {
  const char* name;
  Eigen::Vector2d offset_mm;  // From the optical axis.
};
void PrintTo(const DiscPosition& position, std::ostream* stream) { *stream << position.name; }

// The blur in pixels and the position of the disc.
class RenderedDiscTest : public testing::TestWithParam<std::tuple<double, DiscPosition>> {};

TEST_P(RenderedDiscTest, CentroidAndAreaAreExact) {
  const auto& [sigma_px, position] = GetParam();
  Drawing drawing = WhiteSheet(0.2, 0.2);
  drawing.AddDisc(1e-3 * position.offset_mm, 0.0203, 0);
  const cv::Mat image =
      RenderView(drawing, PinholeCamera(), Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 1}), Deep(sigma_px));
  const Eigen::Vector3d sum = BlackMoments(image);
  const Eigen::Vector2d error_px = sum.head<2>() / sum.z() - Eigen::Vector2d(100, 75) - position.offset_mm;
  // The error is 8e-5 px for a blur of 0.3 px or more. Zero blur is rendered as 0.02 px, for which the quadrature
  // has an error of 5e-4 px.
  constexpr double kTolerancePx = 0.001;
  EXPECT_LT(error_px.norm(), kTolerancePx);
  const double radius_px = std::sqrt(sum.z() / kPi);
  EXPECT_NEAR(radius_px, 20.3, kTolerancePx);
}

INSTANTIATE_TEST_SUITE_P(, RenderedDiscTest,
                         testing::Combine(testing::Values(0.0, 0.3, 0.7, 2.0),
                                          testing::Values(DiscPosition{"in_the_middle", {0, 0}},
                                                          DiscPosition{"off_the_middle", {3.21, -7.77}})),
                         [](const auto& test) {
                           return "blur_" + NameOf(std::get<0>(test.param)) + "_px_" + std::get<1>(test.param).name;
                         });

// The blur and the position of the edge along x, in pixels.
class RenderedEdgeTest : public testing::TestWithParam<std::tuple<double, double>> {};

// Edges along rows and columns are the worst case for images that are made from samples.
TEST_P(RenderedEdgeTest, HasTheProfileOfBoxAndBlur) {
  const auto& [sigma_px, edge_px] = GetParam();
  const Camera camera = PinholeCamera();
  Drawing drawing = WhiteSheet(0.2, 0.2);
  drawing.AddRectangle(-0.3, -0.3, 1e-3 * (edge_px - 100), 0.3, 0);
  Drawing rotated = WhiteSheet(0.2, 0.2);
  rotated.AddRectangle(-0.3, -0.3, 0.3, 1e-3 * (edge_px - 100), 0);
  const Rigid3d camera_from_target(Eigen::Quaterniond::Identity(), {0, 0, 1});
  const cv::Mat upright = RenderView(drawing, camera, camera_from_target, Deep(sigma_px));
  const cv::Mat level = RenderView(rotated, camera, camera_from_target, Deep(sigma_px));
  for (int i = -40; i <= 40; ++i) {
    const double expected = 220 - 190 * KernelShare(edge_px - 100 - i, sigma_px);
    constexpr double kToleranceGrey = 0.02;  // 0.01 % of the contrast, and rounding.
    EXPECT_NEAR(Grey(upright, 100 + i, 60), expected, kToleranceGrey) << i;
    EXPECT_NEAR(Grey(level, 60, 75 + i), expected, kToleranceGrey) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(, RenderedEdgeTest,
                         testing::Combine(testing::Values(0.02, 0.1, 0.4, 0.7, 1.5, 6.0),
                                          testing::Values(100.0, 100.137, 100.5, 100.81)),
                         [](const auto& test) {
                           return "blur_" + NameOf(std::get<0>(test.param)) + "_px_edge_at_" +
                                  NameOf(std::get<1>(test.param)) + "_px";
                         });

TEST(RenderView, PixelsWithoutBlurAreAreaSamples) {
  Drawing drawing = WhiteSheet(0.2, 0.2);
  drawing.AddRectangle(-0.3, -0.3, 0.00025, 0.3, 0);
  const cv::Mat image =
      RenderView(drawing, PinholeCamera(), Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 1}), Deep(0));
  constexpr double kToleranceGrey = 1.0;  // Zero blur is rendered as 0.02 px.
  EXPECT_NEAR(Grey(image, 99, 60), 30, kToleranceGrey);
  EXPECT_NEAR(Grey(image, 100, 60), 220 - 190 * 0.75, kToleranceGrey);
  EXPECT_NEAR(Grey(image, 101, 60), 220, kToleranceGrey);
}

// Returns the albedo that `drawing` (rectangles and discs, painted in order) shows along a ray.
double AlbedoOfRay(const Drawing& drawing, const Rigid3d& camera_from_target, const Eigen::Vector3d& ray_in_camera,
                   double background) {
  const Rigid3d target_from_camera = Inverse(camera_from_target);
  const Eigen::Vector3d camera_in_target = target_from_camera.translation;
  const Eigen::Vector3d ray_in_target = target_from_camera.rotation * ray_in_camera;
  const double distance = -camera_in_target.z() / ray_in_target.z();
  const Eigen::Vector2d point = (camera_in_target + distance * ray_in_target).head<2>();
  if (distance <= 0 || (point.array() < drawing.min_m.array()).any() || (point.array() > drawing.max_m.array()).any()) {
    return background;
  }
  double albedo = drawing.ground;
  for (const Shape& shape : drawing.shapes) {
    const bool inside = shape.points_m.empty() ? (point - shape.centre_m).norm() < shape.radius_m
                                               : (point.array() > shape.points_m[0].array()).all() &&
                                                     (point.array() < shape.points_m[2].array()).all();
    if (inside) albedo = shape.albedo;
  }
  return albedo;
}

// Returns the grey values (row, column) of the reference image, which is rendered from many rays per pixel, each
// weighted by the Gaussian.
Eigen::MatrixXd BruteForce(const Drawing& drawing, const Camera& camera, const Rigid3d& camera_from_target,
                           const RenderOptions& options) {
  constexpr int kRays = 64;  // Per side of a pixel.
  const int margin_px = static_cast<int>(std::ceil(4 * options.blur_sigma_px + 0.5));
  const int columns = (camera.width_px + 2 * margin_px) * kRays;
  const int rows = (camera.height_px + 2 * margin_px) * kRays;
  // Rays are computed on a lattice and interpolated in between, which causes errors of less than 1e-3 px.
  constexpr int kRaysAStep = 8;
  const int lattice_columns = columns / kRaysAStep + 1;
  std::vector<Eigen::Vector3d> lattice;
  lattice.reserve(static_cast<size_t>(lattice_columns) * (rows / kRaysAStep + 1));
  for (int row = 0; row <= rows; row += kRaysAStep) {
    for (int column = 0; column <= columns; column += kRaysAStep) {
      const Eigen::Vector2d from_corner_px = Eigen::Vector2d(column, row) / kRays;
      lattice.push_back(UnprojectPixel(camera, from_corner_px.array() - 0.5 - margin_px).value());
    }
  }
  const auto ray_at = [&](int column, int row) -> Eigen::Vector3d {
    const double x = (column % kRaysAStep + 0.5) / kRaysAStep;
    const double y = (row % kRaysAStep + 0.5) / kRaysAStep;
    const Eigen::Vector3d* const upper = &lattice[row / kRaysAStep * lattice_columns + column / kRaysAStep];
    const Eigen::Vector3d* const lower = upper + lattice_columns;
    return (1 - y) * ((1 - x) * upper[0] + x * upper[1]) + y * ((1 - x) * lower[0] + x * lower[1]);
  };
  // Returns the kernels (box and Gaussian) of a line of pixels, by (ray, pixel).
  const auto kernels = [&](int num_rays, int num_pixels) {
    Eigen::MatrixXd weights(num_rays, num_pixels);
    const double root = options.blur_sigma_px * std::sqrt(2.0);
    for (int i = 0; i < num_pixels; ++i) {
      for (int ray = 0; ray < num_rays; ++ray) {
        const double s = (ray + 0.5) / kRays - 0.5 - margin_px - i;
        weights(ray, i) = 0.5 * (std::erf((s + 0.5) / root) - std::erf((s - 0.5) / root)) / kRays;
      }
    }
    return weights;
  };
  const Eigen::MatrixXd column_weights = kernels(columns, camera.width_px);
  const Eigen::MatrixXd row_weights = kernels(rows, camera.height_px);

  Eigen::MatrixXd image = Eigen::MatrixXd::Zero(camera.height_px, camera.width_px);
  for (int row = 0; row < rows; ++row) {
    Eigen::RowVectorXd albedos(columns);
    for (int column = 0; column < columns; ++column) {
      albedos[column] = AlbedoOfRay(drawing, camera_from_target, ray_at(column, row), options.background_albedo);
    }
    const Eigen::RowVectorXd blurred = albedos * column_weights;
    image += row_weights.row(row).transpose() * blurred;
  }
  return options.black_grey + (options.white_grey - options.black_grey) * image.array();
}

// Returns shapes that cover each other, share outlines and cross the border of the sheet.
Drawing Tangle(bool y_up) {
  Drawing drawing = WhiteSheet(0.05, 0.04);
  drawing.y_up = y_up;
  drawing.AddRectangle(-0.03, -0.03, 0.01, 0.01, 0);
  drawing.AddRectangle(-0.025, -0.025, -0.015, -0.015, 1);
  drawing.AddRectangle(-0.015, -0.025, -0.005, -0.015, 1);
  drawing.AddRectangle(-0.005, -0.015, 0.01, 0.005, 1);  // Shares an outline with the first rectangle.
  drawing.AddRectangle(0.01, -0.03, 0.02, 0.01, 0);
  drawing.AddDisc({0.02, 0.015}, 0.015, 0);
  drawing.AddDisc({0.02, 0.015}, 0.01, 1);
  drawing.AddRectangle(0.015, 0.01, 0.05, 0.02, 0.5);
  drawing.AddDisc({-0.045, 0.03}, 0.012, 0);
  drawing.AddDisc({-0.035, 0.03}, 0.012, 0.2);
  drawing.AddDisc({0.02, 0.015}, 0.004, 0);
  return drawing;
}

struct Scene {
  const char* name;
  Camera camera;
  Rigid3d camera_from_target;
  bool y_up;
};

std::vector<Scene> Scenes() {
  return {
      {"brown5",
       {"brown5", 28, 20, {26, 27, 14.2, 9.1, -0.25, 0.05, 0.003, -0.002, 0}},
       Rigid3d(Rotation(0.4, -0.5, 0.3), {0.002, -0.003, 0.09}),
       false},
      {"partly_seen",
       {"pinhole", 28, 20, {60, 62, 14.2, 9.1}},
       Rigid3d(Rotation(kPi + 0.2, 0.7, 0.3), {0.02, -0.003, 0.09}),
       true},
      {"partly_behind_the_camera",
       {"rational8", 28, 20, {20, 21, 14.2, 9.1, 0.1, 0.01, 0, 0, 0, 0.05, 0, 0}},
       Rigid3d(Rotation(-1.3, 0.05, 0.4), {0.0, 0.02, 0.01}),
       false},
      {"fish_eye",
       {"kannala_brandt4", 28, 20, {11, 11.2, 14.2, 9.1, 0.02, -0.003, 0, 0}},
       Rigid3d(Rotation(0.3, 1.0, -0.8), {0.02, -0.01, 0.03}),
       false},
  };
}

class RenderAccuracyTest : public testing::TestWithParam<size_t> {};

TEST_P(RenderAccuracyTest, AgreesWithManyWeightedRaysPerPixel) {
  const Scene scene = Scenes()[GetParam()];
  const Drawing drawing = Tangle(scene.y_up);
  RenderOptions options = Deep(0.7);
  const Eigen::MatrixXd expected = BruteForce(drawing, scene.camera, scene.camera_from_target, options);
  const cv::Mat image = RenderView(drawing, scene.camera, scene.camera_from_target, options);
  EXPECT_GT(expected.maxCoeff() - expected.minCoeff(), 100) << "an empty scene";
  double worst = 0;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      worst = std::max(worst, std::abs(Grey(image, x, y) - expected(y, x)));
    }
  }
  RecordProperty("worst_grey", std::to_string(worst));
  // The error of the reference with 64 x 64 rays per pixel at a contrast of 190 (0.05 with four times as many).
  constexpr double kToleranceGrey = 0.15;
  EXPECT_LT(worst, kToleranceGrey);
}
INSTANTIATE_TEST_SUITE_P(RenderView, RenderAccuracyTest, testing::Range(size_t{0}, Scenes().size()),
                         [](const auto& param_info) { return std::string(Scenes()[param_info.param].name); });

// An image is rendered as a whole and in 49 parts: the running sum along a row includes all edges to its left, inside
// and outside the part.
TEST(RenderView, PartsOfAnImageMatchTheWholeImage) {
  const Drawing drawing = Tangle(false);
  const Rigid3d camera_from_target(Rotation(0.3, -0.4, 0.2), {0.001, 0.002, 0.12});
  const Camera camera{"brown5", 140, 105, {180, 181, 70, 51, -0.2, 0.05, 0.001, 0, 0}};
  const cv::Mat whole = RenderView(drawing, camera, camera_from_target, Deep(0.7));
  for (int column = 0; column < 7; ++column) {
    for (int row = 0; row < 7; ++row) {
      Camera part = camera;
      part.width_px = 20;
      part.height_px = 15;
      part.params[2] -= 20 * column;
      part.params[3] -= 15 * row;
      const cv::Mat image = RenderView(drawing, part, camera_from_target, Deep(0.7));
      // One unit of rounding, and one for different steps along the edges.
      EXPECT_LE(cv::norm(image, whole(cv::Rect(20 * column, 15 * row, 20, 15)), cv::NORM_INF), 2);
    }
  }
}

TEST(RenderView, SharedOutlinesLeaveNoSeam) {
  Drawing drawing = WhiteSheet(0.05, 0.05);
  // The squares of a checker pattern have the same albedo, and the sums that define their edges round differently.
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 10; ++j) {
      drawing.AddRectangle(-0.04 + i * 0.008, -0.04 + j * 0.008, -0.04 + (i + 1) * 0.008, 0.04 - (9 - j) * 0.008, 0);
    }
  }
  const cv::Mat image = RenderView(drawing, PinholeCamera(), Rigid3d(Rotation(0.2, 0.3, 0.4), {0, 0, 1}), Deep(0.7));
  for (int y = 75 - 20; y <= 75 + 20; ++y) {
    for (int x = 100 - 20; x <= 100 + 20; ++x) EXPECT_NEAR(Grey(image, x, y), 30, 0.01);
  }
}

// Returns a sheet whose border is crossed by discs of a different albedo on each side, at coordinates that are not
// binary fractions.
Drawing SheetWithDiscsOnItsBorder(int discs_per_side) {
  Drawing drawing;
  drawing.min_m = {-0.0525, -0.0525};
  drawing.max_m = {0.085, 0.085};
  drawing.ground = 1;
  for (int i = 0; i < discs_per_side; ++i) {
    const double along = -0.045 + 0.12 * i / discs_per_side;
    const double radius_m = 0.04 / discs_per_side;
    drawing.AddDisc({0.085, along}, radius_m, 0);
    drawing.AddDisc({along, 0.085}, radius_m, 0.5);
    drawing.AddDisc({-0.0525, along}, radius_m, 0.2);
    drawing.AddDisc({along, -0.0525}, radius_m, 0.3);
  }
  return drawing;
}

// The parameter is the number of discs on each side of the sheet.
class DrawingEdgesTest : public testing::TestWithParam<int> {};

// The albedo on either side of each piece of the border is the stated one.
TEST_P(DrawingEdgesTest, SplitsTheBorderAtCrossingShapes) {
  const DrawingEdges edges(SheetWithDiscsOnItsBorder(GetParam()));
  for (const AlbedoEdge& edge : edges.edges()) {
    for (const double t : {0.1, 0.35, 0.6, 0.85}) {
      const Eigen::Vector2d along = (edge.At(t + 1e-6) - edge.At(t)).normalized();
      const Eigen::Vector2d aside = 1e-8 * Eigen::Vector2d(-along.y(), along.x());
      EXPECT_EQ(edges.ValueAt(edge.At(t) + aside), edge.positive) << edge.At(t).transpose();
      EXPECT_EQ(edges.ValueAt(edge.At(t) - aside), edge.negative) << edge.At(t).transpose();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, DrawingEdgesTest, testing::Range(1, 25),
                         [](const auto& test) { return std::to_string(test.param) + "_discs_per_side"; });

TEST(RenderView, TargetsBehindTheCameraOrOutsideTheImageAreNotSeen) {
  const Drawing drawing = Tangle(false);
  const Camera camera{"brown5", 60, 40, {60, 60, 30, 20, -0.3, 0.1, 0, 0, 0}};
  RenderOptions options;
  options.background_albedo = 0.4;
  constexpr int kBackgroundGrey = 106;  // 30 + 0.4 * 190.
  // A distortion that folds back would show the last position in the image.
  for (const Eigen::Vector3d& at :
       {Eigen::Vector3d(0, 0, -0.1), Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0.4, 0, 0.1),
        Eigen::Vector3d(0, -0.5, 0.1), Eigen::Vector3d(0.6, 0, 0.25)}) {
    const cv::Mat image = RenderView(drawing, camera, Rigid3d(Rotation(0.1, 0.2, 0), at), options);
    EXPECT_EQ(cv::countNonZero(image != kBackgroundGrey), 0) << at.transpose();
  }
}

TEST(RenderView, BackOfTheTargetIsPlainGrey) {
  for (const bool y_up : {false, true}) {
    const Drawing drawing = Tangle(y_up);
    const Rigid3d front(Rotation(y_up ? kPi : 0, 0, 0), {0, 0, 0.5});
    const Rigid3d back(Rotation(y_up ? 0 : kPi, 0, 0), {0, 0, 0.5});
    const cv::Rect inside(60, 50, 80, 50);
    double least = 0;
    double most = 0;
    cv::minMaxLoc(RenderView(drawing, PinholeCamera(), front)(inside), &least, &most);
    EXPECT_GT(most - least, 150);
    cv::minMaxLoc(RenderView(drawing, PinholeCamera(), back)(inside), &least, &most);
    EXPECT_EQ(most, least);
  }
}

TEST(RenderView, BeyondTheFoldOfADistortionIsBackground) {
  // The distorted radius x (1 - 0.3 x^2) has its maximum at x = 1.054, which is 422 px from the centre of an image
  // that extends to 640 px.
  const Camera camera{"brown5", 1280, 400, {600, 600, 640, 200, -0.3, 0, 0, 0, 0}};
  const cv::Mat image =
      RenderView(WhiteSheet(1, 1), camera, Rigid3d(Rotation(0.1, 0.1, 0), {0, 0, 0.2}), RenderOptions());
  const int background = static_cast<int>(std::lround(30 + 190 * RenderOptions().background_albedo));
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double radius_px = std::hypot(x - 640, y - 200);
      if (radius_px > 405 && radius_px < 430) continue;
      EXPECT_NEAR(image.at<uint8_t>(y, x), radius_px < 415 ? 220 : background, 1) << x << " " << y;
    }
  }
}

TEST(RenderView, IsBitIdenticalOnAnyThread) {
  const Drawing drawing = Tangle(false);
  const Rigid3d camera_from_target(Rotation(0.2, 0.1, 0.3), {0, 0, 0.6});
  RenderOptions options;
  options.noise_sigma_grey = 2;
  options.light_gradient = 0.3;
  options.clutter = true;
  options.seed = 7;
  const cv::Mat alone = RenderView(drawing, PinholeCamera(), camera_from_target, options);
  std::vector<cv::Mat> images(8);
  ParallelFor(8, 4, [&](int i) { images[i] = RenderView(drawing, PinholeCamera(), camera_from_target, options); });
  for (const cv::Mat& image : images) EXPECT_TRUE(SameBytes(image, alone));
  options.seed = 8;
  EXPECT_FALSE(SameBytes(RenderView(drawing, PinholeCamera(), camera_from_target, options), alone));
}

TEST(RenderView, NoiseHasTheRequestedLevel) {
  const Camera camera = PinholeCamera();
  const Rigid3d camera_from_target(Eigen::Quaterniond::Identity(), {0, 0, 1});
  RenderOptions options;
  options.seed = 3;
  for (const double sigma_grey : {1.0, 3.0, 8.0}) {
    options.noise_sigma_grey = sigma_grey;
    const cv::Mat image = RenderView(WhiteSheet(0.2, 0.2), camera, camera_from_target, options);
    cv::Scalar mean;
    cv::Scalar stddev;
    cv::meanStdDev(image, mean, stddev);
    // Rounding adds a variance of 1/12 grey level squared. The tolerance is five standard deviations for 30000 pixels
    // (one false alarm in 10^6).
    const double expected = std::sqrt(sigma_grey * sigma_grey + 1.0 / 12);
    EXPECT_NEAR(stddev[0], expected, 5 * expected / std::sqrt(2 * 30000.0));
    EXPECT_NEAR(mean[0], 220, 5 * expected / std::sqrt(30000.0));
  }
}

TEST(RenderView, LightFallsByAtMostItsGradientAndScalesEveryGrey) {
  const Camera camera = PinholeCamera();
  const Rigid3d camera_from_target(Eigen::Quaterniond::Identity(), {0, 0, 1});
  RenderOptions options = Deep(0.7);
  options.light_gradient = 0.4;
  const cv::Mat white = RenderView(WhiteSheet(0.2, 0.2), camera, camera_from_target, options);
  Drawing black_sheet = WhiteSheet(0.2, 0.2);
  black_sheet.ground = 0;
  const cv::Mat black = RenderView(black_sheet, camera, camera_from_target, options);
  double least = 0;
  double most = 0;
  cv::minMaxLoc(white, &least, &most);
  EXPECT_LE(most / kUnitsPerGrey, 220);
  EXPECT_GE(least / kUnitsPerGrey, 220 * 0.6 - 0.01);
  EXPECT_LT(least, 0.75 * most);
  for (int y = 0; y < white.rows; y += 10) {
    for (int x = 0; x < white.cols; x += 10) EXPECT_NEAR(Grey(black, x, y) / Grey(white, x, y), 30.0 / 220, 1e-4);
  }
}

TEST(RenderView, ClutterStaysBehindTheSheet) {
  const Rigid3d camera_from_target(Rotation(0.2, 0.1, 0.3), {0, 0, 1});
  RenderOptions options;
  const cv::Mat plain = RenderView(Tangle(false), PinholeCamera(), camera_from_target, options);
  options.clutter = true;
  const cv::Mat cluttered = RenderView(Tangle(false), PinholeCamera(), camera_from_target, options);
  const cv::Rect inside(80, 60, 40, 30);
  EXPECT_TRUE(SameBytes(plain(inside), cluttered(inside)));
  const cv::Rect beside(0, 0, 200, 20);
  cv::Scalar mean;
  cv::Scalar stddev;
  cv::meanStdDev(cluttered(beside), mean, stddev);
  EXPECT_GT(stddev[0], 5);
}

TEST(RenderView, ReportsInvalidOptions) {
  RenderOptions options;
  EXPECT_THAT(options.Check(), IsEmpty());
  options.blur_sigma_px = std::nan("");
  options.noise_sigma_grey = -1;
  options.light_gradient = 1;
  EXPECT_EQ(
      options.Check(),
      "the blur must be from 0 to 50 px; the noise must be from 0 to 255 grey; the uneven light must be at least 0 "
      "and less than 1");
}

}  // namespace
}  // namespace heba
