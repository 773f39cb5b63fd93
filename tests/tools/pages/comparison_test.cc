#include "tools/pages/comparison.h"

#include <cmath>
#include <limits>
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
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr double kSigmaM = 1e-3;
constexpr double kSigmaRad = 2e-3;

struct ShortRunOptions {
  Rigid3d hand_eye = {};
  double refined_px = 0.2;
  double closed_px = 0.3;
  std::string target_type = "chessboard";
  Setup setup = Setup::kEyeToHand;
};

// The run of one camera alone.
RunResult RunOf(const std::string& name, const ShortRunOptions& options) {
  RunResult result = ShortResult(options.setup, options.target_type, 48);
  result.name = name;
  result.timing.total_s = 1.5;
  Estimate closed;
  closed.method = "park";
  closed.kind = EstimateKind::kClosedForm;
  closed.ok = true;
  closed.errors.holdout_rms_px = options.closed_px;
  Estimate worse = closed;
  worse.method = "tsai";
  worse.errors.holdout_rms_px = 2 * options.closed_px;
  Estimate refined;
  refined.method = kBundleMethod;
  refined.kind = EstimateKind::kRefined;
  refined.ok = true;
  refined.hand_eye.camera_mount_from_camera = options.hand_eye;
  refined.errors.holdout_rms_px = options.refined_px;
  refined.errors.board_scatter = BoardScatter{0.4, 0.05};
  refined.solution.emplace();
  refined.solution->hand_eye = refined.hand_eye;
  Covariance& covariance = refined.solution->covariance;
  covariance.layout = HandEyePoses();
  covariance.matrix = Eigen::MatrixXd::Identity(12, 12);
  covariance.matrix.diagonal().head<3>().setConstant(kSigmaM * kSigmaM);
  covariance.matrix.diagonal().segment<3>(3).setConstant(kSigmaRad * kSigmaRad);
  result.estimates = {worse, closed, refined};
  return WithFinalEstimate(std::move(result));
}

Rigid3d Shifted(double x_m) { return {Eigen::Quaterniond::Identity(), {x_m, 0, 0}}; }

Comparison Compare(const std::vector<RunResult>& results) {
  std::vector<ComparedRun> runs;
  for (const RunResult& result : results) runs.push_back(ComparedRunOf(result.name, WithFinalEstimate(result)));
  return CompareRuns(std::move(runs));
}

TEST(CompareRunsTest, StatesDistanceAngleAndTheirSigmas) {
  const Rigid3d other(ExpRotation({0, 0.01, 0}), {0.003, 0.004, 0});
  const Comparison comparison = Compare({RunOf("a", {}), RunOf("b", {.hand_eye = other})});
  ASSERT_THAT(comparison.differences, SizeIs(1));
  const RunDifference& pair = comparison.differences[0];
  EXPECT_EQ(pair.first, 0u);
  EXPECT_EQ(pair.second, 1u);
  EXPECT_NEAR(pair.distance_mm, 5, 1e-9);
  EXPECT_NEAR(pair.angle_deg, RadToDeg(0.01), 1e-9);
  // Each run contributes three variances.
  EXPECT_NEAR(pair.sigma_mm, 1000 * std::sqrt(6) * kSigmaM, 1e-9);
  EXPECT_NEAR(pair.sigma_deg, RadToDeg(std::sqrt(6) * kSigmaRad), 1e-9);
}

// The statistic of a shift by d along one axis is d^2 / (2 sigma^2), chi-square with six degrees of freedom.
TEST(CompareRunsTest, ChanceIsThatOfAChiSquareIfTheNoiseIsKnown) {
  for (const double shift_m : {0.0, 1e-3, 4e-3, 7e-3}) {
    const Comparison comparison = Compare({RunOf("a", {}), RunOf("b", {.hand_eye = Shifted(shift_m)})});
    const double statistic = shift_m * shift_m / (2 * kSigmaM * kSigmaM);
    EXPECT_NEAR(comparison.differences.at(0).p_value, ChiSquareTail(statistic, 6), 1e-9) << shift_m;
  }
}

TEST(CompareRunsTest, ChanceUsesTheSmallerNumberOfDegreesOfFreedom) {
  RunResult first = RunOf("a", {});
  RunResult second = RunOf("b", {.hand_eye = Shifted(5e-3)});
  first.estimates.back().solution->covariance_dof = 100;
  second.estimates.back().solution->covariance_dof = 10;
  const double statistic = 25e-6 / (2 * kSigmaM * kSigmaM);
  EXPECT_NEAR(Compare({first, second}).differences.at(0).p_value, FisherTail(statistic / 6, 6, 10), 1e-9);
}

