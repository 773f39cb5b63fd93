#include "tools/pages/comparison.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/distributions.h"
#include "heba/base/units.h"

namespace heba {
namespace {
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr double kSigmaM = 1e-3;
constexpr double kSigmaRad = 2e-3;

struct RunOptions {
  Rigid3d hand_eye = {};
  double refined_px = 0.2;
  double closed_px = 0.3;
  std::string target_type = "chessboard";
  Setup setup = Setup::kEyeToHand;
};

ComparedRun RunOf(const std::string& label, const RunOptions& options) {
  ComparedRun run;
  run.label = label;
  run.result.setup = options.setup;
  run.result.target_type = options.target_type;
  run.result.timing.total_s = 1.5;
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
  Covariance& covariance = refined.solution->covariance;
  covariance.layout = HandEyePoses();
  covariance.matrix = Eigen::MatrixXd::Identity(12, 12);
  covariance.matrix.diagonal().head<3>().setConstant(kSigmaM * kSigmaM);
  covariance.matrix.diagonal().segment<3>(3).setConstant(kSigmaRad * kSigmaRad);
  run.result.estimates = {worse, closed, refined};
  return run;
}

Rigid3d Shifted(double x_m) { return {Eigen::Quaterniond::Identity(), {x_m, 0, 0}}; }

Comparison Compare(const std::vector<ComparedRun>& runs) { return CompareRuns(runs); }

TEST(CompareRunsTest, StatesDistanceAngleAndTheirSigmas) {
  const Rigid3d other(ExpRotation({0, 0.01, 0}), {0.003, 0.004, 0});
  const Comparison comparison = Compare({RunOf("a", {}), RunOf("b", {.hand_eye = other})});
  ASSERT_THAT(comparison.pairs, SizeIs(1));
  const PairDifference& pair = comparison.pairs[0];
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
    EXPECT_NEAR(comparison.pairs.at(0).p_value, ChiSquareTail(statistic, 6), 1e-9) << shift_m;
  }
}

TEST(CompareRunsTest, ChanceUsesTheSmallerNumberOfDegreesOfFreedom) {
  ComparedRun first = RunOf("a", {});
  ComparedRun second = RunOf("b", {.hand_eye = Shifted(5e-3)});
  first.result.estimates.back().solution->covariance_dof = 100;
  second.result.estimates.back().solution->covariance_dof = 10;
  const double statistic = 25e-6 / (2 * kSigmaM * kSigmaM);
  EXPECT_NEAR(Compare({first, second}).pairs.at(0).p_value, FisherTail(statistic / 6, 6, 10), 1e-9);
}

TEST(CompareRunsTest, EveryPairIsComparedOnce) {
  const Comparison comparison = Compare({RunOf("a", {}), RunOf("b", {}), RunOf("c", {})});
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const PairDifference& pair : comparison.pairs) pairs.emplace_back(pair.first, pair.second);
  EXPECT_THAT(pairs, ElementsAre(testing::Pair(0, 1), testing::Pair(0, 2), testing::Pair(1, 2)));
}

TEST(CompareRunsTest, RunsWithoutAComparablePoseHaveNoPair) {
  EXPECT_THAT(Compare({RunOf("a", {}), RunOf("b", {.setup = Setup::kEyeInHand})}).pairs, SizeIs(0));
  ComparedRun failed = RunOf("b", {});
  failed.result.estimates.back().ok = false;
  EXPECT_THAT(Compare({RunOf("a", {}), failed}).pairs, SizeIs(0));
  ComparedRun held = RunOf("b", {});
  ComparedRun also_held = RunOf("c", {});
  for (ComparedRun* run : {&held, &also_held}) run->result.estimates.back().solution->covariance.matrix.setZero();
  EXPECT_THAT(Compare({held, also_held}).pairs, SizeIs(0));
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
  ComparedRun run = RunOf("a", {});
  for (Estimate& estimate : run.result.estimates) estimate.errors.holdout_rms_px.reset();
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
  ComparedRun run = RunOf("a", {});
  EXPECT_THAT(Compare({run}).findings, Not(Contains(HasSubstr("true error"))));
  for (Estimate& estimate : run.result.estimates) estimate.errors.truth = TruthErrors{};
  run.result.estimates[1].errors.truth->hand_eye_mm = 0.6;
  run.result.estimates[2].errors.truth->hand_eye_mm = 0.2;
  run.result.estimates[1].errors.truth->hand_eye_deg = 0.1;
  run.result.estimates[2].errors.truth->hand_eye_deg = 0.2;
  const std::vector<std::string> findings = Compare({run}).findings;
  EXPECT_THAT(findings, Contains(HasSubstr("true error in mm of the closed form with the smallest hold-out RMS: the "
                                           "refinement is better than the best closed form in 1 of 1 runs")));
  EXPECT_THAT(findings, Contains(HasSubstr("true error in deg of the same closed form: the refinement is better than "
                                           "the best closed form in 0 of 1 runs")));
}

TEST(FindingsTest, WarnThatRobotNoiseHidesTheGain) {
  ComparedRun run = RunOf("a", {});
  EXPECT_THAT(Compare({run}).findings, Not(Contains(StartsWith("if robot noise is modelled"))));
  run.result.estimates.back().solution->robot_noise = RobotNoise{1e-4, 1e-4};
  EXPECT_THAT(Compare({run}).findings, Contains(StartsWith("if robot noise is modelled")));
}

TEST(ComparisonTableTest, HasALineForEachRunAndPair) {
  const std::string table =
      ComparisonTable(Compare({RunOf("a", {}), RunOf("a_name_that_is_too_long_for_it", {.hand_eye = Shifted(0.02)})}));
  EXPECT_THAT(table, HasSubstr("\na                    chessboard         0.300    0.200     1.73    0.400     1.5\n"));
  EXPECT_THAT(table, HasSubstr("\n..is_too_long_for_it "));
  EXPECT_THAT(table, HasSubstr("  differ\n"));
}

TEST(ComparisonTableTest, CutsLongNamesBetweenCharacters) {
  std::string umlauts;
  for (int i = 0; i < 18; ++i) umlauts += "\xC3\xA4";
  EXPECT_THAT(ComparisonTable(Compare({RunOf("abc" + umlauts, {})})), HasSubstr("\n.." + umlauts + " chessboard  "));
}

TEST(ComparisonTableTest, NamesTheTenLeastLikelyPairs) {
  std::vector<ComparedRun> runs;
  for (int i = 0; i < 6; ++i) runs.push_back(RunOf("r" + std::to_string(i), {.hand_eye = Shifted(1e-3 * i * i)}));
  const std::string table = ComparisonTable(Compare(runs));
  EXPECT_THAT(table, HasSubstr("and 5 more pairs\n"));
  const std::string gap(20, ' ');
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
  ComparedRun run = RunOf("a", {});
  run.result.estimates.clear();
  EXPECT_THAT(ComparisonRunsCsv(Compare({run})), HasSubstr("\na,eye_to_hand,chessboard,,,,,,,,1.5\n"));
}

TEST(ComparisonPageTest, EscapesNamesAndFindings) {
  const Comparison comparison = Compare({RunOf("<b>x</b>", {}), RunOf("y", {.hand_eye = Shifted(0.02)})});
  const std::string page = ComparisonPage(comparison);
  EXPECT_THAT(page, HasSubstr("<h1>Comparison of 2 runs</h1>"));
  EXPECT_THAT(page, HasSubstr("&lt;b&gt;x&lt;/b&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<b>x")));
}

}  // namespace
}  // namespace heba
