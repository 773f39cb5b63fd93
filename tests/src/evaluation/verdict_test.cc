#include "heba/evaluation/verdict.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {

ImageResult Image(const std::string& name, int num_points, bool used) {
  ImageResult image;
  image.capture = name;
  image.image = name;
  image.used = used;
  if (num_points > 0) image.targets.push_back({"", num_points, 0, 0.1, used});
  return image;
}

// Judges a result by its final estimate.
Verdict Judged(const RunResult& result) { return JudgeRun(WithFinalEstimate(result)); }

// Returns a result that deserves the grade kGood: 20 captures, sigmas of the hand-eye pose near 0.1 mm and 0.01 deg,
// and residuals that agree with the noise model.
RunResult GoodResult() {
  RunResult result = ShortResult(Setup::kEyeToHand, "chessboard", 48);
  for (int i = 0; i < 20; ++i) result.images.push_back(Image(std::to_string(i), 48, true));
  Estimate closed;
  closed.method = "park";
  closed.kind = EstimateKind::kClosedForm;
  closed.ok = true;
  closed.errors.holdout_target_mm = 1.0;
  closed.errors.holdout_sigmas = 2.0;
  result.estimates.push_back(closed);
  Estimate refined;
  refined.method = "bundle";
  refined.kind = EstimateKind::kRefined;
  refined.ok = true;
  refined.errors.holdout_target_mm = 0.3;
  refined.errors.holdout_target_deg = 0.02;
  refined.errors.holdout_chi2 = 1.02;
  refined.errors.holdout_sigmas = 1.0;
  refined.solution.emplace();
  refined.solution->pixel_sigma_px = 0.1;
  Eigen::VectorXd variances(12);
  variances << Eigen::VectorXd::Constant(3, 1e-8), Eigen::VectorXd::Constant(3, 3e-8),
      Eigen::VectorXd::Constant(6, 1e-8);
  refined.solution->covariance = {HandEyePoses(), variances.asDiagonal()};
  result.estimates.push_back(refined);
  return result;
}

TEST(VerdictTest, JudgesUncertaintyAtTheWorkingPoint) {
  RunResult result = GoodResult();
  result.working_points[0] = WorkingPoint{Eigen::Vector3d(0, 0, 3), 1e-8 * Eigen::Matrix3d::Identity()};
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
  result.working_points[0]->covariance_m2(1, 1) = std::pow(15e-3, 2);
  EXPECT_EQ(Judged(result).grade, Grade::kDoubtful);
  const Finding finding = Judged(result).findings.front();
  EXPECT_EQ(finding.code, "uncertainty");
  EXPECT_NEAR(finding.Number("at_work_mm").value_or(0), 15, 1e-9);
  ASSERT_EQ(finding.parts.size(), 1U);
  EXPECT_EQ(finding.parts[0].code, "at_working_point");
  EXPECT_EQ(finding.parts[0].Number("distance_mm"), 3000);
}

TEST(VerdictTest, AGoodResultIsGood) {
  const Verdict verdict = Judged(GoodResult());
  EXPECT_EQ(verdict.grade, Grade::kGood);
  for (const Finding& finding : verdict.findings) EXPECT_EQ(finding.grade, Grade::kGood) << finding.code;
}

