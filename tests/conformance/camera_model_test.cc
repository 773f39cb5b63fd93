// Requirements for every camera model (heba/camera/camera_model.h). The tests iterate over the table of models, so
// that a new model is tested automatically.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/camera/camera.h"

namespace heba {
namespace {

constexpr int kWidthPx = 1280;
constexpr int kHeightPx = 960;

struct CameraCase {
  std::string name;
  Camera camera;
  int lens_index;  // Index among the lenses of the model.
};
void PrintTo(const CameraCase& tested, std::ostream* stream) { *stream << tested.name; }

// Returns every camera model with each of its examples.
std::vector<CameraCase> CameraCases() {
  std::vector<CameraCase> cases;
  for (const CameraModel* model : CameraModels()) {
    int lens_index = 0;
    for (const CameraExample& example : model->facts().examples) {
      const std::string name(model->name());
      cases.push_back({name + "_" + example.name, {name, kWidthPx, kHeightPx, example.params}, lens_index++});
    }
  }
  return cases;
}

// Returns whether the camera projects rays at 90 deg from the optical axis: the largest angle is that of the last
// projected ray.
bool SeesPerpendicularRays(const Camera& camera) {
  const double below_rad = DegToRad(89.999);
  return ProjectPoint(camera, {std::sin(below_rad), 0, std::cos(below_rad)}).has_value();
}

// Returns points in front of the camera whose projections cover the image.
Points3 RandomPoints(Rng& rng, int count) {
  Points3 points(3, count);
  for (int i = 0; i < count; ++i) {
    const double z = rng.Uniform(0.2, 3.0);
    points.col(i) << z * rng.Uniform(-0.6, 0.6), z * rng.Uniform(-0.45, 0.45), z;
  }
  return points;
}

class CameraModelTest : public testing::TestWithParam<CameraCase> {
 protected:
  const Camera& camera() const { return GetParam().camera; }
  const CameraModel& model() const { return camera().Model(); }