TEST(CompareRunsTest, EveryPairIsComparedOnce) {
  const Comparison comparison = Compare({RunOf("a", {}), RunOf("b", {}), RunOf("c", {})});
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const RunDifference& pair : comparison.differences) pairs.emplace_back(pair.first, pair.second);
  EXPECT_THAT(pairs, ElementsAre(testing::Pair(0, 1), testing::Pair(0, 2), testing::Pair(1, 2)));
}

TEST(CompareRunsTest, RunsWithoutAComparablePoseHaveNoPair) {
  EXPECT_THAT(Compare({RunOf("a", {}), RunOf("b", {.setup = Setup::kEyeInHand})}).differences, SizeIs(0));
  RunResult failed = RunOf("b", {});
  failed.estimates.back().ok = false;
  EXPECT_THAT(Compare({RunOf("a", {}), failed}).differences, SizeIs(0));
  RunResult held = RunOf("b", {});
  RunResult also_held = RunOf("c", {});
  for (RunResult* run : {&held, &also_held}) run->estimates.back().solution->covariance.matrix.setZero();
  EXPECT_THAT(Compare({held, also_held}).differences, SizeIs(0));
}

// The best closed form of all runs is park, with an error of 0.3 px.
TEST(FindingsTest, StateTheGainOverTheBestClosedForm) {
  const Comparison comparison =
      Compare({RunOf("a", {}), RunOf("b", {.refined_px = 0.6}), RunOf("c", {.refined_px = 0.25})});
  EXPECT_EQ(
      comparison.findings.at(0),
      "hold-out error in px: the refinement is better than the best closed form in 2 of 3 runs; the closed form's "
      "error is 1.2 times the refinement's (median; 0.50 to 1.5)");
}

TEST(FindingsTest, SayThatNoRunHasHoldOutFigures) {
  RunResult run = RunOf("a", {});
  for (Estimate& estimate : run.estimates) estimate.errors.holdout_rms_px.reset();
  EXPECT_EQ(Compare({run}).findings.at(0), "no run has hold-out figures for comparing methods (evaluate.folds)");
}

TEST(FindingsTest, SayWhetherTheRunsAgree) {
  EXPECT_THAT(Compare({RunOf("a", {}), RunOf("b", {.hand_eye = Shifted(1e-3)})}).findings,
              Contains(StartsWith("hand-eye poses from targets of one type agree within their uncertainties in all 1 "
                                  "pairs; the least likely: a and b are 1.0 mm and 0 deg apart")));
  EXPECT_THAT(Compare({RunOf("a", {}), RunOf("b", {}), RunOf("c", {.hand_eye = Shifted(9e-3)})}).findings,
              Contains(StartsWith("hand-eye poses from targets of one type differ by more than their uncertainties in "
                                  "2 of 3 pairs; the worst: a and c are 9.0 mm")));
}

TEST(FindingsTest, DistinguishTypesOfTargets) {
  const std::vector<std::string> findings = Compare({RunOf("a", {}), RunOf("b", {.target_type = "charuco"})}).findings;
  EXPECT_THAT(findings, Contains(StartsWith("hand-eye poses from targets of different types agree")));
  EXPECT_THAT(findings, Not(Contains(StartsWith("hand-eye poses from targets of one type"))));
  EXPECT_THAT(findings, Contains("one sigma of the hand-eye translation by target (median): charuco 1.7 mm, chessboard "
                                 "1.7 mm"));
}

TEST(FindingsTest, StateTrueErrorsIfThereIsATruth) {
  RunResult run = RunOf("a", {});
  EXPECT_THAT(Compare({run}).findings, Not(Contains(HasSubstr("true error"))));
  for (Estimate& estimate : run.estimates) estimate.errors.truth = TruthErrors{};
  run.estimates[1].errors.truth->hand_eye_mm = 0.6;
  run.estimates[2].errors.truth->hand_eye_mm = 0.2;
  run.estimates[1].errors.truth->hand_eye_deg = 0.1;
  run.estimates[2].errors.truth->hand_eye_deg = 0.2;
  const std::vector<std::string> findings = Compare({run}).findings;
  EXPECT_THAT(findings, Contains(HasSubstr("true error in mm of the closed form with the smallest hold-out RMS: the "
                                           "refinement is better than the best closed form in 1 of 1 runs")));
  EXPECT_THAT(findings, Contains(HasSubstr("true error in deg of the same closed form: the refinement is better than "
                                           "the best closed form in 0 of 1 runs")));
}