// Each fault alone decides the grade. Its finding comes first, with its figure, and has no words.
TEST(VerdictTest, OneFaultDecides) {
  struct Case {
    Grade grade;
    const char* code;
    const char* number;  // Key of a number that states the fault; empty if there is none.
    double value;
    void (*spoil)(RunResult* result);
  };
  const Case cases[] = {
      {Grade::kDoubtful, "uncertainty", "position_mm", 2,
       [](RunResult* r) { r->estimates[1].solution->covariance.matrix(2, 2) = 4e-6; }},
      {Grade::kBad, "uncertainty", "orientation_deg", 1,
       [](RunResult* r) { r->estimates[1].solution->covariance.matrix(4, 4) = 3.046e-4; }},
      {Grade::kBad, "hold_out", "target_mm", 16, [](RunResult* r) { r->estimates[1].errors.holdout_target_mm = 16; }},
      {Grade::kDoubtful, "no_hold_out", "", 0, [](RunResult* r) { r->estimates[1].errors.holdout_target_mm.reset(); }},
      {Grade::kDoubtful, "unmodelled_error", "chi2_per_dof", 2,
       [](RunResult* r) { r->estimates[1].errors.holdout_chi2 = 2; }},
      {Grade::kDoubtful, "closed_form_better", "ratio", 0.667,
       [](RunResult* r) { r->estimates[0].errors.holdout_sigmas = 0.667; }},
      {Grade::kDoubtful, "few_captures", "used", 6, [](RunResult* r) { r->images.resize(6); }},
      {Grade::kDoubtful, "captures_left_out", "used", 10,
       [](RunResult* r) {
         for (size_t i = 0; i < 10; ++i) r->images[i].used = false;
       }},
      {Grade::kBad, "pixel_noise", "pixel_sigma_px", 8,
       [](RunResult* r) { r->estimates[1].solution->pixel_sigma_px = 8; }},
      {Grade::kDoubtful, "influential_capture", "move_mm", 3,
       [](RunResult* r) {
         for (ImageResult& image : r->images) image.move_without = CaptureMove{3e-3 * Tangent6::Unit(0), 0.02};
         r->images[7].move_without = CaptureMove{3e-3 * Tangent6::Unit(1), 1e-4};
       }},
      {Grade::kBad, "no_estimate", "", 0, [](RunResult* r) { r->estimates.pop_back(); }},
  };
  for (const Case& test : cases) {
    RunResult result = GoodResult();
    test.spoil(&result);
    const Verdict verdict = Judged(result);
    EXPECT_EQ(verdict.grade, test.grade) << test.code;
    const Finding& first = verdict.findings.front();
    EXPECT_EQ(first.code, test.code);
    constexpr double kRounding = 1e-3;  // The variance of 1 deg is given with four digits.
    if (*test.number != '\0') {
      EXPECT_NEAR(first.Number(test.number).value_or(-1), test.value, kRounding) << test.code;
    }
    for (const Finding& finding : verdict.findings) EXPECT_EQ(finding.text + finding.action, "") << finding.code;
  }
}

// Errors that the robot's own noise explains are doubtful, up to a share of the distance beyond which no result is of
// use.
TEST(VerdictTest, WhatTheRobotExplainsIsNotBad) {
  struct Case {
    double robot_mm;
    double sigma_mm;
    double held_out_mm;
    Grade grade;
  };
  for (const Case& test :
       {Case{0.1, 10, 1, Grade::kBad}, Case{10, 10, 1, Grade::kDoubtful}, Case{1, 10, 1, Grade::kBad},
        Case{0.1, 0.1, 15, Grade::kBad}, Case{10, 0.1, 15, Grade::kDoubtful}, Case{100, 60, 1, Grade::kBad},
        Case{100, 0.1, 60, Grade::kBad}}) {
    RunResult result = GoodResult();
    PairSolution& solution = *result.estimates[1].solution;
    solution.robot_noise = RobotNoise{1e-3 * test.robot_mm, 0, 0};
    solution.covariance.matrix(2, 2) = std::pow(1e-3 * test.sigma_mm, 2);
    result.estimates[1].errors.holdout_target_mm = test.held_out_mm;
    EXPECT_EQ(Judged(result).grade, test.grade) << test.robot_mm << " " << test.sigma_mm << " " << test.held_out_mm;
  }
}

