#include "heba/evaluation/verdict.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {

// Returns a result that deserves the grade kGood: 20 captures, sigmas of the hand-eye pose near 0.1 mm and 0.01 deg,
// and residuals that agree with the noise model.
RunResult GoodResult() {
  RunResult result;
  for (int i = 0; i < 20; ++i)
    result.captures.push_back({std::to_string(i), CaptureRole::kNone, 48, true, "", 0, 0, 0.1, {}, {}});
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
  result.working_point = WorkingPoint{Eigen::Vector3d(0, 0, 3), 1e-8 * Eigen::Matrix3d::Identity()};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
  result.working_point->covariance_m2(1, 1) = std::pow(4.5e-3, 2);
  EXPECT_EQ(JudgeRun(result).grade, Grade::kDoubtful);
  EXPECT_THAT(JudgeRun(result).findings.front().text,
              testing::HasSubstr("a target seen 3000 mm away is located to 4.5 mm"));
}

TEST(VerdictTest, AGoodResultIsGood) {
  const Verdict verdict = JudgeRun(GoodResult());
  EXPECT_EQ(verdict.grade, Grade::kGood);
  for (const Finding& finding : verdict.findings) EXPECT_EQ(finding.action, "") << finding.text;
}

// Each fault alone decides the grade. Its finding comes first and recommends an action.
TEST(VerdictTest, OneFaultDecides) {
  struct Case {
    Grade grade;
    const char* what;
    const char* code;
    void (*spoil)(RunResult* result);
  };
  const Case cases[] = {
      {Grade::kDoubtful, "the camera's pose is known to 2.0 mm", "uncertainty",
       [](RunResult* r) { r->estimates[1].solution->covariance.matrix(2, 2) = 4e-6; }},
      {Grade::kBad, "the camera's pose is known to 0.10 mm and 1.00 deg", "uncertainty",
       [](RunResult* r) { r->estimates[1].solution->covariance.matrix(4, 4) = 3.046e-4; }},
      {Grade::kBad, "the target is off by 16 mm", "hold_out",
       [](RunResult* r) { r->estimates[1].errors.holdout_target_mm = 16; }},
      {Grade::kDoubtful, "no captures were held out", "no_hold_out",
       [](RunResult* r) { r->estimates[1].errors.holdout_target_mm.reset(); }},
      {Grade::kDoubtful, "scatter 1.4 times", "unmodelled_error",
       [](RunResult* r) { r->estimates[1].errors.holdout_chi2 = 2; }},
      {Grade::kDoubtful, "(park) predicts held-out captures 1.5 times better", "closed_form_better",
       [](RunResult* r) { r->estimates[0].errors.holdout_sigmas = 0.667; }},
      {Grade::kDoubtful, "6 of 6 captures", "few_captures", [](RunResult* r) { r->captures.resize(6); }},
      {Grade::kDoubtful, "10 of 20 captures", "captures_left_out",
       [](RunResult* r) {
         for (size_t i = 0; i < 10; ++i) r->captures[i].used = false;
       }},
      {Grade::kBad, "pixel noise is 8.0 px", "pixel_noise",
       [](RunResult* r) { r->estimates[1].solution->pixel_sigma_px = 8; }},
      {Grade::kDoubtful, "without 7 the camera pose would move by 0.90 mm and 0 deg, more", "influential_capture",
       [](RunResult* r) {
         for (CaptureResult& capture : r->captures) capture.move_without = CaptureMove{9e-4 * Tangent6::Unit(0), 0.02};
         r->captures[7].move_without = CaptureMove{9e-4 * Tangent6::Unit(1), 1e-4};
       }},
      {Grade::kBad, "no refined estimate", "no_estimate", [](RunResult* r) { r->estimates.pop_back(); }},
  };
  for (const Case& test : cases) {
    RunResult result = GoodResult();
    test.spoil(&result);
    const Verdict verdict = JudgeRun(result);
    EXPECT_EQ(verdict.grade, test.grade) << test.what;
    EXPECT_THAT(verdict.findings.front().text, testing::HasSubstr(test.what));
    EXPECT_EQ(verdict.findings.front().code, test.code);
    EXPECT_NE(verdict.findings.front().action, "") << test.what;
  }
}

// Repeated captures do not count as captures that could not be used.
TEST(VerdictTest, CopiesOfCapturesDoNotCount) {
  RunResult result = GoodResult();
  for (size_t i = 0; i < 60; ++i) {
    CaptureResult copy;
    copy.repeat_of = result.captures.front().image;
    result.captures.push_back(copy);
  }
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
}

// If every capture has a larger influence than the assumed noise allows, the noise model is wrong and no single
// capture is blamed.
TEST(VerdictTest, BlamesNoCaptureIfAllAreInfluential) {
  RunResult result = GoodResult();
  for (CaptureResult& capture : result.captures) capture.move_without = CaptureMove{9e-4 * Tangent6::Unit(0), 1e-9};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
}

// A closed form with smaller pixel residuals is no reason for doubt, because robot noise adds to these residuals; the
// comparison uses the error that is whitened by all noise.
TEST(VerdictTest, ComparesClosedFormsByWhitenedErrors) {
  RunResult result = GoodResult();
  result.estimates[0].errors.holdout_rms_px = 0.1;
  result.estimates[1].errors.holdout_rms_px = 0.5;
  result.estimates[0].errors.holdout_target_mm = 0.1;
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
}

TEST(VerdictTest, ImagesWithoutTheTargetDoNotCount) {
  RunResult result = GoodResult();
  for (int i = 0; i < 60; ++i)
    result.captures.push_back({"away", CaptureRole::kNone, 0, false, "no target", 0, 0, {}, {}, {}});
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
}

// A cause and its consequences are reported in one finding.
TEST(VerdictTest, OneCauseGivesOneFinding) {
  RunResult result = GoodResult();
  result.estimates[1].errors.holdout_target_mm = 50;
  result.estimates[1].errors.holdout_chi2 = 9;
  result.estimates[1].solution->pixel_sigma_px = 8;
  Finding cause{Grade::kBad, "target_size", "the target is 10 % larger", "measure it"};
  cause.is_cause = true;
  result.observations.push_back(cause);
  const Verdict verdict = JudgeRun(result);
  EXPECT_EQ(verdict.grade, Grade::kBad);
  EXPECT_EQ(verdict.findings.front().code, "target_size");
  EXPECT_THAT(verdict.findings.front().text, testing::HasSubstr("as a consequence, on held-out captures"));
  for (size_t i = 1; i < verdict.findings.size(); ++i) {
    EXPECT_EQ(verdict.findings[i].grade, Grade::kGood) << verdict.findings[i].text;
  }
}

// A requirement replaces the built-in limits, whether it is stricter or more lenient.
TEST(VerdictTest, RequirementsReplaceBuiltInLimits) {
  RunResult result = GoodResult();
  result.estimates[1].errors.holdout_target_mm = 3;  // The built-in limits alone would grade this as doubtful.
  result.requirements = {{10e-3, 0.95, "the working point", 2e-3}};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
  result.requirements = {{1e-3, 0.95, "the working point", 0.5e-3}};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kBad);
  EXPECT_EQ(JudgeRun(result).findings.front().code, "required");
  result.estimates[1].errors.holdout_target_mm = 0.3;
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
  result.requirements[0].reached_m = 2e-3;
  EXPECT_EQ(JudgeRun(result).grade, Grade::kBad);
}

}  // namespace
}  // namespace heba
