// Requirements for every type of target in targets.def, and the conventions of OpenCV's and libapriltag's detectors
// that the targets rely on.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}

#include "heba/base/factorisation.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/render/rendering.h"
#include "tests/support/matchers.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::IsEmpty;

struct Example {
  const char* name;
  std::string type;
  std::string yaml;
  double max_rms_px;   // RMS distance of the detected points, from pixel noise and the detector's own errors.
  double max_bias_px;  // Norm of the mean difference over all views.
};
void PrintTo(const Example& example, std::ostream* stream) { *stream << example.name << ": " << example.yaml; }

// Each type has at least one example; an entry of targets.def without an example fails a test.
const std::vector<Example> kExamples = {
    {"apriltag_grid", "apriltag_grid", "{type: apriltag_grid, family: tag36h11, rows: 3, columns: 4, tag_size: 30 mm}",
     0.1, 0.02},
    {"apriltag_grid_without_corner_squares", "apriltag_grid",
     "{type: apriltag_grid, family: tag25h9, rows: 2, columns: 3, tag_size: 30 mm, corner_squares: false}", 0.2, 0.05},
    {"chessboard", "chessboard", "{type: chessboard, rows: 5, columns: 8, square: 20 mm}", 0.1, 0.02},
    {"chessboard_square", "chessboard", "{type: chessboard, rows: 6, columns: 6, square: 20 mm}", 0.1, 0.02},
    {"charuco", "charuco",
     "{type: charuco, rows: 5, columns: 7, square: 30 mm, marker: 22 mm, dictionary: DICT_5X5_100}", 0.1, 0.02},
    {"coded_board", "coded_board", "{type: coded_board, rows: 3, columns: 4, spacing: 40 mm, dot_diameter: 10 mm}",
     0.03, 0.01},
    {"circle_grid", "circle_grid", "{type: circle_grid, rows: 5, columns: 7, spacing: 20 mm}", 0.05, 0.01},
    {"circle_grid_asymmetric", "circle_grid",
     "{type: circle_grid, rows: 6, columns: 4, spacing: 15 mm, asymmetric: true}", 0.05, 0.01},
    {"circle_grid_with_marker_dot", "circle_grid",
     "{type: circle_grid, rows: 5, columns: 7, spacing: 20 mm, marker_dot: true}", 0.05, 0.01},
};

TEST(TargetExamplesTest, CoverEveryType) {
  for (const std::string& type : TargetTypeNames()) {
    const bool has_example =
        std::any_of(kExamples.begin(), kExamples.end(), [&](const Example& example) { return example.type == type; });
    EXPECT_TRUE(has_example) << "targets.def has " << type << ": give it an example here";
  }
}

bool IsInside(const Eigen::Vector2d& at_m, const Shape& shape) {
  if (shape.points_m.empty()) return (at_m - shape.centre_m).norm() < shape.radius_m;
  bool is_inside = false;
  for (size_t i = 0, j = shape.points_m.size() - 1; i < shape.points_m.size(); j = i++) {
    const Eigen::Vector2d& a = shape.points_m[i];
    const Eigen::Vector2d& b = shape.points_m[j];
    if ((a.y() > at_m.y()) == (b.y() > at_m.y())) continue;
    if (at_m.x() < (b.x() - a.x()) * (at_m.y() - a.y()) / (b.y() - a.y()) + a.x()) is_inside = !is_inside;
  }
  return is_inside;
}

double AlbedoAt(const Drawing& drawing, const Eigen::Vector2d& at_m) {
  double albedo = drawing.ground;
  for (const Shape& shape : drawing.shapes) {
    if (IsInside(at_m, shape)) albedo = shape.albedo;
  }
  return albedo;
}

// Returns the smallest distance between two of the points.
double SmallestDistanceM(const std::vector<TargetPoint>& points) {
  double smallest_m = INFINITY;
  for (const TargetPoint& a : points) {
    for (const TargetPoint& b : points) {
      if (a.id < b.id) smallest_m = std::min(smallest_m, (a.in_target - b.in_target).norm());
    }
  }
  return smallest_m;
}

// Returns the distance from `position_m` to the nearest of the points.
double DistanceToNearestM(const std::vector<TargetPoint>& points, const Eigen::Vector3d& position_m) {
  double nearest_m = INFINITY;
  for (const TargetPoint& point : points) nearest_m = std::min(nearest_m, (position_m - point.in_target).norm());
  return nearest_m;
}

