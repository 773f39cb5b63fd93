#include "heba/data/prediction.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// Returns the centroid of the polygon with `corners` vertices on the imaged outline of the disc, px.
Eigen::Vector2d PolygonCentroid(const Camera& camera, const Rigid3d& camera_from_target, const Eigen::Vector3d& centre,
                                double radius_m, int corners) {
  std::vector<Eigen::Vector2d> outline;
  for (int k = 0; k < corners; ++k) {
    const double angle = 2 * M_PI * k / corners;
    const Eigen::Vector3d on_disc = centre + radius_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    outline.push_back(ProjectPoint(camera, camera_from_target * on_disc).value());
  }
  const Eigen::Vector2d origin = outline.front();
  double area = 0;
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  for (int k = 0; k < corners; ++k) {
    const Eigen::Vector2d a = outline[static_cast<size_t>(k)] - origin;
    const Eigen::Vector2d b = outline[static_cast<size_t>((k + 1) % corners)] - origin;
    const double cross = a.x() * b.y() - a.y() * b.x();
    area += cross / 2;
    moment += cross / 6 * (a + b);
  }
  return origin + moment / area;
}

Observations OneDisc(const Eigen::Vector3d& centre, double radius_m) {
  Observations observations;
  observations.ids = {0};
  observations.points_in_target = centre;
  observations.pixels = Points2::Zero(2, 1);
  observations.radii_m = Eigen::VectorXd::Constant(1, radius_m);
  return observations;
}

struct DiscCase {
  double focal_px;
  double radius_px;
  double tilt_deg;
  Eigen::Vector2d off_axis;  // x / z and y / z of the centre.
  double k1;
  double tolerance_px;
};

// The size, the tilt and the distance from the optical axis of these discs cover those in robot cells and exceed
// them. The predicted bias is up to 0.9 px.
TEST(PredictionTest, PredictsTheCentroidOfADiscsImage) {
  const DiscCase cases[] = {
      {2400, 10, 30, {0.3, 0.2}, -0.10, 1e-5}, {2400, 20, 40, {0.4, 0.3}, -0.10, 1e-5},
      {1200, 20, 40, {0.5, 0.4}, -0.20, 1e-5}, {600, 20, 40, {0.7, 0.5}, -0.28, 1e-4},
      {600, 40, 40, {0.7, 0.5}, -0.28, 1e-3},
  };
  for (const DiscCase& disc : cases) {
    SCOPED_TRACE(std::to_string(disc.focal_px) + " px, radius " + std::to_string(disc.radius_px) + " px");
    const Camera camera{"brown5", 2000, 1500, {disc.focal_px, disc.focal_px, 1000, 750, disc.k1, 0, 0, 0, 0}};
    constexpr double kDepthM = 0.9;
    const double radius_m = disc.radius_px * kDepthM / disc.focal_px;
    const Rigid3d pose(ExpRotation(DegToRad(disc.tilt_deg) * Eigen::Vector3d(0.6, -0.8, 0)),
                       kDepthM * Eigen::Vector3d(disc.off_axis.x(), disc.off_axis.y(), 1));
    const Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    Points2 predicted;
    ASSERT_TRUE(Predict(camera.Model(), camera.params.data(), pose, OneDisc(centre, radius_m), &predicted, nullptr));
    const Eigen::Vector2d expected = PolygonCentroid(camera, pose, centre, radius_m, 4096);
    EXPECT_LT((predicted.col(0) - expected).norm(), disc.tolerance_px);
    // The bias that is ignored if the centre of the disc is projected instead.
    EXPECT_GT((ProjectPoint(camera, pose * centre).value() - expected).norm(), 0.01);
  }
}

class PredictionJacobianTest : public testing::TestWithParam<std::string> {};

TEST_P(PredictionJacobianTest, MatchesFiniteDifferences) {
  const Camera camera = TestCamera(GetParam());
  Observations observations;
  observations.ids = {0, 1, 2};
  observations.points_in_target.resize(3, 3);
  observations.points_in_target << 0, 0.05, -0.04, 0, -0.03, 0.06, 0, 0, 0;
  observations.pixels = Points2::Zero(2, 3);
  observations.radii_m.resize(3);
  observations.radii_m << 0.015, 0, 0.008;
  const Rigid3d pose(ExpRotation({0.4, -0.5, 0.9}), {0.08, -0.05, 0.5});
  Points2 pixels;
  ProjectionJacobian jacobian;
  ASSERT_TRUE(Predict(camera.Model(), camera.params.data(), pose, observations, &pixels, &jacobian));
  for (int k = 0; k < 6 + NumParams(camera.Model()); ++k) {
    const double step = k < 6 ? 1e-6 : 1e-6 * std::max(1.0, std::abs(camera.params[static_cast<size_t>(k - 6)]));
    Points2 ends[2];
    for (const int side : {0, 1}) {
      const double h = side == 0 ? -step : step;
      std::vector<double> params = camera.params;
      Rigid3d moved = pose;
      if (k < 3) moved = Rigid3d(Eigen::Quaterniond::Identity(), h * Eigen::Vector3d::Unit(k)) * pose;
      if (k >= 3 && k < 6) {
        moved = Rigid3d(ExpRotation(h * Eigen::Vector3d::Unit(k - 3)), Eigen::Vector3d::Zero()) * pose;
      }
      if (k >= 6) params[static_cast<size_t>(k - 6)] += h;
      ASSERT_TRUE(Predict(camera.Model(), params.data(), moved, observations, &ends[side], nullptr));
    }
    const Points2 numeric = (ends[1] - ends[0]) / (2 * step);
    const double size = 1e-6 * (1 + numeric.norm());
    EXPECT_LT((jacobian.u.row(k) - numeric.row(0)).norm(), size) << "column " << k;
    EXPECT_LT((jacobian.v.row(k) - numeric.row(1)).norm(), size) << "column " << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Models, PredictionJacobianTest, testing::ValuesIn(CameraModelNames()),
                         [](const auto& test) { return test.param; });

TEST(PredictionTest, ADiscThatReachesBehindTheCameraHasNoImage) {
  const Camera camera = TestCamera();
  const Rigid3d pose(ExpRotation({1.5, 0, 0}), {0, 0, 0.05});
  Points2 pixels;
  EXPECT_FALSE(
      Predict(camera.Model(), camera.params.data(), pose, OneDisc(Eigen::Vector3d::Zero(), 0.1), &pixels, nullptr));
}

}  // namespace
}  // namespace heba