TEST(FindingsTest, WarnThatRobotNoiseHidesTheGain) {
  RunResult run = RunOf("a", {});
  EXPECT_THAT(Compare({run}).findings, Not(Contains(StartsWith("if robot noise is modelled"))));
  run.estimates.back().solution->robot_noise = RobotNoise{1e-4, 1e-4};
  EXPECT_THAT(Compare({run}).findings, Contains(StartsWith("if robot noise is modelled")));
}

TEST(ComparisonTableTest, HasALineForEachRunAndPair) {
  const std::string table =
      ComparisonTable(Compare({RunOf("a", {}), RunOf("a_name_that_is_too_long_for_it", {.hand_eye = Shifted(0.02)})}));
  EXPECT_THAT(table, HasSubstr("\na                    chessboard         0.300    0.200     1.73    0.400     1.5\n"));
  EXPECT_THAT(table, HasSubstr("\n..is_too_long_for_it "));
  EXPECT_THAT(table, HasSubstr("\na                 ..too_long_for_it       20    2.4       0   0.28"));
  EXPECT_THAT(table, HasSubstr(" differ\n"));
}

TEST(ComparisonTableTest, CutsLongNamesBetweenCharacters) {
  std::string umlauts;
  for (int i = 0; i < 18; ++i) umlauts += "\xC3\xA4";
  EXPECT_THAT(ComparisonTable(Compare({RunOf("abc" + umlauts, {})})), HasSubstr("\n.." + umlauts + " chessboard  "));
}

TEST(ComparisonTableTest, NamesTheTenLeastLikelyPairs) {
  std::vector<RunResult> runs;
  for (int i = 0; i < 6; ++i) runs.push_back(RunOf("r" + std::to_string(i), {.hand_eye = Shifted(1e-3 * i * i)}));
  const std::string table = ComparisonTable(Compare(runs));
  EXPECT_THAT(table, HasSubstr("and 5 more pairs\n"));
  const std::string gap(16, ' ');
  const size_t first = table.find("r0" + gap + "r5");
  ASSERT_NE(first, std::string::npos);
  EXPECT_LT(first, table.find("r1" + gap + "r5"));
  EXPECT_EQ(table.find("r0" + gap + "r1"), std::string::npos);
}

TEST(ComparisonCsvTest, HasTheFiguresInFullPrecision) {
  const Comparison comparison = Compare({RunOf("a,b", {}), RunOf("c", {.hand_eye = Shifted(0.02)})});
  const std::string runs = ComparisonRunsCsv(comparison);
  EXPECT_THAT(runs, StartsWith("run,setup,target,closed_form,closed_form_holdout_px,refined_holdout_px,"));
  EXPECT_THAT(runs, HasSubstr("\n\"a,b\",eye_to_hand,chessboard,park,0.3,0.2,1.732"));
  EXPECT_THAT(runs, HasSubstr(",0.4,0.05,1.5\n"));
  const std::string pairs = ComparisonPairsCsv(comparison);
  EXPECT_THAT(pairs, StartsWith("first,second,distance_mm,angle_deg,std_mm,std_deg,p_value,verdict\n\"a,b\",c,20,0,"));
  EXPECT_THAT(pairs, testing::EndsWith(",differ\n"));
}

TEST(ComparisonCsvTest, MissingFiguresAreEmpty) {
  RunResult run = RunOf("a", {});
  run.estimates.clear();
  EXPECT_THAT(ComparisonRunsCsv(Compare({run})), HasSubstr("\na,eye_to_hand,chessboard,,,,,,,,1.5\n"));
}

TEST(ComparisonPageTest, EscapesNamesAndFindings) {
  const Comparison comparison = Compare({RunOf("<b>x</b>", {}), RunOf("y", {.hand_eye = Shifted(0.02)})});
  const std::string page = ComparisonPage(comparison);
  EXPECT_THAT(page, HasSubstr("<h1>Comparison of 2 runs</h1>"));
  EXPECT_THAT(page, HasSubstr("&lt;b&gt;x&lt;/b&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<b>x")));
}

struct AdjustmentOptions {
  std::vector<std::string> arms = {"robot"};
  Rigid3d world_from_camera = {};
  Rigid3d world_from_second_base = {};
  double dof = std::numeric_limits<double>::infinity();
};