// Returns true if both black and white occur on the circles with these radii around `at_m`.
bool HasBlackAndWhiteAround(const Drawing& drawing, const Eigen::Vector2d& at_m, const std::vector<double>& radii_m) {
  bool has_black = false;
  bool has_white = false;
  for (const double radius_m : radii_m) {
    for (int k = 0; k < 16; ++k) {
      const double angle_rad = (k + 0.3) * kPi / 8;
      const Eigen::Vector2d step_m = radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
      (AlbedoAt(drawing, at_m + step_m) < 0.5 ? has_black : has_white) = true;
    }
  }
  return has_black && has_white;
}

class TargetTest : public testing::TestWithParam<Example> {
 protected:
  void SetUp() override {
    target_ = MakeTarget(GetParam().yaml);
    ASSERT_EQ(target_->type(), GetParam().type);
  }

  std::unique_ptr<Target> target_;
};

TEST_P(TargetTest, IdsIncreaseAndPointsSpanAPlane) {
  const std::vector<TargetPoint>& points = target_->points();
  ASSERT_GE(points.size(), 4U);
  Eigen::Vector3d mean_m = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < points.size(); ++i) {
    if (i > 0) {
      EXPECT_GT(points[i].id, points[i - 1].id);
    }
    EXPECT_GE(points[i].id, 0);
    EXPECT_GE(points[i].radius_m, 0);
    mean_m += points[i].in_target / static_cast<double>(points.size());
  }
  Eigen::Matrix3d scatter_m2 = Eigen::Matrix3d::Zero();
  for (const TargetPoint& point : points) {
    scatter_m2 += (point.in_target - mean_m) * (point.in_target - mean_m).transpose();
  }
  const Eigen::Vector3d spread_m2 = EigenOfSymmetric(scatter_m2).values;
  EXPECT_GT(spread_m2[1], 0.01 * spread_m2[2]);  // Sorted ascending: the second is 0 if all points are on one line.
}

// Every point is on the sheet, at an edge between black and white: both occur in its neighbourhood.
TEST_P(TargetTest, DrawingCoversItsPoints) {
  const Drawing& drawing = target_->Draw();
  const double nearest_m = SmallestDistanceM(target_->points());
  for (const TargetPoint& point : target_->points()) {
    const Eigen::Vector2d at_m = point.in_target.head<2>();
    EXPECT_EQ(point.in_target.z(), 0);
    EXPECT_TRUE((at_m.array() > drawing.min_m.array()).all() && (at_m.array() < drawing.max_m.array()).all());
    EXPECT_TRUE(HasBlackAndWhiteAround(drawing, at_m, {0.02 * nearest_m, 0.5 * nearest_m})) << "point " << point.id;
  }
}

// Tilts up to 40 degrees, a lens with distortion, and noise of 2 grey levels.
TEST_P(TargetTest, DetectionsMatchTheCameraModel) {
  constexpr int kNumViews = 4;
  const DetectionErrors errors = DetectRendered(*target_, kNumViews, /*share=*/0.7, /*seed=*/41);
  EXPECT_EQ(errors.num_found, kNumViews * target_->points().size());
  EXPECT_EQ(errors.num_unknown_ids, 0U);
  EXPECT_LT(errors.RmsPx(), GetParam().max_rms_px);
  EXPECT_LT(errors.BiasPx(), GetParam().max_bias_px);
}

// Detections do not depend on the stated size of the target, so an image is searched once for all sizes.
TEST_P(TargetTest, DetectionsDoNotDependOnTheStatedSize) {
  const TargetSettings lengths = target_->UnitLengths();
  ASSERT_FALSE(lengths.empty());
  const auto with_lengths = [&](double times) {
    YAML::Node node = YAML::Load(GetParam().yaml);
    for (const auto& [key, value] : lengths) node[key] = Significant(times * std::stod(value), 17) + " m";
    return MakeTarget(YAML::Dump(node));
  };
  EXPECT_EQ(with_lengths(0.3)->UnitLengths(), lengths);
  Rng rng(44);
  RenderOptions options;
  options.noise_sigma_grey = 2;
  const Rigid3d camera_from_target = RandomView(target_->Draw(), 0.7, 0.6, 0.6, rng);
  const cv::Mat grey = RenderView(target_->Draw(), ImageCamera(), camera_from_target, options);
  const Detection expected = target_->Detect(grey);
  const Detection found = with_lengths(1)->Detect(grey);
  ASSERT_EQ(found.ids, expected.ids);
  for (size_t n = 0; n < found.ids.size(); ++n) {
    // OpenCV's cornerSubPix ends with a step of less than 0.001 px; rounding errors may change the number of steps.
    EXPECT_LT((found.pixels[n] - expected.pixels[n]).norm(), 3e-3);
  }
}

