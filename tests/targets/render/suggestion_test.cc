#include "targets/render/suggestion.h"

#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/registry.h"
#include "heba/base/units.h"
#include "heba/target.h"
#include "targets/render/rendering.h"
#include "targets/render/sheet.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAreArray;

SuggestionOptions OptionsFor(const std::string& type, const std::string& paper, double distance_m) {
  SuggestionOptions options;
  options.type = type;
  options.paper = *FindEntry(Papers(), paper);
  options.distance_m = distance_m;
  options.camera = {"brown5", 1280, 960, {1402.5, 1403.1, 648.2, 473.9, -0.11, 0.09, 4e-4, -6e-4, 0}};
  return options;
}

// Returns the suggestion for A4 at 0.6 m, which is made once for all tests.
const Outcome<Suggestion>& SuggestionFor(const std::string& type) {
  static std::map<std::string, Outcome<Suggestion>> suggestions;
  const auto found = suggestions.find(type);
  if (found != suggestions.end()) return found->second;
  return suggestions.emplace(type, SuggestTarget(OptionsFor(type, "a4", 0.6))).first->second;
}

TEST(SuggestedTypes, AreAllTypesOfTargets) {
  EXPECT_THAT(SuggestedTypes(), UnorderedElementsAreArray(TargetTypeNames()))
      << "targets.def has a type without a line in kProposals of suggestion.cc";
}

class SuggestionTest : public testing::TestWithParam<std::string> {};

TEST_P(SuggestionTest, FitsOnThePaperAndFillsAThirdToHalfOfTheImage) {
  const SuggestionOptions options = OptionsFor(GetParam(), "a4", 0.6);
  ASSERT_THAT(options.Check(), IsEmpty());
  const Outcome<Suggestion>& suggestion = SuggestionFor(GetParam());
  ASSERT_TRUE(suggestion.ok()) << suggestion.reason();
  const std::unique_ptr<Target> target = ParseTarget(suggestion->config);
  EXPECT_EQ(target->type(), GetParam());
  EXPECT_EQ(target->Symmetries().size(), 1U);
  EXPECT_EQ(target->points().size(), suggestion->num_points);
  EXPECT_LE(suggestion->num_points, kMaxSuggestedPoints);
  EXPECT_GE(suggestion->height_share, 1.0 / 3);
  EXPECT_LE(suggestion->height_share, 0.5);
  EXPECT_LE(suggestion->width_share, 0.6);
  SheetOptions sheet;
  sheet.paper = options.paper;
  EXPECT_EQ(MakeSheet(*target, sheet).pages.size(), 1U);
}

