#include "tools/pages/rig_comparison.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/units.h"
#include "tests/support/input_error.h"

namespace heba {
namespace {
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr double kSigmaM = 1e-3;
constexpr double kSigmaRad = 2e-3;

Rigid3d Shifted(double x_m) { return {Eigen::Quaterniond::Identity(), {x_m, 0, 0}}; }

struct RigOptions {
  std::vector<std::string> arms = {"robot"};
  Rigid3d world_from_camera = {};
  Rigid3d world_from_second_base = {};
  double dof = std::numeric_limits<double>::infinity();
};

// A rig with a camera `top` on the world, a camera `side` on the base of the last arm, and a target `plate` on the
// gripper of the first. All poses have the same sigmas and are not correlated.
RigResult RigOf(const RigOptions& options) {
  RigResult result;
  RigProblem& rig = result.rig;
  rig.robots = options.arms;
  rig.cameras.push_back({"top", {0, Mount::Part::kBase}, {}});
  rig.cameras.push_back({"side", {options.arms.size() - 1, Mount::Part::kBase}, {}});
  rig.targets.push_back({"plate", {0, Mount::Part::kGripper}, {}});
  for (RigCamera& camera : rig.cameras) camera.camera = {"pinhole", 640, 480, {600, 600, 320, 240}};
  RigSolution& solution = result.solution;
  solution.poses.mount_from_camera = {options.world_from_camera, Rigid3d()};
  solution.poses.mount_from_target = {Rigid3d()};
  solution.poses.world_from_base.assign(options.arms.size(), Rigid3d());
  if (options.arms.size() > 1) solution.poses.world_from_base[1] = options.world_from_second_base;
  solution.covariance.layout = RigUnknowns(rig);
  const int size = solution.covariance.layout.size();
  solution.covariance.matrix = Eigen::MatrixXd::Zero(size, size);
  for (int i = 0; i < size; ++i) {
    const double sigma = i % 6 < 3 ? kSigmaM : kSigmaRad;
    solution.covariance.matrix(i, i) = sigma * sigma;
  }
  solution.covariance_dof = options.dof;
  result.errors = {{0.2, 0.3, 0.4, 0.05, {}, {}}, {0.5, {}, {}, {}, {}, {}}};
  result.relative_cameras = RelativeCameraPoses(rig, solution);
  result.timing.total_s = 1.5;
  return result;
}

// The run of one stationary camera alone.
RunResult RunOf(const std::string& name, const Rigid3d& base_from_camera) {
  RunResult result;
  result.name = name;
  result.setup = Setup::kEyeToHand;
  Estimate refined;
  refined.method = kBundleMethod;
  refined.kind = EstimateKind::kRefined;
  refined.ok = true;
  refined.hand_eye.camera_mount_from_camera = base_from_camera;
  refined.errors.holdout_rms_px = 0.7;
  refined.solution.emplace();
  refined.solution->covariance.layout = HandEyePoses();
  refined.solution->covariance.matrix = kSigmaM * kSigmaM * Eigen::MatrixXd::Identity(12, 12);
  result.estimates = {refined};
  return result;
}

RigComparison Compare(const RigOptions& first, const RigOptions& second) {
  return CompareRigs({CellOf("a", RigOf(first)), CellOf("b", RigOf(second))});
}

const CellDifference& Find(const RigComparison& comparison, const std::string& name) {
  for (const CellDifference& difference : comparison.differences) {
    if (difference.name.Text() == name) return difference;
  }
  throw InputError("there is no " + name);
}

TEST(CompareRigsTest, StatesTheDifferenceOfEveryPoseWithItsSigmas) {
  const Rigid3d moved(ExpRotation({0, 0.01, 0}), {0.003, 0.004, 0});
  const RigComparison comparison = Compare({}, {.world_from_camera = moved});
  std::vector<std::string> names;
  for (const CellDifference& difference : comparison.differences) names.push_back(difference.name.Text());
  EXPECT_THAT(names, testing::ElementsAre("camera top in world", "camera side in world", "camera side in camera top",
                                          "target plate in gripper"));
  const CellDifference& camera = Find(comparison, "camera top in world");
  EXPECT_NEAR(camera.distance_mm, 5, 1e-9);
  EXPECT_NEAR(camera.angle_deg, RadToDeg(0.01), 1e-9);
  // Each run contributes three variances.
  EXPECT_NEAR(camera.sigma_mm, 1000 * std::sqrt(6) * kSigmaM, 1e-9);
  EXPECT_NEAR(camera.sigma_deg, RadToDeg(std::sqrt(6) * kSigmaRad), 1e-9);
  EXPECT_NEAR(Find(comparison, "target plate in gripper").distance_mm, 0, 1e-12);
}

// The statistic of a shift by d along one axis is d^2 / (2 sigma^2), with six degrees of freedom.
TEST(CompareRigsTest, ChanceUsesTheSmallerNumberOfDegreesOfFreedom) {
  const RigComparison comparison = Compare({.dof = 100}, {.world_from_camera = Shifted(5e-3), .dof = 10});
  const double statistic = 25e-6 / (2 * kSigmaM * kSigmaM);
  EXPECT_NEAR(Find(comparison, "camera top in world").p_value, FisherTail(statistic / 6, 6, 10), 1e-9);
}

// The camera on the base of the second arm has the uncertainty of that base in the world too: both translations, and
// the rotation of the base by its distance.
TEST(CompareRigsTest, PosesInTheWorldHaveTheUncertaintyOfTheBase) {
  const double distance_m = 0.5;
  RigResult rig = RigOf({.arms = {"left", "right"}});
  rig.solution.poses.mount_from_camera[1] = Shifted(distance_m);
  const ComparedCell cell = CellOf("a", rig);
  ASSERT_THAT(cell.cameras, SizeIs(2));
  EXPECT_NEAR(cell.cameras[0].sigma_mm, 1000 * std::sqrt(3) * kSigmaM, 1e-9);
  const double lever_m = distance_m * kSigmaRad;
  EXPECT_NEAR(cell.cameras[1].sigma_mm, 1000 * std::sqrt(6 * kSigmaM * kSigmaM + 2 * lever_m * lever_m), 1e-9);
  EXPECT_NEAR(cell.cameras[1].sigma_deg, RadToDeg(std::sqrt(6) * kSigmaRad), 1e-9);
}

TEST(CompareRigsTest, BasesOfArmsAreCompared) {
  const std::vector<std::string> arms = {"left", "right"};
  const RigComparison comparison = Compare({.arms = arms}, {.arms = arms, .world_from_second_base = Shifted(0.02)});
  EXPECT_NEAR(Find(comparison, "base of arm right in world").distance_mm, 20, 1e-9);
  EXPECT_NEAR(Find(comparison, "camera side in world").distance_mm, 20, 1e-9);
  EXPECT_THAT(comparison.findings,
              Contains(StartsWith("poses of arms differ by more than their uncertainties in 1 of 1")));
}

// A pose between two cameras is the same difference in whichever order the configs list them.
TEST(CompareRigsTest, OrderOfTheCamerasDoesNotMatter) {
  const Rigid3d moved(ExpRotation({0.3, -0.2, 0.5}), {0.2, 0.1, -0.3});
  const Rigid3d other = moved * Rigid3d(ExpRotation({0.001, 0, 0}), {0.001, 0, 0});
  const ComparedCell first = CellOf("a", RigOf({.world_from_camera = moved}));
  RigResult swapped = RigOf({.world_from_camera = other});
  std::swap(swapped.rig.cameras[0], swapped.rig.cameras[1]);
  std::swap(swapped.solution.poses.mount_from_camera[0], swapped.solution.poses.mount_from_camera[1]);
  swapped.relative_cameras = RelativeCameraPoses(swapped.rig, swapped.solution);
  const RigComparison same = CompareRigs({first, CellOf("b", RigOf({.world_from_camera = other}))});
  const RigComparison inverted = CompareRigs({first, CellOf("b", swapped)});
  const CellDifference& a = Find(same, "camera side in camera top");
  const CellDifference& b = Find(inverted, "camera side in camera top");
  EXPECT_GT(a.distance_mm, 0.1);
  EXPECT_NEAR(a.distance_mm, b.distance_mm, 1e-9);
  EXPECT_NEAR(a.sigma_mm, b.sigma_mm, 1e-9);
  EXPECT_NEAR(a.sigma_deg, b.sigma_deg, 1e-9);
  EXPECT_NEAR(a.p_value, b.p_value, 1e-9);
}

TEST(CompareRigsTest, TheRunOfOneCameraIsComparedByItsName) {
  const RigComparison comparison = CompareRigs({CellOf("a", RigOf({})), CellOf("alone", RunOf("top", Shifted(0.02)))});
  ASSERT_THAT(comparison.differences, SizeIs(1));
  EXPECT_NEAR(Find(comparison, "camera top in world").distance_mm, 20, 1e-9);
  // The other poses are not expected in it.
  EXPECT_THAT(comparison.findings, Not(Contains(StartsWith("not in all rigs"))));
}

TEST(CompareRigsTest, RunsThatCannotBeComparedAreRefused) {
  EXPECT_THAT(InputErrorOf([] {
                CompareRigs({CellOf("a", RigOf({})), CellOf("alone", RunOf("front", {}))});
              }),
              StartsWith("alone: is the run of one camera; a rig beside it needs a camera front in world"));
  EXPECT_THAT(
      InputErrorOf([] {
        Compare({.arms = {"left", "right"}}, {.arms = {"right", "left"}});
      }),
      AllOf(StartsWith("b: its world is the base of arm right"), HasSubstr("that of a is the base of arm left")));
  EXPECT_THAT(InputErrorOf([] {
                CompareRigs({CellOf("a", RigOf({.arms = {"left", "right"}})), CellOf("alone", RunOf("top", {}))});
              }),
              StartsWith("alone: its world is the base of an arm without a name"));
  RunResult failed = RunOf("top", {});
  failed.estimates.clear();
  EXPECT_THAT(InputErrorOf([&] { CellOf("alone", failed); }), StartsWith("alone: has no refined estimate"));
}

TEST(RigFindingsTest, SayWhetherThePosesAgreeAndWhatIsMissing) {
  EXPECT_THAT(Compare({}, {.world_from_camera = Shifted(1e-3)}).findings,
              Contains(StartsWith("poses of cameras agree within their uncertainties in all 2 pairs; the least likely: "
                                  "camera top in world: a and b are 1.0 mm and 0 deg apart")));
  RigResult renamed = RigOf({});
  renamed.rig.cameras[1].name = "front";
  renamed.solution.covariance.layout = RigUnknowns(renamed.rig);
  renamed.relative_cameras = RelativeCameraPoses(renamed.rig, renamed.solution);
  EXPECT_THAT(CompareRigs({CellOf("a", RigOf({})), CellOf("b", renamed)}).findings,
              Contains("not in all rigs: camera side in world (not in b), camera front in world (not in a)"));
}

TEST(RigComparisonOutputTest, TablesAndFilesHaveEveryFigure) {
  const RigComparison comparison = Compare({}, {.world_from_camera = Shifted(0.02)});
  const std::string table = RigComparisonTable(comparison);
  EXPECT_THAT(table, HasSubstr("\na                    top                 0.200    0.300    0.400    1.73   0.198\n"));
  EXPECT_THAT(table, HasSubstr("\nb                    side                0.500        -        -    1.73   0.198\n"));
  EXPECT_THAT(table, HasSubstr("\na and b\n"));
  EXPECT_THAT(table, HasSubstr("\n  camera top in world                     20    2.4       0   0.28"));
  EXPECT_THAT(table, HasSubstr(" differ\n"));
  const std::string runs = RigComparisonRunsCsv(comparison);
  EXPECT_THAT(runs, StartsWith("run,camera,verdict,reprojection_rms_px,"));
  EXPECT_THAT(runs, HasSubstr("\na,top,good,0.2,0.3,0.4,0.05,1.732"));
  EXPECT_THAT(runs, HasSubstr("\nb,side,good,0.5,,,,1.732"));
  const std::string pairs = RigComparisonPairsCsv(comparison);
  EXPECT_THAT(pairs, StartsWith("first,second,kind,parent,child,distance_mm,angle_deg,std_mm,std_deg,p_value,verdict\n"
                                "a,b,camera,world,top,20,0,"));
  EXPECT_THAT(pairs, HasSubstr("\na,b,camera_in_camera,top,side,"));
  EXPECT_THAT(pairs, HasSubstr("\na,b,target,gripper,plate,0,0,"));
}

TEST(RigComparisonOutputTest, TheTerminalShowsTheThreePairsThatDifferMost) {
  std::vector<ComparedCell> runs;
  for (int i = 0; i < 4; ++i) {
    runs.push_back(CellOf("r" + std::to_string(i), RigOf({.world_from_camera = Shifted(2e-3 * i * i)})));
  }
  const std::string table = RigComparisonTable(CompareRigs(std::move(runs)));
  EXPECT_THAT(table, HasSubstr("and 3 more pairs of runs\n"));
  EXPECT_LT(table.find("\nr0 and r3\n"), table.find("\nr1 and r3\n"));
  EXPECT_THAT(table, Not(HasSubstr("\nr0 and r1\n")));
}

TEST(RigComparisonOutputTest, ThePageEscapesNames) {
  RigResult rig = RigOf({});
  const std::string page = RigComparisonPage(CompareRigs({CellOf("<b>x</b>", rig), CellOf("y", rig)}));
  EXPECT_THAT(page, HasSubstr("<h1>Comparison of 2 runs</h1>"));
  EXPECT_THAT(page, HasSubstr("&lt;b&gt;x&lt;/b&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<b>x")));
}

}  // namespace
}  // namespace heba
