// The sheet of every type of target: it is detected as printed, and its code reads back as the target.
#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/wechat_qrcode.hpp>

#include "heba/base/registry.h"
#include "heba/config/yaml_reader.h"
#include "heba/target.h"
#include "targets/render/sheet_file.h"
#include "targets/render/target_text.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

struct Example {
  const char* name;
  const char* yaml;
  const char* title;
};
void PrintTo(const Example& example, std::ostream* stream) { *stream << example.name; }

const Example kExamples[] = {
    {"coded_board", "{type: coded_board, rows: 5, columns: 6, spacing: 24 mm, dot_diameter: 7.2 mm}",
     "coded_board 6 x 5, 24 mm"},
    {"coded_board_dark", "{type: coded_board, rows: 4, columns: 5, spacing: 25.4 mm, light_on_dark: true, bits: 14}",
     "coded_board 5 x 4, 25.4 mm"},
    {"apriltag_grid", "{type: apriltag_grid, family: tag36h11, rows: 3, columns: 4, tag_size: 30 mm}",
     "apriltag_grid 4 x 3, 30 mm"},
    {"chessboard", "{type: chessboard, rows: 6, columns: 9, square: 18 mm}", "chessboard 9 x 6, 18 mm"},
    {"charuco", "{type: charuco, rows: 5, columns: 7, square: 24 mm, marker: 18 mm, dictionary: DICT_4X4_50}",
     "charuco 7 x 5, 24 mm"},
    {"circle_grid", "{type: circle_grid, rows: 7, columns: 8, spacing: 18 mm, marker_dot: true}",
     "circle_grid 8 x 7, 18 mm"},
    {"circle_grid_asymmetric", "{type: circle_grid, rows: 7, columns: 4, spacing: 14 mm, asymmetric: true}",
     "circle_grid 4 x 7, 14 mm"},
};

class PrintedTargetTest : public testing::TestWithParam<Example> {
 protected:
  void SetUp() override {
    MapReader reader(ParseYaml(GetParam().yaml, "target"));
    target_ = CreateTarget(reader);
    options_.title = TargetTitle(*target_, reader.used());
    options_.config = TargetConfigLine(reader.used());
    options_.paper = *FindEntry(Papers(), "a4");
  }

  // Prints the sheet on one page, and reads the points of its SHEET.json.
  cv::Mat Print() {
    const Sheet sheet = MakeSheet(*target_, options_);
    EXPECT_EQ(sheet.pages.size(), 1U);
    const TempFolder folder;
    WriteSheet(sheet, folder / "sheet.png");
    const nlohmann::json json = nlohmann::json::parse(SheetJson(sheet, folder / "sheet.png"));
    for (const nlohmann::json& point : json["points"]) {
      const std::vector<double> at_m = point["target_m"];
      const std::vector<double> at_mm = point["page_mm"];
      points_[point["id"]] = {{at_m.at(0), at_m.at(1), at_m.at(2)}, {at_mm.at(0), at_mm.at(1)}};
    }
    return cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
  }

  std::unique_ptr<Target> target_;
  SheetOptions options_;
  struct JsonPoint {
    Eigen::Vector3d in_target = Eigen::Vector3d::Zero();
    Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();
  };

  // Returns where the page shows the point that a detection names, if it has read the target in an order that differs
  // by a symmetry.
  Eigen::Vector2d PageMm(int id, const Rigid3d& target_from_target) const {
    const Eigen::Vector3d in_target = target_from_target * points_.at(id).in_target;
    const auto nearest = std::min_element(points_.begin(), points_.end(), [&](const auto& a, const auto& b) {
      return (a.second.in_target - in_target).norm() < (b.second.in_target - in_target).norm();
    });
    return nearest->second.page_mm;
  }

  std::map<int, JsonPoint> points_;  // Those of SHEET.json by their ids.
};

TEST(PrintedTargetExamplesTest, CoverEveryType) {
  for (const std::string& type : TargetTypeNames()) {
    EXPECT_NE(FindEntry(kExamples, type), nullptr) << "targets.def has " << type << ": give it an example here";
  }
}

TEST_P(PrintedTargetTest, TitleNamesTheTypeTheGridAndTheSize) { EXPECT_EQ(options_.title, GetParam().title); }

// The rulers, the marks, the small print and the code do not look like parts of a target.
TEST_P(PrintedTargetTest, TheWholeSheetIsDetectedWhereSheetJsonSays) {
  options_.dpi = 150;
  const cv::Mat image = Print();
  const Detection detection = target_->Detect(image);
  std::vector<int> ids = detection.ids;
  std::sort(ids.begin(), ids.end());
  ASSERT_EQ(ids.size(), points_.size()) << detection.reason;
  for (const auto& [id, point] : points_) EXPECT_TRUE(std::binary_search(ids.begin(), ids.end(), id)) << id;
  double largest_px = 0;
  for (const Rigid3d& target_from_target : target_->Symmetries()) {
    largest_px = 0;
    for (size_t i = 0; i < detection.ids.size(); ++i) {
      const Eigen::Vector2d at_mm = PageMm(detection.ids[i], target_from_target);
      const Eigen::Vector2d expected_px = (at_mm * options_.dpi / 25.4).array() - 0.5;
      largest_px = std::max(largest_px, (detection.pixels[i] - expected_px).norm());
    }
    constexpr double kTolerancePx = 0.1;  // Cairo's anti-aliasing and the detectors' own errors in sharp images.
    if (largest_px < kTolerancePx) return;
  }
  ADD_FAILURE() << "off by " << largest_px << " px";
}

TEST_P(PrintedTargetTest, CodeReadsBackAsTheTarget) {
  const cv::Mat image = Print();
  // Debian's OpenCV has this decoder; the one of its objdetect was built without the library that it needs.
  const std::vector<std::string> texts = cv::wechat_qrcode::WeChatQRCode().detectAndDecode(image);
  ASSERT_EQ(texts.size(), 1U);
  const std::string& text = texts[0];
  EXPECT_EQ(text, options_.config);
  const std::unique_ptr<Target> read = ParseTarget(text);
  EXPECT_EQ(read->type(), target_->type());
  ASSERT_EQ(read->points().size(), target_->points().size());
  for (size_t i = 0; i < read->points().size(); ++i) {
    EXPECT_EQ(read->points()[i].id, target_->points()[i].id);
    EXPECT_LT((read->points()[i].in_target - target_->points()[i].in_target).norm(), 1e-9);
    EXPECT_NEAR(read->points()[i].radius_m, target_->points()[i].radius_m, 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Sheets, PrintedTargetTest, testing::ValuesIn(kExamples),
                         [](const auto& param_info) { return param_info.param.name; });

// A length of 1.2 inches in metres is 0.030479999999999997; people read 30.48 mm.
TEST(TargetConfigLine, HasRoundNumbersAndAllDefaults) {
  MapReader reader(
      ParseYaml("{type: apriltag_grid, family: tag36h11, rows: 2, columns: 3, tag_size: 0.03048000000000001 m}", "t"));
  CreateTarget(reader);
  EXPECT_EQ(TargetConfigLine(reader.used()),
            "{type: apriltag_grid, family: tag36h11, rows: 2, columns: 3, tag_size: 30.48 mm, border_bits: 1, "
            "tag_spacing: 0.3, first_id: 0, corner_squares: true}");
}

}  // namespace
}  // namespace heba