// Views other than the one in which the proposal was tried: any tilt up to 35 deg, and up to a quarter farther away.
TEST_P(SuggestionTest, IsDetectedAtTheDistanceAndAQuarterBeyond) {
  const SuggestionOptions options = OptionsFor(GetParam(), "a4", 0.6);
  const Outcome<Suggestion>& suggestion = SuggestionFor(GetParam());
  ASSERT_TRUE(suggestion.ok()) << suggestion.reason();
  const std::unique_ptr<Target> target = ParseTarget(suggestion->config);
  const Drawing& drawing = target->Draw();
  const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
  const Eigen::Quaterniond front =
      drawing.y_up ? ExpRotation(kPi * Eigen::Vector3d::UnitX()) : Eigen::Quaterniond::Identity();
  for (const double distance_m : {0.6, 0.75}) {
    for (int view = 0; view < 3; ++view) {
      Rng rng(7, static_cast<uint64_t>(view));
      const double towards_rad = rng.Uniform(-kPi, kPi);
      const double tilt_rad = rng.Uniform(0, DegToRad(35));
      const Eigen::Quaterniond rotation =
          ExpRotation(tilt_rad * Eigen::Vector3d(std::cos(towards_rad), std::sin(towards_rad), 0)) * front;
      const Rigid3d camera_from_target(
          rotation, Eigen::Vector3d(0, 0, distance_m) - rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
      RenderOptions render;
      render.noise_sigma_grey = 2;
      render.seed = static_cast<uint64_t>(view);
      const Detection detection = target->Detect(RenderView(drawing, options.camera, camera_from_target, render));
      const DetectionErrors errors = ErrorsOf(*target, options.camera, camera_from_target, detection);
      EXPECT_EQ(errors.num_unknown_ids, 0U);
      EXPECT_GE(static_cast<double>(errors.num_found), 0.95 * static_cast<double>(target->points().size()))
          << detection.reason;
      EXPECT_LT(errors.RmsPx(), 0.1);
    }
  }
}

using SuggestionNightly = SuggestionTest;

TEST_P(SuggestionNightly, StatesTheScatterOfThePose) {
  const Outcome<Suggestion>& near = SuggestionFor(GetParam());
  const Outcome<Suggestion> far = SuggestTarget(OptionsFor(GetParam(), "a4", 0.9));
  ASSERT_TRUE(near.ok() && far.ok()) << near.reason() << far.reason();
  EXPECT_GT(near->sigma.position_m, 1e-7);
  EXPECT_LT(near->sigma.position_m, 1e-4);
  EXPECT_GT(far->sigma.position_m, near->sigma.position_m);
}

INSTANTIATE_TEST_SUITE_P(Types, SuggestionNightly, testing::ValuesIn(SuggestedTypes()),
                         [](const auto& test) { return test.param; });
INSTANTIATE_TEST_SUITE_P(Types, SuggestionTest, testing::ValuesIn(SuggestedTypes()),
                         [](const auto& param_info) { return param_info.param; });

// Parts that are too small for the camera are refused, not proposed.
TEST(Suggestion, FailsIfNothingIsLargeEnough) {
  const Outcome<Suggestion> suggestion = SuggestTarget(OptionsFor("coded_board", "a5", 6));
  ASSERT_FALSE(suggestion.ok());
  EXPECT_THAT(suggestion.reason(), HasSubstr("no coded_board on a5 suits this camera at 6.00 m: a dot needs"));
}

// A marker is a whole number of millimetres, and so less than 0.7 of the smallest square.
TEST(Suggestion, CellsOfMarkersAreLargeEnoughAtAShortDistance) {
  SuggestionOptions options = OptionsFor("charuco", "a4", 0.185);
  options.camera = {"pinhole", 800, 600, {1200, 1200, 400, 300}};
  const Outcome<Suggestion> suggestion = SuggestTarget(options);
  ASSERT_TRUE(suggestion.ok()) << suggestion.reason();
  const std::string before = "marker: ";
  const double marker_mm = std::stod(suggestion->config.substr(suggestion->config.find(before) + before.size()));
  const double cell_px = 1e-3 * marker_mm / 6 * 1200 / 0.185;
  EXPECT_NEAR(suggestion->feature_px, cell_px, 1e-9);
  EXPECT_GE(cell_px, 1.25 * 3);
}

// The optical axis is so far from the middle of the image that the pattern with the most information is cut off.
TEST(Suggestion, TriesTheNextPatternIfTheBestIsNotFound) {
  SuggestionOptions options = OptionsFor("chessboard", "a4", 0.26);
  options.camera = {"pinhole", 1280, 960, {1200, 1200, 200, 160}};
  const Outcome<Suggestion> suggestion = SuggestTarget(options);
  ASSERT_TRUE(suggestion.ok()) << suggestion.reason();
  EXPECT_GE(static_cast<double>(suggestion->num_found), 0.95 * static_cast<double>(suggestion->num_points));
}

TEST(Suggestion, ReportsInvalidOptions) {
  SuggestionOptions options = OptionsFor("coded_bord", "a4", -1);
  options.camera.width_px = 0;
  EXPECT_THAT(options.Check(), HasSubstr("did you mean 'coded_board'?"));
  EXPECT_THAT(options.Check(), HasSubstr("the distance must be"));
  EXPECT_THAT(options.Check(), HasSubstr("size"));
}

}  // namespace
}  // namespace heba
