#include "heba/evaluation/verdict.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {

// 20 captures, 0.1 mm, 0.01 deg, all as it should be.
RunResult GoodResult() {
  RunResult result;
  for (int i = 0; i < 20; ++i) result.captures.push_back({std::to_string(i), "", 48, true, "", 0, 0, 0.1, {}, {}});
  Estimate closed;
  closed.method = "park";
  closed.kind = "closed_form";
  closed.ok = true;
  closed.errors.holdout_target_mm = 1.0;
  result.estimates.push_back(closed);
  Estimate refined;
  refined.method = "bundle";
  refined.kind = "refined";
  refined.ok = true;
  refined.errors.holdout_target_mm = 0.3;
  refined.errors.holdout_target_deg = 0.02;
  refined.errors.holdout_chi2 = 1.02;
  refined.solution.emplace();
  refined.solution->pixel_sigma_px = 0.1;
  Eigen::VectorXd variances(12);
  variances << Eigen::VectorXd::Constant(3, 1e-8), Eigen::VectorXd::Constant(3, 3e-8),
      Eigen::VectorXd::Constant(6, 1e-8);
  refined.solution->covariance = {std::vector<std::string>(12, "hand_eye.tx_m"), variances.asDiagonal()};
  result.estimates.push_back(refined);
  return result;
}

TEST(VerdictTest, JudgesWhereTheWorkIs) {
  RunResult result = GoodResult();
  result.working_point = WorkingPoint{Eigen::Vector3d(0, 0, 3), 1e-8 * Eigen::Matrix3d::Identity()};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
  result.working_point->covariance_m2(1, 1) = std::pow(4.5e-3, 2);
  EXPECT_EQ(JudgeRun(result).grade, Grade::kDoubtful);
  EXPECT_THAT(JudgeRun(result).findings.front().what, testing::HasSubstr("a target seen 3000 mm away to 4.5 mm"));
}

TEST(VerdictTest, AGoodResultIsGood) {
  const Verdict verdict = JudgeRun(GoodResult());
  EXPECT_EQ(verdict.grade, Grade::kGood);
  for (const Finding& finding : verdict.findings) EXPECT_EQ(finding.cure, "") << finding.what;
}

// Each of them alone, its finding first and with a cure.
TEST(VerdictTest, OneFaultDecides) {
  struct Case {
    Grade grade;
    const char* what;
    void (*spoil)(RunResult* result);
  };
  const Case cases[] = {
      {Grade::kDoubtful, "the camera's pose is known to 2.0 mm",
       [](RunResult* r) { r->estimates[1].solution->covariance.matrix(2, 2) = 4e-6; }},
      {Grade::kBad, "the camera's pose is known to 0.10 mm and 1.00 deg",
       [](RunResult* r) { r->estimates[1].solution->covariance.matrix(4, 4) = 3.046e-4; }},
      {Grade::kBad, "the target was 16 mm", [](RunResult* r) { r->estimates[1].errors.holdout_target_mm = 16; }},
      {Grade::kDoubtful, "nothing was held out",
       [](RunResult* r) { r->estimates[1].errors.holdout_target_mm.reset(); }},
      {Grade::kDoubtful, "scatter 1.4 times", [](RunResult* r) { r->estimates[1].errors.holdout_chi2 = 2; }},
      {Grade::kDoubtful, "(park) predicts unseen captures 1.5 times better",
       [](RunResult* r) { r->estimates[0].errors.holdout_target_mm = 0.2; }},
      {Grade::kDoubtful, "6 of 6 captures", [](RunResult* r) { r->captures.resize(6); }},
      {Grade::kDoubtful, "10 of 20 captures",
       [](RunResult* r) {
         for (size_t i = 0; i < 10; ++i) r->captures[i].used = false;
       }},
      {Grade::kBad, "off by 8.0 px", [](RunResult* r) { r->estimates[1].solution->pixel_sigma_px = 8; }},
      {Grade::kDoubtful, "without 7 the camera would be 0.90 mm and 0 deg elsewhere",
       [](RunResult* r) {
         for (CaptureResult& capture : r->captures) capture.move_without = CaptureMove{9e-4 * Tangent6::Unit(0), 0.02};
         r->captures[7].move_without = CaptureMove{9e-4 * Tangent6::Unit(1), 1e-4};
       }},
      {Grade::kBad, "no refined estimate", [](RunResult* r) { r->estimates.pop_back(); }},
  };
  for (const Case& test : cases) {
    RunResult result = GoodResult();
    test.spoil(&result);
    const Verdict verdict = JudgeRun(result);
    EXPECT_EQ(verdict.grade, test.grade) << test.what;
    EXPECT_THAT(verdict.findings.front().what, testing::HasSubstr(test.what));
    EXPECT_NE(verdict.findings.front().cure, "") << test.what;
  }
}

// Copies of captures are no captures that could not be used.
TEST(VerdictTest, CopiesOfCapturesDoNotCount) {
  RunResult result = GoodResult();
  for (size_t i = 0; i < 60; ++i) {
    CaptureResult copy;
    copy.repeat_of = result.captures.front().image;
    result.captures.push_back(copy);
  }
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
}

// Where all pull harder than the noise that is assumed allows, it is that noise which is wrong, and no capture.
TEST(VerdictTest, BlamesNoCaptureForWhatAllDo) {
  RunResult result = GoodResult();
  for (CaptureResult& capture : result.captures) capture.move_without = CaptureMove{9e-4 * Tangent6::Unit(0), 1e-9};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kGood);
}

TEST(VerdictTest, RemarksMakeItDoubtful) {
  RunResult result = GoodResult();
  result.estimates[1].solution->remarks = {"the captures speak of a robot"};
  EXPECT_EQ(JudgeRun(result).grade, Grade::kDoubtful);
}

}  // namespace
}  // namespace heba