  // Returns random points that differ between the lenses of a model: the points of the lenses before are drawn first.
  Points3 RandomPointsOfLens(uint64_t seed, int count) const {
    Rng rng(seed);
    for (int lens_index = 0; lens_index < GetParam().lens_index; ++lens_index) RandomPoints(rng, count);
    return RandomPoints(rng, count);
  }
};

TEST_P(CameraModelTest, HasANameAndTheFourPinholeParameters) {
  ASSERT_EQ(FindCameraModel(camera().model), &model());
  const std::vector<std::string>& names = model().param_names();
  ASSERT_GE(names.size(), 4u);
  EXPECT_EQ(names[0], "fx");
  EXPECT_EQ(names[1], "fy");
  EXPECT_EQ(names[2], "cx");
  EXPECT_EQ(names[3], "cy");
  EXPECT_EQ(GroupOf(1), ParameterGroup::kFocal);
  EXPECT_EQ(GroupOf(3), ParameterGroup::kPrincipalPoint);
  EXPECT_EQ(GroupOf(4), ParameterGroup::kDistortion);
  EXPECT_EQ(CheckCamera(camera()), "");
}

// A model whose examples leave a coefficient at 0 would leave its derivatives untested.
TEST_P(CameraModelTest, HasAnExampleWithoutZeros) {
  const std::vector<CameraExample>& examples = model().facts().examples;
  EXPECT_TRUE(std::any_of(examples.begin(), examples.end(), [](const CameraExample& example) {
    return std::find(example.params.begin(), example.params.end(), 0.0) == example.params.end();
  }));
}

TEST_P(CameraModelTest, StartsWithADistortionThatProjectsPointsInFrontOfTheCamera) {
  const CameraModelFacts& facts = model().facts();
  std::vector<std::vector<double>> distortions = facts.initial_distortions;
  if (distortions.empty()) distortions.emplace_back(facts.distortion_names.size(), 0.0);
  for (const std::vector<double>& distortion : distortions) {
    ASSERT_EQ(distortion.size(), facts.distortion_names.size());
    Camera start = camera();
    std::copy(distortion.begin(), distortion.end(), start.params.begin() + 4);
    for (const double angle_deg : {0.0, 30.0, 60.0, 89.0}) {
      const double angle_rad = DegToRad(angle_deg);
      EXPECT_TRUE(ProjectPoint(start, {std::sin(angle_rad), 0, std::cos(angle_rad)}).has_value()) << angle_deg;
    }
  }
}

TEST_P(CameraModelTest, SeesPointsBesideItIfAndOnlyIfItIsAFisheye) {
  // The ray is perpendicular to the optical axis.
  const bool is_fisheye = model().facts().kind == LensKind::kFisheye;
  EXPECT_EQ(ProjectPoint(camera(), {1, 0, -1e-9}).has_value(), is_fisheye && SeesPerpendicularRays(camera()));
}

// Two cameras that are the same lens for OpenCV project every point to the same pixel.
TEST_P(CameraModelTest, ConversionKeepsThePixels) {
  const Points3 points = RandomPointsOfLens(5, 50);
  int num_conversions = 0;
  for (const CameraModel* to : CameraModels()) {
    const std::optional<Camera> converted = ConvertCamera(camera(), std::string(to->name()));
    if (!converted) continue;
    ++num_conversions;
    ASSERT_EQ(CheckCamera(*converted), "") << to->name();
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      EXPECT_LT((*ProjectPoint(*converted, points.col(i)) - *ProjectPoint(camera(), points.col(i))).norm(), 1e-9)
          << to->name();
    }
    const std::optional<Camera> back = ConvertCamera(*converted, camera().model);
    ASSERT_TRUE(back.has_value()) << to->name();
    EXPECT_EQ(back->params, camera().params) << to->name();
  }
  EXPECT_GE(num_conversions, 1);  // The model itself.
}

TEST_P(CameraModelTest, OpticalAxisHitsThePrincipalPoint) {
  for (const double z : {1e-3, 1.0, 50.0}) {
    const std::optional<Eigen::Vector2d> pixel = ProjectPoint(camera(), {0, 0, z});
    ASSERT_TRUE(pixel.has_value());
    EXPECT_EQ(*pixel, Eigen::Vector2d(camera().params[2], camera().params[3]));
  }
}

TEST_P(CameraModelTest, AxesPointRightAndDown) {
  const std::optional<Eigen::Vector2d> right = ProjectPoint(camera(), {0.1, 0, 1});
  const std::optional<Eigen::Vector2d> down = ProjectPoint(camera(), {0, 0.1, 1});
  ASSERT_TRUE(right.has_value() && down.has_value());
  EXPECT_GT(right->x(), camera().params[2] + 0.03 * camera().params[0]);
  EXPECT_GT(down->y(), camera().params[3] + 0.03 * camera().params[1]);
}

TEST_P(CameraModelTest, DoesNotProjectInvalidPoints) {
  const double nan = std::nan("");
  EXPECT_FALSE(ProjectPoint(camera(), {0, 0, -1}).has_value());
  EXPECT_FALSE(ProjectPoint(camera(), {0, 0, 0}).has_value());
  EXPECT_FALSE(ProjectPoint(camera(), {nan, 0, 1}).has_value());
  EXPECT_FALSE(ProjectPoint(camera(), {0, 0, nan}).has_value());
  // One such point makes the projection of a batch fail, with and without derivatives.
  Points3 points(3, 3);
  points << 0, 0, 0.1, 0, 0, 0.1, 1, -1, 1;
  Points2 pixels;
  ProjectionJacobian jacobian;
  EXPECT_FALSE(model().Project(camera().params.data(), points, &pixels, nullptr));
  EXPECT_FALSE(model().Project(camera().params.data(), points, &pixels, &jacobian));
}

TEST_P(CameraModelTest, DependsOnTheRayOnly) {
  const Points3 points = RandomPointsOfLens(1, 20);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const std::optional<Eigen::Vector2d> near = ProjectPoint(camera(), points.col(i));
    const std::optional<Eigen::Vector2d> far = ProjectPoint(camera(), 1000.0 * points.col(i));
    ASSERT_TRUE(near.has_value() && far.has_value());
    EXPECT_LT((*near - *far).norm(), 1e-9);  // px: round-off at coordinates of 1000 px.
  }
}

// Tests the whole image including its corners.
TEST_P(CameraModelTest, UnprojectInvertsProject) {
  for (int v = -10; v <= kHeightPx + 10; v += 20) {
    for (int u = -10; u <= kWidthPx + 10; u += 20) {
      const Eigen::Vector2d pixel(u, v);
      const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera(), pixel);
      ASSERT_TRUE(ray.has_value()) << pixel.transpose();
      EXPECT_NEAR(ray->norm(), 1.0, 1e-12);
      const std::optional<Eigen::Vector2d> back = ProjectPoint(camera(), *ray);
      ASSERT_TRUE(back.has_value());
      EXPECT_LT((*back - pixel).norm(), 1e-6);  // px: the tolerance that the model promises.
    }
  }
}

