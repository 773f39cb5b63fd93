#include "solvers/calibration/residual_structure.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/bundle_adjustment.h"
#include "heba/data/hand_eye.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

ResidualStructure StructureOf(const TestScene& scene, const TestSceneOptions& scene_options) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {};
  const PairProblem problem{scene.camera, scene.views, scene_options.setup, DesignedShape(scene_options.points)};
  const Outcome<PairSolution> solution = RefineHandEye(problem, scene.hand_eye, options);
  EXPECT_TRUE(solution.ok()) << solution.reason();
  return FindResidualStructure(HandEyeProblem(problem, options), ProblemSolution(*solution));
}

TEST(ResidualStructureTest, NamesThePointThatIsPrintedAskew) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  const TestScene scene = MakeTestScene(4, options);
  TestScene askew = scene;
  constexpr Eigen::Index kAskew = 13;
  const Eigen::Vector3d deviation_m(3e-4, -2e-4, 0);
  // The design says that the point lies elsewhere than it does.
  for (View& view : askew.views) view.observations.points_in_target.col(kAskew) -= deviation_m;
  const ResidualStructure structure = StructureOf(askew, options);
  ASSERT_EQ(structure.findings.size(), 1U);
  const Finding& finding = structure.findings.front();
  EXPECT_EQ(finding.code, "target_points");
  EXPECT_EQ(finding.grade, Grade::kGood);
  EXPECT_EQ(finding.Number("largest_id"), kAskew);
  EXPECT_EQ(finding.Number("points"), 48);
  for (const PointDeviation& one : structure.points) {
    if (one.id != kAskew) continue;
    EXPECT_LT(one.p_value, 1e-12);
    EXPECT_LT((one.deviation_m - deviation_m).norm(), 0.2 * deviation_m.norm());
  }
}

TEST(ResidualStructureTest, NamesTheRegionThatTheLensLacks) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  options.num_captures = 30;
  TestScene scene = MakeTestScene(5, options);
  const double width_px = scene.camera.width_px;
  for (View& view : scene.views) {
    for (Eigen::Index i = 0; i < view.observations.size(); ++i) {
      if (view.observations.pixels(0, i) > 0.75 * width_px) view.observations.pixels(1, i) += 0.3;
    }
  }
  bool has_region = false;
  for (const Finding& finding : StructureOf(scene, options).findings) {
    if (finding.code != "image_regions") continue;
    has_region = true;
    EXPECT_GT(*finding.Number("at_u_px"), 0.6 * width_px);
  }
  EXPECT_TRUE(has_region);
}

// Noise alone has no structure: the probabilities are those of all points and regions together.
TEST(ResidualStructureTest, FindsNoneInNoise) {
  int num_found = 0;
  for (uint64_t seed = 1; seed <= 30; ++seed) {
    TestSceneOptions options;
    options.noise_px = 0.1;
    num_found += StructureOf(MakeTestScene(seed, options), options).findings.empty() ? 0 : 1;
  }
  EXPECT_LE(num_found, 1);
}

}  // namespace
}  // namespace heba