// Names say what a finding is about, and which remedy applies.
TEST(VerdictTest, FindingsHaveNames) {
  RunResult result = GoodResult();
  for (ImageResult& image : result.images) image.move_without = CaptureMove{3e-3 * Tangent6::Unit(0), 0.02};
  result.images[7].move_without->p_value = 1e-4;
  EXPECT_EQ(Judged(result).findings.front().Name("image"), "7");
  result = GoodResult();
  result.estimates[0].errors.holdout_sigmas = 0.5;
  EXPECT_EQ(Judged(result).findings.front().Name("method"), "park");
  EXPECT_EQ(Judged(result).findings.front().Name("robot_noise"), "none");
  result.estimates[1].solution->robot_noise.emplace();
  EXPECT_EQ(Judged(result).findings.front().Name("robot_noise"), "modelled");
  result = GoodResult();
  result.estimates[1].errors.holdout_target_mm.reset();
  EXPECT_EQ(Judged(result).findings.front().Name("reason"), "none_held_out");
  result.estimates[0].errors.holdout_rms_px = 0.1;
  EXPECT_EQ(Judged(result).findings.front().Name("reason"), "refinement_failed");
  EXPECT_EQ(Judged(result).findings.front().Name("image"), std::nullopt);
}

// A weak direction is part of an uncertainty that is not good, which then has its numbers too.
TEST(VerdictTest, AWeakDirectionIsPartOfTheUncertainty) {
  RunResult result = GoodResult();
  result.observations.push_back({Grade::kDoubtful, FindingCode("weak_direction"), {{"the camera's fx, px", 9}}});
  Verdict verdict = Judged(result);
  EXPECT_EQ(verdict.findings.front().code, "weak_direction");
  result.estimates[1].solution->covariance.matrix(2, 2) = 4e-6;
  verdict = Judged(result);
  const Finding& uncertainty = verdict.findings.front();
  EXPECT_EQ(uncertainty.code, "uncertainty");
  ASSERT_EQ(uncertainty.parts.size(), 1U);
  EXPECT_EQ(uncertainty.parts[0].code, "weak_direction");
  EXPECT_EQ(uncertainty.Number("the camera's fx, px"), 9);
  for (const Finding& finding : verdict.findings) EXPECT_NE(finding.code, "weak_direction");
}

// Repeated captures do not count as captures that could not be used.
TEST(VerdictTest, CopiesOfCapturesDoNotCount) {
  RunResult result = GoodResult();
  for (size_t i = 0; i < 60; ++i) {
    ImageResult copy = Image("copy " + std::to_string(i), 0, false);
    copy.repeat_of = result.images.front().capture;
    result.images.push_back(copy);
  }
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
}

// If every capture has a larger influence than the assumed noise allows, the noise model is wrong and no single
// capture is blamed.
TEST(VerdictTest, BlamesNoCaptureIfAllAreInfluential) {
  RunResult result = GoodResult();
  for (ImageResult& image : result.images) image.move_without = CaptureMove{9e-4 * Tangent6::Unit(0), 1e-9};
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
}

// A closed form with smaller pixel residuals is no reason for doubt, because robot noise adds to these residuals; the
// comparison uses the error that is whitened by all noise.
TEST(VerdictTest, ComparesClosedFormsByWhitenedErrors) {
  RunResult result = GoodResult();
  result.estimates[0].errors.holdout_rms_px = 0.1;
  result.estimates[1].errors.holdout_rms_px = 0.5;
  result.estimates[0].errors.holdout_target_mm = 0.1;
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
}

TEST(VerdictTest, ImagesWithoutTheTargetDoNotCount) {
  RunResult result = GoodResult();
  for (int i = 0; i < 60; ++i) result.images.push_back(Image("away", 0, false));
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
}