// The first symmetry is the identity, all are different, and each is a rotation that maps points to points and the
// drawing's grey values to themselves. A target in any orientation is detected in one of these orders.
TEST_P(TargetTest, SymmetriesMatchTheDetectedOrders) {
  const Drawing& drawing = target_->Draw();
  const std::vector<Rigid3d> symmetries = target_->Symmetries();
  ASSERT_FALSE(symmetries.empty());
  EXPECT_THAT(symmetries[0], IsNearPose(Rigid3d(), 0, 0));
  Rng rng(42);
  for (size_t k = 0; k < symmetries.size(); ++k) {
    for (size_t other = 0; other < k; ++other) EXPECT_GT(AngleRad(symmetries[k], symmetries[other]), 0.1);
    for (const TargetPoint& point : target_->points()) {
      EXPECT_LT(DistanceToNearestM(target_->points(), symmetries[k] * point.in_target), 1e-9);
    }
    for (int sample = 0; sample < 300; ++sample) {
      const Eigen::Vector2d at_m{rng.Uniform(drawing.min_m.x(), drawing.max_m.x()),
                                 rng.Uniform(drawing.min_m.y(), drawing.max_m.y())};
      const Eigen::Vector3d moved_m = symmetries[k] * Eigen::Vector3d(at_m.x(), at_m.y(), 0);
      EXPECT_EQ(AlbedoAt(drawing, moved_m.head<2>()), AlbedoAt(drawing, at_m));
    }
  }
  const Camera camera = ImageCamera();
  for (int quarter = 0; quarter < 4; ++quarter) {
    const Rigid3d upright = RandomView(drawing, /*share=*/0.6, /*max_tilt_rad=*/0.3, /*max_roll_rad=*/0.3, rng);
    const Rigid3d camera_from_target = Rigid3d(ExpRotation({0, 0, quarter * kPi / 2}), {0, 0, 0}) * upright;
    const Detection detection = target_->Detect(RenderView(drawing, camera, camera_from_target));
    const DetectionErrors errors = ErrorsOf(*target_, camera, camera_from_target, detection);
    EXPECT_EQ(errors.num_found, target_->points().size()) << "rotated by " << 90 * quarter << " deg";
    EXPECT_LT(errors.max_px, 1) << "rotated by " << 90 * quarter << " deg";
  }
}

// A target with symmetries states the settings of a similar target without symmetries; otherwise the list is empty.
TEST_P(TargetTest, SuggestedSettingsRemoveTheSymmetry) {
  const TargetSettings settings = target_->WithoutSymmetry();
  EXPECT_EQ(settings.empty(), target_->Symmetries().size() == 1);
  YAML::Node changed = YAML::Load(GetParam().yaml);
  for (const auto& [key, value] : settings) changed[key] = value;
  EXPECT_EQ(MakeTarget(YAML::Dump(changed))->Symmetries().size(), 1U);
}

// Each point occurs at most once, by increasing id, with its pixel, and the image is unchanged; covariances, if there
// are any, cover all points.
TEST_P(TargetTest, DetectionsAreWellFormed) {
  const Drawing& drawing = target_->Draw();
  Rng rng(43);
  const cv::Mat grey = RenderView(drawing, ImageCamera(), RandomView(drawing, 0.7, 0.5, 0.5, rng));
  const cv::Mat before = grey.clone();
  const Detection detection = target_->Detect(grey);
  EXPECT_EQ(cv::norm(grey, before, cv::NORM_INF), 0);
  ASSERT_EQ(detection.ids.size(), target_->points().size()) << detection.reason;
  ASSERT_EQ(detection.pixels.size(), detection.ids.size());
  EXPECT_TRUE(std::is_sorted(detection.ids.begin(), detection.ids.end()));
  EXPECT_EQ(detection.reason, "");
  if (detection.covariances_px2.empty()) return;
  Eigen::Index num_rows = 0;
  for (const Eigen::MatrixXd& covariance_px2 : detection.covariances_px2) {
    EXPECT_EQ(covariance_px2.rows() % 2, 0);
    EXPECT_EQ(covariance_px2.rows(), covariance_px2.cols());
    EXPECT_TRUE(Cholesky(covariance_px2).has_value());  // The covariance is positive definite.
    num_rows += covariance_px2.rows();
  }
  EXPECT_EQ(num_rows, 2 * static_cast<Eigen::Index>(detection.ids.size()));
}