// Tests that the original ray is found, and not just a ray with the same projection.
TEST_P(CameraModelTest, UnprojectRecoversTheRayOfThePoint) {
  const Points3 points = RandomPointsOfLens(2, 200);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera(), *ProjectPoint(camera(), points.col(i)));
    ASSERT_TRUE(ray.has_value()) << points.col(i).transpose();
    // rad: 1e-9 px divided by a focal length of about 500 px, with a margin for the smaller gradient at the corners.
    EXPECT_LT(ray->cross(points.col(i).normalized()).norm(), 1e-10);
    EXPECT_GT(ray->dot(points.col(i)), 0);
  }
}

TEST_P(CameraModelTest, UnprojectRefusesInvalidPixels) {
  EXPECT_FALSE(UnprojectPixel(camera(), {std::nan(""), 0}).has_value());
  EXPECT_FALSE(UnprojectPixel(camera(), {0, std::numeric_limits<double>::infinity()}).has_value());
}

TEST_P(CameraModelTest, JacobiansMatchFiniteDifferences) {
  const int num_params = NumParams(model());
  Points3 points = RandomPointsOfLens(3, 30);
  points.col(0) << 0, 0, 1.5;         // A point on the optical axis.
  points.col(1) << 1e-10, -2e-10, 1;  // The formula of the fisheye changes near the axis.
  // The corners of the image, which fisheye lenses see at 90 deg from the axis and beyond.
  points.col(2) = *UnprojectPixel(camera(), {0, 0});
  points.col(3) = *UnprojectPixel(camera(), {kWidthPx - 1, kHeightPx - 1});
  Points2 pixels;
  ProjectionJacobian jacobian;
  ASSERT_TRUE(model().Project(camera().params.data(), points, &pixels, &jacobian));
  ASSERT_EQ(jacobian.u.rows(), 3 + num_params);
  ASSERT_EQ(jacobian.u.cols(), points.cols());
  ASSERT_EQ(jacobian.v.rows(), 3 + num_params);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    for (int j = 0; j < 3 + num_params; ++j) {
      const auto moved = [&](double step) {
        std::vector<double> params = camera().params;
        Points3 point = points.col(i);
        (j < 3 ? point(j, 0) : params[static_cast<size_t>(j - 3)]) += step;
        Points2 pixel;
        EXPECT_TRUE(model().Project(params.data(), point, &pixel, nullptr));
        return Eigen::Vector2d(pixel.col(0));
      };
      const double value = j < 3 ? points(j, i) : camera().params[static_cast<size_t>(j - 3)];
      const double step = 1e-5 * std::max(1.0, std::abs(value));
      // Central differences with Richardson extrapolation have an error of fourth order in the step.
      const Eigen::Vector2d wide = (moved(2 * step) - moved(-2 * step)) / (4 * step);
      const Eigen::Vector2d narrow = (moved(step) - moved(-step)) / (2 * step);
      const Eigen::Vector2d expected = (4 * narrow - wide) / 3;
      // Round-off of 1e-13 px (at 1000 px) divided by the step of 1e-5, and the same relative tolerance for large
      // derivatives.
      const double tolerance = 1e-7 + 1e-7 * expected.norm();
      EXPECT_NEAR(jacobian.u(j, i), expected.x(), tolerance)
          << "input " << j << ", point " << points.col(i).transpose();
      EXPECT_NEAR(jacobian.v(j, i), expected.y(), tolerance)
          << "input " << j << ", point " << points.col(i).transpose();
    }
  }
}

TEST_P(CameraModelTest, BatchesEqualSinglePoints) {
  const Points3 points = RandomPointsOfLens(4, 37);
  // The outputs have the size of another batch and must be resized.
  Points2 pixels(2, 5);
  ProjectionJacobian jacobian;
  ASSERT_TRUE(model().Project(camera().params.data(), points, &pixels, &jacobian));
  Points2 plain;
  ASSERT_TRUE(model().Project(camera().params.data(), points, &plain, nullptr));
  ASSERT_EQ(pixels.cols(), points.cols());
  // px: vectorised code may round differently.
  constexpr double kRoundOffPx = 1e-11;
  EXPECT_LT((pixels - plain).cwiseAbs().maxCoeff(), kRoundOffPx);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    Points2 pixel;
    ProjectionJacobian one;
    ASSERT_TRUE(model().Project(camera().params.data(), points.col(i), &pixel, &one));
    EXPECT_LT((pixel - pixels.col(i)).norm(), kRoundOffPx);
    EXPECT_LT((one.u - jacobian.u.col(i)).norm(), 1e-12 * one.u.norm());
    EXPECT_LT((one.v - jacobian.v.col(i)).norm(), 1e-12 * one.v.norm());
  }
  EXPECT_TRUE(model().Project(camera().params.data(), Points3(3, 0), &pixels, nullptr));
  EXPECT_EQ(pixels.cols(), 0);
}