// A cause and its consequences are reported in one finding.
TEST(VerdictTest, OneCauseGivesOneFinding) {
  RunResult result = GoodResult();
  result.estimates[1].errors.holdout_target_mm = 50;
  result.estimates[1].errors.holdout_chi2 = 9;
  result.estimates[1].solution->pixel_sigma_px = 8;
  Finding cause{Grade::kBad, "target_size", {{"larger_percent", 10}}};
  cause.is_cause = true;
  result.observations.push_back(cause);
  const Verdict verdict = Judged(result);
  EXPECT_EQ(verdict.grade, Grade::kBad);
  EXPECT_EQ(verdict.findings.front().code, "target_size");
  ASSERT_EQ(verdict.findings.front().parts.size(), 3U);
  EXPECT_EQ(verdict.findings.front().parts[0].code, "hold_out");
  EXPECT_EQ(verdict.findings.front().Number("larger_percent"), 10);
  EXPECT_EQ(verdict.findings.front().Number("target_mm"), 50);
  for (size_t i = 1; i < verdict.findings.size(); ++i) {
    EXPECT_EQ(verdict.findings[i].grade, Grade::kGood) << verdict.findings[i].code;
  }
}

// Without a cause, what an error of the model shows as is one finding, too; what else is wrong is another one.
TEST(VerdictTest, SymptomsOfOneFaultAreOneFinding) {
  RunResult result = GoodResult();
  result.estimates[1].errors.holdout_target_mm = 4;
  result.estimates[1].errors.holdout_chi2 = 9;
  result.estimates[1].errors.holdout_sigmas = 3;
  result.images.resize(7);
  const Verdict verdict = Judged(result);
  EXPECT_EQ(verdict.grade, Grade::kBad);
  std::vector<std::string> codes;
  for (const Finding& finding : verdict.findings) {
    if (finding.grade != Grade::kGood) codes.push_back(finding.code);
  }
  EXPECT_THAT(codes, testing::UnorderedElementsAre("unmodelled_error", "few_captures"));
  const Finding& lead = verdict.findings[verdict.findings[0].code == "unmodelled_error" ? 0 : 1];
  EXPECT_EQ(lead.Number("target_mm"), 4);
  EXPECT_TRUE(lead.Number("ratio").has_value());
}

// Errors that the noise does not explain make a result bad only if they matter at the target.
TEST(VerdictTest, IsBadOnlyForErrorsThatMatter) {
  RunResult result = GoodResult();
  result.estimates[1].errors.holdout_chi2 = 30;
  EXPECT_EQ(Judged(result).grade, Grade::kDoubtful);
  result.estimates[1].errors.holdout_target_mm = 4;
  EXPECT_EQ(Judged(result).grade, Grade::kBad);
}

// Captures that contradict the others are no finding if the model predicts captures that it has not seen.
TEST(VerdictTest, ScatterThatTheModelExplainsIsNoFinding) {
  RunResult result = GoodResult();
  result.observations.push_back({Grade::kDoubtful, FindingCode("captures_scatter"), {{"captures", 5}}});
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
  result.estimates[1].errors.holdout_chi2 = 2;
  EXPECT_EQ(Judged(result).grade, Grade::kDoubtful);
}

// A requirement replaces the built-in limits, whether it is stricter or more lenient.
TEST(VerdictTest, RequirementsReplaceBuiltInLimits) {
  RunResult result = GoodResult();
  result.estimates[1].errors.holdout_target_mm = 3;  // The built-in limits alone would grade this as doubtful.
  result.requirements = {{0, {10e-3, 0.95, "the working point", 2e-3}}};
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
  result.requirements = {{0, {1e-3, 0.95, "the working point", 0.5e-3}}};
  EXPECT_EQ(Judged(result).grade, Grade::kBad);
  EXPECT_EQ(Judged(result).findings.front().code, "required");
  result.estimates[1].errors.holdout_target_mm = 0.3;
  EXPECT_EQ(Judged(result).grade, Grade::kGood);
  result.requirements[0].requirement.reached_m = 2e-3;
  EXPECT_EQ(Judged(result).grade, Grade::kBad);
}

}  // namespace
}  // namespace heba