// A rig with a camera `top` on the world, a camera `side` on the base of the last arm, and a target `plate` on the
// gripper of the first. All poses have the same sigmas and are not correlated.
RunResult CellOf(const AdjustmentOptions& options) {
  RunResult result;
  Problem& rig = result.rig;
  rig.robots = options.arms;
  rig.cameras.push_back({"top", {0, Mount::Part::kBase}, {}});
  rig.cameras.push_back({"side", {options.arms.size() - 1, Mount::Part::kBase}, {}});
  rig.targets.push_back({"plate", {0, Mount::Part::kGripper}, {}});
  for (ProblemCamera& camera : rig.cameras) camera.camera = {"pinhole", 640, 480, {600, 600, 320, 240}};
  Solution& solution = result.solution;
  solution.poses.mount_from_camera = {options.world_from_camera, Rigid3d()};
  solution.poses.mount_from_target = {Rigid3d()};
  solution.poses.world_from_base.assign(options.arms.size(), Rigid3d());
  if (options.arms.size() > 1) solution.poses.world_from_base[1] = options.world_from_second_base;
  solution.covariance.layout = UnknownsOf(rig);
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

Comparison CompareTwo(const AdjustmentOptions& first, const AdjustmentOptions& second) {
  return CompareRuns({ComparedRunOf("a", CellOf(first)), ComparedRunOf("b", CellOf(second))});
}

const RunDifference& Find(const Comparison& comparison, const std::string& name) {
  for (const RunDifference& difference : comparison.differences) {
    if (difference.name.Text() == name) return difference;
  }
  throw InputError("there is no " + name);
}

TEST(CompareRigsTest, StatesTheDifferenceOfEveryPoseWithItsSigmas) {
  const Rigid3d moved(ExpRotation({0, 0.01, 0}), {0.003, 0.004, 0});
  const Comparison comparison = CompareTwo({}, {.world_from_camera = moved});
  std::vector<std::string> names;
  for (const RunDifference& difference : comparison.differences) names.push_back(difference.name.Text());
  EXPECT_THAT(names, testing::ElementsAre("camera top in world", "camera side in world", "camera side in camera top",
                                          "target plate in gripper"));
  const RunDifference& camera = Find(comparison, "camera top in world");
  EXPECT_NEAR(camera.distance_mm, 5, 1e-9);
  EXPECT_NEAR(camera.angle_deg, RadToDeg(0.01), 1e-9);
  // Each run contributes three variances.
  EXPECT_NEAR(camera.sigma_mm, 1000 * std::sqrt(6) * kSigmaM, 1e-9);
  EXPECT_NEAR(camera.sigma_deg, RadToDeg(std::sqrt(6) * kSigmaRad), 1e-9);
  EXPECT_NEAR(Find(comparison, "target plate in gripper").distance_mm, 0, 1e-12);
}

// The statistic of a shift by d along one axis is d^2 / (2 sigma^2), with six degrees of freedom.
TEST(CompareRigsTest, ChanceUsesTheSmallerNumberOfDegreesOfFreedom) {
  const Comparison comparison = CompareTwo({.dof = 100}, {.world_from_camera = Shifted(5e-3), .dof = 10});
  const double statistic = 25e-6 / (2 * kSigmaM * kSigmaM);
  EXPECT_NEAR(Find(comparison, "camera top in world").p_value, FisherTail(statistic / 6, 6, 10), 1e-9);
}

// The camera on the base of the second arm has the uncertainty of that base in the world too: both translations, and
// the rotation of the base by its distance.
TEST(CompareRigsTest, PosesInTheWorldHaveTheUncertaintyOfTheBase) {
  const double distance_m = 0.5;
  RunResult rig = CellOf({.arms = {"left", "right"}});
  rig.solution.poses.mount_from_camera[1] = Shifted(distance_m);
  const ComparedRun run = ComparedRunOf("a", rig);
  ASSERT_THAT(run.cameras, SizeIs(2));
  EXPECT_NEAR(*run.cameras[0].figures.sigma_mm, 1000 * std::sqrt(3) * kSigmaM, 1e-9);
  const double lever_m = distance_m * kSigmaRad;
  EXPECT_NEAR(*run.cameras[1].figures.sigma_mm, 1000 * std::sqrt(6 * kSigmaM * kSigmaM + 2 * lever_m * lever_m), 1e-9);
  EXPECT_NEAR(*run.cameras[1].figures.sigma_deg, RadToDeg(std::sqrt(6) * kSigmaRad), 1e-9);
}

TEST(CompareRigsTest, BasesOfArmsAreCompared) {
  const std::vector<std::string> arms = {"left", "right"};
  const Comparison comparison = CompareTwo({.arms = arms}, {.arms = arms, .world_from_second_base = Shifted(0.02)});
  EXPECT_NEAR(Find(comparison, "base of arm right in world").distance_mm, 20, 1e-9);
  EXPECT_NEAR(Find(comparison, "camera side in world").distance_mm, 20, 1e-9);
  EXPECT_THAT(comparison.findings,
              Contains(StartsWith("poses of arms differ by more than their uncertainties in 1 of 1")));
}

// A pose between two cameras is the same difference in whichever order the configs list them.
TEST(CompareRigsTest, OrderOfTheCamerasDoesNotMatter) {
  const Rigid3d moved(ExpRotation({0.3, -0.2, 0.5}), {0.2, 0.1, -0.3});
  const Rigid3d other = moved * Rigid3d(ExpRotation({0.001, 0, 0}), {0.001, 0, 0});
  const ComparedRun first = ComparedRunOf("a", CellOf({.world_from_camera = moved}));
  RunResult swapped = CellOf({.world_from_camera = other});
  std::swap(swapped.rig.cameras[0], swapped.rig.cameras[1]);
  std::swap(swapped.solution.poses.mount_from_camera[0], swapped.solution.poses.mount_from_camera[1]);
  swapped.relative_cameras = RelativeCameraPoses(swapped.rig, swapped.solution);
  const Comparison same = CompareRuns({first, ComparedRunOf("b", CellOf({.world_from_camera = other}))});
  const Comparison inverted = CompareRuns({first, ComparedRunOf("b", swapped)});
  const RunDifference& a = Find(same, "camera side in camera top");
  const RunDifference& b = Find(inverted, "camera side in camera top");
  EXPECT_GT(a.distance_mm, 0.1);
  EXPECT_NEAR(a.distance_mm, b.distance_mm, 1e-9);
  EXPECT_NEAR(a.sigma_mm, b.sigma_mm, 1e-9);
  EXPECT_NEAR(a.sigma_deg, b.sigma_deg, 1e-9);
  EXPECT_NEAR(a.p_value, b.p_value, 1e-9);
}

TEST(CompareRigsTest, TheRunOfOneCameraIsComparedByItsName) {
  const Comparison comparison =
      CompareRuns({ComparedRunOf("a", CellOf({})), ComparedRunOf("alone", RunOf("top", {.hand_eye = Shifted(0.02)}))});
  ASSERT_THAT(comparison.differences, SizeIs(1));
  EXPECT_NEAR(Find(comparison, "camera top in world").distance_mm, 20, 1e-9);
  // The other poses are not expected in it.
  EXPECT_THAT(comparison.findings, Not(Contains(StartsWith("not in all rigs"))));
}

TEST(CompareRigsTest, TheRunOfOneCameraStatesTheGainOfItsRefinement) {
  const Comparison comparison = CompareRuns({ComparedRunOf("a", CellOf({})), ComparedRunOf("alone", RunOf("top", {}))});
  EXPECT_THAT(comparison.findings, Contains(StartsWith("hold-out error in px: the refinement is better than the best "
                                                       "closed form in 1 of 1 runs")));
  EXPECT_THAT(ComparisonPage(comparison), HasSubstr("best closed form"));
  // Rigs have no closed forms.
  const Comparison rigs = CompareTwo({}, {});
  EXPECT_THAT(rigs.findings, Not(Contains(HasSubstr("closed form"))));
  EXPECT_THAT(ComparisonPage(rigs), Not(HasSubstr("best closed form")));
}

TEST(CompareRigsTest, RunsThatCannotBeComparedAreRefused) {
  EXPECT_THAT(InputErrorOf([] {
                CompareRuns({ComparedRunOf("a", CellOf({})), ComparedRunOf("alone", RunOf("front", {}))});
              }),
              StartsWith("alone: is the run of one camera; a rig beside it needs a camera front in world"));
  EXPECT_THAT(
      InputErrorOf([] {
        CompareTwo({.arms = {"left", "right"}}, {.arms = {"right", "left"}});
      }),
      AllOf(StartsWith("b: its world is the base of arm right"), HasSubstr("that of a is the base of arm left")));
  EXPECT_THAT(InputErrorOf([] {
                CompareRuns({ComparedRunOf("a", CellOf({.arms = {"left", "right"}})),
                             ComparedRunOf("alone", RunOf("top", {}))});
              }),
              StartsWith("alone: its world is the base of an arm without a name"));
  RunResult failed = RunOf("top", {});
  failed.estimates.clear();
  EXPECT_THAT(InputErrorOf([&] {
                CompareRuns({ComparedRunOf("a", CellOf({})), ComparedRunOf("alone", failed)});
              }),
              StartsWith("alone: has no refined estimate"));
}

TEST(CellFindingsTest, SayWhetherThePosesAgreeAndWhatIsMissing) {
  EXPECT_THAT(CompareTwo({}, {.world_from_camera = Shifted(1e-3)}).findings,
              Contains(StartsWith("poses of cameras agree within their uncertainties in all 2 pairs; the least likely: "
                                  "camera top in world: a and b are 1.0 mm and 0 deg apart")));
  RunResult renamed = CellOf({});
  renamed.rig.cameras[1].name = "front";
  renamed.solution.covariance.layout = UnknownsOf(renamed.rig);
  renamed.relative_cameras = RelativeCameraPoses(renamed.rig, renamed.solution);
  EXPECT_THAT(CompareRuns({ComparedRunOf("a", CellOf({})), ComparedRunOf("b", renamed)}).findings,
              Contains("not in all rigs: camera side in world (not in b), camera front in world (not in a)"));
}

TEST(CellComparisonOutputTest, TablesAndFilesHaveEveryFigure) {
  const Comparison comparison = CompareTwo({}, {.world_from_camera = Shifted(0.02)});
  const std::string table = ComparisonTable(comparison);
  EXPECT_THAT(table, HasSubstr("\na                    top                 0.200    0.300    0.400    1.73   0.198\n"));
  EXPECT_THAT(table, HasSubstr("\nb                    side                0.500        -        -    1.73   0.198\n"));
  EXPECT_THAT(table, HasSubstr("\na and b\n"));
  EXPECT_THAT(table, HasSubstr("\n  camera top in world                     20    2.4       0   0.28"));
  EXPECT_THAT(table, HasSubstr(" differ\n"));
  const std::string runs = ComparisonRunsCsv(comparison);
  EXPECT_THAT(runs, StartsWith("run,camera,verdict,reprojection_rms_px,"));
  EXPECT_THAT(runs, HasSubstr("\na,top,good,0.2,0.3,0.4,0.05,1.732"));
  EXPECT_THAT(runs, HasSubstr("\nb,side,good,0.5,,,,1.732"));
  const std::string pairs = ComparisonPairsCsv(comparison);
  EXPECT_THAT(pairs, StartsWith("first,second,kind,parent,child,distance_mm,angle_deg,std_mm,std_deg,p_value,verdict\n"
                                "a,b,camera,world,top,20,0,"));
  EXPECT_THAT(pairs, HasSubstr("\na,b,camera_in_camera,top,side,"));
  EXPECT_THAT(pairs, HasSubstr("\na,b,target,gripper,plate,0,0,"));
}

TEST(CellComparisonOutputTest, TheTerminalShowsTheThreePairsThatDifferMost) {
  std::vector<ComparedRun> runs;
  for (int i = 0; i < 4; ++i) {
    runs.push_back(ComparedRunOf("r" + std::to_string(i), CellOf({.world_from_camera = Shifted(2e-3 * i * i)})));
  }
  const std::string table = ComparisonTable(CompareRuns(std::move(runs)));
  EXPECT_THAT(table, HasSubstr("and 3 more pairs of runs\n"));
  EXPECT_LT(table.find("\nr0 and r3\n"), table.find("\nr1 and r3\n"));
  EXPECT_THAT(table, Not(HasSubstr("\nr0 and r1\n")));
}

TEST(CellComparisonOutputTest, ThePageEscapesNames) {
  RunResult rig = CellOf({});
  const std::string page = ComparisonPage(CompareRuns({ComparedRunOf("<b>x</b>", rig), ComparedRunOf("y", rig)}));
  EXPECT_THAT(page, HasSubstr("<h1>Comparison of 2 runs</h1>"));
  EXPECT_THAT(page, HasSubstr("&lt;b&gt;x&lt;/b&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<b>x")));
}

}  // namespace
}  // namespace heba
