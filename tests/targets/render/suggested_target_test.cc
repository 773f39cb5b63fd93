#include "heba/suggested_target.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "heba/config/yaml_reader.h"
#include "targets/render/sheet.h"
#include "tests/support/rendered_target.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

class SuggestedTargetTest : public testing::TestWithParam<std::string> {};

// Returns the sheet on A4 with everything that `heba target` prints.
Sheet SheetOnA4(const std::string& yaml) {
  MapReader reader(ParseYaml(yaml, "test"));
  const std::unique_ptr<Target> target = CreateTarget(reader);
  SheetOptions options;
  options.paper_mm = Eigen::Vector2d(210, 297);
  options.config = FlowText(reader.used());
  return MakeSheet(*target, options);
}

TEST_P(SuggestedTargetTest, FitsOnThePaperAndIsDetectedAtTheDistance) {
  for (const double distance_m : {0.35, 0.6, 0.9}) {
    const TargetPurpose purpose{{210, 297}, distance_m, ImageCamera()};
    const SuggestedTarget suggested = SuggestTarget(GetParam(), purpose);
    ASSERT_FALSE(suggested.yaml.empty()) << distance_m;
    EXPECT_FALSE(SheetOnA4(suggested.yaml).has_tiles()) << suggested.yaml;
    const std::unique_ptr<Target> target = ParseTarget(suggested.yaml);
    EXPECT_EQ(target->Symmetries().size(), 1U) << suggested.yaml;
    EXPECT_LE(suggested.share_of_height, 0.75);
    if (suggested.feature_px < suggested.least_feature_px) continue;  // The proposal says so.
    // 20 deg of tilt, seen from the distance.
    const Drawing& drawing = target->Draw();
    const Eigen::Vector2d middle_m = 0.5 * (drawing.min_m + drawing.max_m);
    const Eigen::Quaterniond rotation =
        ExpRotation(DegToRad(20) * Eigen::Vector3d::UnitY()) *
        (drawing.y_up ? ExpRotation(kPi * Eigen::Vector3d::UnitX()) : Eigen::Quaterniond::Identity());
    const Rigid3d camera_from_target(
        rotation, Eigen::Vector3d(0, 0, distance_m) - rotation * Eigen::Vector3d(middle_m.x(), middle_m.y(), 0));
    RenderOptions options;
    options.noise_sigma_grey = 2;
    const Detection detection = target->Detect(RenderView(drawing, ImageCamera(), camera_from_target, options));
    EXPECT_GE(detection.ids.size(), 0.95 * static_cast<double>(target->points().size())) << suggested.yaml;
    EXPECT_LT(ErrorsOf(*target, ImageCamera(), camera_from_target, detection).RmsPx(), 0.1) << suggested.yaml;
  }
}

// Rulers, marks, small print and code do not disturb the detection of the sheet itself.
TEST_P(SuggestedTargetTest, ThePrintedSheetIsDetected) {
  const TempFolder folder;
  const SuggestedTarget suggested = SuggestTarget(GetParam(), {{210, 297}, 0.6, ImageCamera()});
  Sheet sheet = SheetOnA4(suggested.yaml);
  sheet.options.dpi = 100;
  WriteSheet(sheet, folder / "sheet.png");
  const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_GRAYSCALE);
  const std::unique_ptr<Target> target = ParseTarget(suggested.yaml);
  const Detection detection = target->Detect(image);
  ASSERT_EQ(detection.ids.size(), target->points().size()) << detection.reason;
  for (size_t i = 0; i < detection.ids.size(); ++i) {
    const auto point = std::find_if(sheet.points.begin(), sheet.points.end(),
                                    [&](const SheetPoint& candidate) { return candidate.id == detection.ids[i]; });
    ASSERT_NE(point, sheet.points.end());
    const Eigen::Vector2d expected_px = point->page_mm * 100 / 25.4 - Eigen::Vector2d(0.5, 0.5);
    // An edge without any blur is known to a fraction of a pixel only.
    EXPECT_LT((detection.pixels[i] - expected_px).norm(), 0.3) << detection.ids[i];
  }
}

INSTANTIATE_TEST_SUITE_P(AllTypes, SuggestedTargetTest, testing::ValuesIn(TargetTypeNames()),
                         [](const auto& type) { return type.param; });

}  // namespace
}  // namespace heba
