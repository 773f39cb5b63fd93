// Tests of the check of the camera model by the residuals of single views: tools/doctor/checks/residuals.cc.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Returns an examination whose camera lacks a part of the distortion of the lens.
Examination ExaminationOfAnotherLens(const SimulatedSetOptions& options = {}) {
  Examination examination = CleanExamination(options);
  examination.camera->params[4] += 0.1;
  ExamineAgain(&examination);
  return examination;
}

TEST(ResidualsCheckTest, NoiseHasNoSymptom) {
  Examination examination = CleanExamination();
  EXPECT_THAT(CodesOf(RunCheck(Check_residuals, &examination)), IsEmpty());
}

TEST(ResidualsCheckTest, RemarksOnAPatternOverTheImage) {
  Examination examination = ExaminationOfAnotherLens();
  const std::vector<Symptom> symptoms = RunCheck(Check_residuals, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark lens"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the residuals of single views have a pattern over the image"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the camera model, brown5, or its distortion does not fit the lens"));
}

// A pattern that noise of this size would produce as well is not reported.
TEST(ResidualsCheckTest, IsSilentIfTheNoiseHidesThePattern) {
  SimulatedSetOptions options;
  options.noise_px = 10;
  Examination examination = ExaminationOfAnotherLens(options);
  EXPECT_THAT(CodesOf(RunCheck(Check_residuals, &examination)), IsEmpty());
}

TEST(ResidualsCheckTest, IsSilentAfterAnotherFault) {
  Examination examination = ExaminationOfAnotherLens();
  examination.found_wrong = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_residuals, &examination)), IsEmpty());
}

// Nearly all residuals of seven points are explained by the pose alone, so such views are left out.
TEST(ResidualsCheckTest, EightPointsOfAViewAreNeeded) {
  SimulatedSetOptions options;
  options.num_captures = 300;
  const Examination whole = ExaminationOfAnotherLens(options);
  const auto codes_with_points = [&](Eigen::Index num_points) {
    Examination examination = whole;
    for (ExaminedView& view : examination.views) {
      const Observations& all = view.view.observations;
      Observations some;
      // The points are spread over the whole target.
      some.points_in_target.resize(3, num_points);
      some.pixels.resize(2, num_points);
      for (Eigen::Index k = 0; k < num_points; ++k) {
        const Eigen::Index i = k * (all.size() - 1) / (num_points - 1);
        some.ids.push_back(all.ids[static_cast<size_t>(i)]);
        some.points_in_target.col(k) = all.points_in_target.col(i);
        some.pixels.col(k) = all.pixels.col(i);
      }
      view.view.observations = some;
    }
    return CodesOf(RunCheck(Check_residuals, &examination));
  };
  EXPECT_THAT(codes_with_points(8), ElementsAre("remark lens"));
  EXPECT_THAT(codes_with_points(7), IsEmpty());
}

}  // namespace
}  // namespace heba