INSTANTIATE_TEST_SUITE_P(Table, CameraModelTest, testing::ValuesIn(CameraCases()),
                         [](const auto& test) { return test.param.name; });

// Beyond the radius where barrel distortion folds back two rays share a pixel; the outer one is invalid.
TEST(FoldedDistortion, PixelsBeyondTheFoldHaveNoRay) {
  // r (1 - 0.3 r^2) is largest at r = 1.054, where it is 0.703.
  const Camera camera = {"brown5", kWidthPx, kHeightPx, {500, 500, 640, 480, -0.3, 0, 0, 0, 0}};
  EXPECT_FALSE(UnprojectPixel(camera, {640 + 500 * 0.71, 480}).has_value());
  const std::optional<Eigen::Vector3d> inside = UnprojectPixel(camera, {640 + 500 * 0.69, 480});
  ASSERT_TRUE(inside.has_value());
  EXPECT_LT(inside->x() / inside->z(), 1.054);
}

// The opposite case: the initial guess, the pixel's own radius, is beyond the fold, but the ray is not.
TEST(FoldedDistortion, RaysWithinTheFoldAreFoundFromAGuessBeyondIt) {
  // r (1 + r^2 - r^4) is largest at r = 0.916, where it is 1.040: for a ray at 0.8 the guess is 0.984, beyond the
  // fold.
  const Camera camera = {"brown5", kWidthPx, kHeightPx, {500, 500, 640, 480, 1, -1, 0, 0, 0}};
  for (const double r : {0.5, 0.8, 0.86, 0.89}) {
    const Eigen::Vector3d point_in_camera(r, 0, 1);
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, *ProjectPoint(camera, point_in_camera));
    ASSERT_TRUE(ray.has_value()) << r;
    EXPECT_NEAR(ray->x() / ray->z(), r, 1e-9);  // 1e-9 px divided by a slope of at least 20 px.
  }
}

// These tests pin the conventions of OpenCV and ROS with values that were derived by hand from their documentation.
TEST(CameraModelPins, Brown5MatchesTheReference) {
  // a = 0.5, b = 0.25, r2 = 0.3125; radial = 1 + 0.1 r2 - 0.2 r2^2 + 0.3 r2^3 = 1.020874023...
  const double r2 = 0.3125;
  const double radial = 1 + 0.1 * r2 - 0.2 * r2 * r2 + 0.3 * r2 * r2 * r2;
  const double a = 0.5 * radial + 2 * 0.01 * 0.125 + 0.02 * (r2 + 0.5);
  const double b = 0.25 * radial + 0.01 * (r2 + 0.125) + 2 * 0.02 * 0.125;
  const Camera camera = {"brown5", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.1, -0.2, 0.01, 0.02, 0.3}};
  const std::optional<Eigen::Vector2d> pixel = ProjectPoint(camera, {1, 0.5, 2});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_NEAR(pixel->x(), 100 * a + 10, 1e-12);
  EXPECT_NEAR(pixel->y(), 200 * b + 20, 1e-12);
}

TEST(CameraModelPins, Rational8ExtendsBrown5) {
  const Camera brown = {"brown5", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.1, -0.2, 0.01, 0.02, 0.3}};
  const std::optional<Camera> rational = ConvertCamera(brown, "rational8");
  ASSERT_TRUE(rational.has_value());
  EXPECT_LT((*ProjectPoint(*rational, {1, 0.5, 2}) - *ProjectPoint(brown, {1, 0.5, 2})).norm(), 1e-12);
  // The last three coefficients are in the denominator: with k4 = k1 and all others 0 the radial factor is 1.
  Camera divided = {"rational8", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.1, 0, 0, 0, 0, 0.1, 0, 0}};
  EXPECT_LT((*ProjectPoint(divided, {1, 0.5, 2}) - Eigen::Vector2d(60, 70)).norm(), 1e-12);
  EXPECT_FALSE(ConvertCamera(divided, "brown5").has_value());
  EXPECT_FALSE(ConvertCamera(brown, "kannala_brandt4").has_value());
}