TEST_P(TargetTest, FindsNothingInImagesWithoutTarget) {
  cv::Mat noise(30, 40, CV_8UC1);
  cv::RNG random(44);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  std::vector<cv::Mat> images = {noise, cv::Mat(30, 40, CV_8UC1, cv::Scalar(255))};
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(3, 2), cv::Size(40, 2), cv::Size(2, 30)}) {
    images.push_back(noise(cv::Rect(cv::Point(0, 0), size)).clone());
  }
  for (const cv::Mat& image : images) {
    const Detection detection = target_->Detect(image);
    EXPECT_THAT(detection.ids, IsEmpty()) << image.size();
    EXPECT_THAT(detection.pixels, IsEmpty());
    EXPECT_NE(detection.reason, "") << image.size();
  }
}

INSTANTIATE_TEST_SUITE_P(Examples, TargetTest, testing::ValuesIn(kExamples),
                         [](const auto& test) { return test.param.name; });

// --------------------------------------------------------------------------------- conventions of other libraries

// Magnifies an image: each of its pixels becomes kCell by kCell pixels of the result, in which pixel (x, y) has its
// centre at (x, y). The edge before cell c is at kCell * c - 0.5.
constexpr int kCell = 20;

cv::Mat Magnified(const cv::Mat& cells) {
  cv::Mat picture;
  cv::resize(cells, picture, cv::Size(), kCell, kCell, cv::INTER_NEAREST);
  // Blur does not move straight edges, but makes them slopes as in images of cameras.
  cv::GaussianBlur(picture, picture, cv::Size(), 1);
  return picture;
}

// libapriltag's first pixel has its centre at (0.5, 0.5), and the corners of an upright tag are bottom left, bottom
// right, top right, top left. On upright tags its edge refinement is off by up to 0.15 px, less than half a pixel.
TEST(ForeignConventions, LibapriltagCornersMatch) {
  apriltag_family_t* family = tag36h11_create();
  image_u8_t* tag = apriltag_to_image(family, 5);
  ASSERT_EQ(tag->width, 10);  // Cells: one of paper, one of border, six of data, one of border, one of paper.
  cv::Mat cells(16, 18, CV_8UC1, cv::Scalar(255));
  cv::Mat(tag->height, tag->width, CV_8UC1, tag->buf, static_cast<size_t>(tag->stride))
      .copyTo(cells(cv::Rect(4, 3, 10, 10)));
  cv::Mat picture = Magnified(cells);

  apriltag_detector_t* detector = apriltag_detector_create();
  apriltag_detector_add_family_bits(detector, family, 1);
  detector->quad_decimate = 1;
  detector->refine_edges = true;
  image_u8_t image = {picture.cols, picture.rows, static_cast<int32_t>(picture.step[0]), picture.data};
  zarray_t* found = apriltag_detector_detect(detector, &image);
  EXPECT_EQ(zarray_size(found), 1);
  if (zarray_size(found) == 1) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(found, 0, &detection);
    EXPECT_EQ(detection->id, 5);
    const double left_px = 5 * kCell - 0.5;
    const double right_px = 13 * kCell - 0.5;
    const double top_px = 4 * kCell - 0.5;
    const double bottom_px = 12 * kCell - 0.5;
    const double corners_px[4][2] = {
        {left_px, bottom_px}, {right_px, bottom_px}, {right_px, top_px}, {left_px, top_px}};
    for (int k = 0; k < 4; ++k) {
      EXPECT_NEAR(detection->p[k][0] - 0.5, corners_px[k][0], 0.2) << "corner " << k;
      EXPECT_NEAR(detection->p[k][1] - 0.5, corners_px[k][1], 0.2) << "corner " << k;
    }
  }
  apriltag_detections_destroy(found);
  apriltag_detector_destroy(detector);
  std::free(tag->buf);  // The library does not export image_u8_destroy().
  std::free(tag);
  tag36h11_destroy(family);
}

// OpenCV's pixel (x, y) has its centre at (x, y): the corner between four quadrants, two of them dark, is half a
// pixel before the first pixel of the last quadrant.
TEST(ForeignConventions, OpenCvPixelCentreMatches) {
  cv::Mat picture(80, 100, CV_8UC1, cv::Scalar(220));
  picture(cv::Rect(0, 0, 50, 40)).setTo(30);
  picture(cv::Rect(50, 40, 50, 40)).setTo(30);
  cv::GaussianBlur(picture, picture, cv::Size(), 1);
  std::vector<cv::Point2f> corner = {{51, 38}};
  cv::cornerSubPix(picture, corner, cv::Size(6, 6), cv::Size(-1, -1), {cv::TermCriteria::COUNT, 50, 0});
  EXPECT_NEAR(corner[0].x, 49.5, 0.01);
  EXPECT_NEAR(corner[0].y, 39.5, 0.01);
}

}  // namespace
}  // namespace heba