TEST(CameraModelPins, KannalaBrandt4SeesBehindTheImagePlane) {
  // For a ray perpendicular to the axis theta = pi / 2 and r = theta (1 + 0.1 theta^2).
  const double theta = 1.5707963267948966;
  const Camera camera = {"kannala_brandt4", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.1, 0, 0, 0}};
  const std::optional<Eigen::Vector2d> pixel = ProjectPoint(camera, {3, 0, 0});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_NEAR(pixel->x(), 100 * theta * (1 + 0.1 * theta * theta) + 10, 1e-11);
  EXPECT_NEAR(pixel->y(), 20, 1e-12);
  const Eigen::Vector3d behind(1, 0.3, -0.4);
  const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, *ProjectPoint(camera, behind));
  ASSERT_TRUE(ray.has_value());
  EXPECT_LT((*ray - behind.normalized()).norm(), 1e-9);
}

// The values follow from the formulas of the papers: with xi = alpha = 0.5 and the point (3, 0, 4), d1 = 5, w = 6.5,
// d2 = sqrt(9 + 42.25), D = 0.5 d2 + 3.25.
TEST(CameraModelPins, DoubleSphereMatchesThePaper) {
  const Camera camera = {"double_sphere", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.5, 0.5}};
  EXPECT_NEAR(ProjectPoint(camera, {3, 0, 4})->x(), 100 * 3 / (0.5 * std::sqrt(51.25) + 3.25) + 10, 1e-12);
}

TEST(CameraModelPins, EucmMatchesThePaper) {
  // d = sqrt(4 * 9 + 16).
  const Camera camera = {"eucm", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.25, 4}};
  EXPECT_NEAR(ProjectPoint(camera, {3, 0, 4})->x(), 100 * 3 / (0.25 * std::sqrt(52.0) + 3) + 10, 1e-12);
}

TEST(CameraModelPins, OmniMatchesThePaper) {
  // a = 3 / (4 + 0.4 * 5) = 0.5; r^2 = 0.25.
  const Camera camera = {"omni", kWidthPx, kHeightPx, {100, 200, 10, 20, 0.4, 0.1, -0.2, 0.01, 0.02}};
  const double x = 0.5 * (1 + 0.1 * 0.25 - 0.2 * 0.0625) + 0.02 * (0.25 + 2 * 0.25);
  EXPECT_NEAR(ProjectPoint(camera, {3, 0, 4})->x(), 100 * x + 10, 1e-12);
  EXPECT_NEAR(ProjectPoint(camera, {3, 0, 4})->y(), 200 * 0.01 * 0.25 + 20, 1e-12);
}

// With xi = 0 the double sphere is the unified model, and so is eucm with beta = 1.
TEST(CameraModelPins, TheUnifiedModelsAgree) {
  const Camera sphere = {"double_sphere", kWidthPx, kHeightPx, {300, 310, 640, 480, 0, 0.6}};
  const Camera enhanced = {"eucm", kWidthPx, kHeightPx, {300, 310, 640, 480, 0.6, 1}};
  // alpha d + (1 - alpha) z = (1 - alpha) (z + xi d) with xi = alpha / (1 - alpha).
  const Camera omni = {"omni", kWidthPx, kHeightPx, {300 / 0.4, 310 / 0.4, 640, 480, 1.5, 0, 0, 0, 0}};
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0.3, -0.2, 1), Eigen::Vector3d(1, 0.5, 0.1), Eigen::Vector3d(1, -2, -0.4)}) {
    EXPECT_LT((*ProjectPoint(sphere, point) - *ProjectPoint(enhanced, point)).norm(), 1e-11);
    EXPECT_LT((*ProjectPoint(sphere, point) - *ProjectPoint(omni, point)).norm(), 1e-11);
  }
}

TEST(CameraModelPins, TheUnifiedModelsContainThePinhole) {
  const Camera pinhole = {"pinhole", kWidthPx, kHeightPx, {300, 310, 640, 480}};
  const Camera brown = {"brown4", kWidthPx, kHeightPx, {300, 310, 640, 480, 0.1, -0.2, 0.01, 0.02}};
  for (const std::string model : {"double_sphere", "eucm", "omni"}) {
    EXPECT_TRUE(ConvertCamera(pinhole, model).has_value()) << model;
    EXPECT_EQ(ConvertCamera(brown, model).has_value(), model == "omni") << model;
  }
  EXPECT_FALSE(ConvertCamera({"double_sphere", kWidthPx, kHeightPx, {300, 310, 640, 480, 0, 0.6}}, "pinhole"));
  EXPECT_FALSE(ConvertCamera({"omni", kWidthPx, kHeightPx, {300, 310, 640, 480, 0.1, 0, 0, 0, 0}}, "brown4"));
}

}  // namespace
}  // namespace heba
