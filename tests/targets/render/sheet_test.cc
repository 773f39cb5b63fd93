#include "targets/render/sheet.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/files.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"
#include "tests/targets/fake_target.h"

namespace heba {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

// Returns a target with two discs on a sheet of 60.5 x 41 mm, whose points are the centres of the discs.
FakeTarget TwoDiscs() {
  FakeTarget target;
  target.drawing.min_m = {-0.0102, -0.0101};
  target.drawing.max_m = {0.0503, 0.0309};
  target.drawing.AddDisc({0, 0}, 0.004, 0);
  target.drawing.AddDisc({0.04001, 0.02003}, 0.003, 0);
  target.target_points = {{5, {0, 0, 0}}, {7, {0.04001, 0.02003, 0}}};
  return target;
}

// Returns the centroid, px, of the ink around a pixel (or of the paper on a black ground).
Eigen::Vector2d Centroid(const cv::Mat& image, const Eigen::Vector2d& around_px, int reach_px) {
  const int x0 = static_cast<int>(std::lround(around_px.x()));
  const int y0 = static_cast<int>(std::lround(around_px.y()));
  const double ground = image.at<uint8_t>(y0 - reach_px, x0 - reach_px);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int y = y0 - reach_px; y <= y0 + reach_px; ++y) {
    for (int x = x0 - reach_px; x <= x0 + reach_px; ++x) {
      sum += std::abs(image.at<uint8_t>(y, x) - ground) * Eigen::Vector3d(x, y, 1);
    }
  }
  return sum.head<2>() / sum.z();
}

class SheetPngTest : public testing::TestWithParam<bool> {};

// The target's y axis points down or up; on the page y is measured down from the top in both cases.
TEST_P(SheetPngTest, DiscsMatchTheJsonAtAnyResolution) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  target.drawing.y_up = GetParam();
  for (const double dpi : {150.0, 300.0, 317.3}) {
    SheetOptions options;
    options.dpi = dpi;
    const Sheet sheet = MakeSheet(target, options);
    WriteSheet(sheet, folder / "sheet.png");
    const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(image.type(), CV_8UC1);
    EXPECT_EQ(image.cols, std::ceil(sheet.page_mm.x() * dpi / 25.4));
    EXPECT_EQ(image.rows, std::ceil(sheet.page_mm.y() * dpi / 25.4));
    const nlohmann::json json = nlohmann::json::parse(SheetJson(sheet, folder / "sheet.png"));
    for (const nlohmann::json& point : json["points"]) {
      const Eigen::Vector2d page_mm(point["page_mm"][0].get<double>(), point["page_mm"][1].get<double>());
      const Eigen::Vector2d expected_px = (page_mm * dpi / 25.4).array() - 0.5;
      const int reach_px = static_cast<int>(4.5 * dpi / 25.4);
      const Eigen::Vector2d found_px = Centroid(image, expected_px, reach_px);
      constexpr double kTolerancePx = 0.02;  // 1.7 um at 300 dpi, due to Cairo's anti-aliasing.
      EXPECT_LT((found_px - expected_px).norm(), kTolerancePx) << found_px.transpose() << " at " << dpi << " dpi";
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Sheet, SheetPngTest, testing::Values(false, true),
                         [](const auto& param_info) { return param_info.param ? "YUp" : "YDown"; });

TEST(Sheet, FlipsDrawingsWithYUp) {
  FakeTarget target = TwoDiscs();
  const Sheet down = MakeSheet(target);
  target.drawing.y_up = true;
  const Sheet up = MakeSheet(target);
  EXPECT_LT(down.points[0].page_mm.y(), down.points[1].page_mm.y());
  EXPECT_GT(up.points[0].page_mm.y(), up.points[1].page_mm.y());
  EXPECT_DOUBLE_EQ(down.points[0].page_mm.x(), up.points[0].page_mm.x());
  // The margin is 5 mm, and the sheet extends 10.1 mm or 30.9 mm above the origin.
  EXPECT_NEAR(down.points[0].page_mm.y(), 15.1, 1e-9);
  EXPECT_NEAR(up.points[0].page_mm.y(), 35.9, 1e-9);
}

TEST(Sheet, LightOnDarkIsBlackAboveAWhiteStrip) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  target.drawing.ground = 0;
  for (Shape& shape : target.drawing.shapes) shape.albedo = 1;
  const Sheet sheet = MakeSheet(target);
  WriteSheet(sheet, folder / "sheet.png");
  const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
  const int strip_px = static_cast<int>((sheet.page_mm.y() - sheet.strip_mm) * 300 / 25.4);
  EXPECT_EQ(image.at<uint8_t>(0, 0), 0);
  EXPECT_EQ(image.at<uint8_t>(strip_px - 2, image.cols - 1), 0);
  EXPECT_EQ(image.at<uint8_t>(strip_px + 2, image.cols - 1), 255);
  EXPECT_EQ(image.at<uint8_t>(image.rows - 1, 0), 255);
  const Eigen::Vector2d disc_px = sheet.points[0].page_mm * 300 / 25.4;
  EXPECT_EQ(image.at<uint8_t>(static_cast<int>(disc_px.y()), static_cast<int>(disc_px.x())), 255);
}

TEST(Sheet, AdjacentShapesShowNoSeam) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  target.drawing.shapes.clear();
  // The edges are off the pixel grid, and the corners are given in either order.
  target.drawing.AddRectangle(0.0012345, 0, 0.0112345, 0.01, 0);
  target.drawing.AddRectangle(0.0212345, 0, 0.0112345, 0.01, 0);
  const Sheet sheet = MakeSheet(target);
  WriteSheet(sheet, folder / "sheet.png");
  const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
  const Eigen::Vector2d begin_px = sheet.PageFromTarget({0.002, 0.005}) * 300 / 25.4;
  const Eigen::Vector2d end_px = sheet.PageFromTarget({0.020, 0.005}) * 300 / 25.4;
  for (int x = static_cast<int>(begin_px.x()); x < end_px.x(); ++x) {
    EXPECT_EQ(image.at<uint8_t>(static_cast<int>(begin_px.y()), x), 0) << x;
  }
}

// A short ruler would not reveal a print at 99 % of its size.
TEST(Sheet, RulerIsLongOnSmallSheetsToo) {
  FakeTarget target;
  for (const double width_m : {0.2, 0.03}) {
    target.drawing.max_m = {width_m, 0.02};
    const Sheet sheet = MakeSheet(target);
    EXPECT_EQ(sheet.ruler_mm, 100) << width_m;
    EXPECT_EQ(sheet.page_mm.x(), std::max(1000 * width_m, 100.0) + 10);
  }
}

TEST(Sheet, RulerOfThePngIsTrueToScale) {
  const TempFolder folder;
  const Sheet sheet = MakeSheet(TwoDiscs());
  ASSERT_EQ(sheet.ruler_mm, 100);
  WriteSheet(sheet, folder / "sheet.png");
  const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
  // The longest ticks are those of full centimetres: this row is reached only by them.
  const int row = static_cast<int>((sheet.page_mm.y() - sheet.strip_mm + 4.7) * 300 / 25.4);
  std::vector<double> ticks_px;
  double weight = 0;
  double sum = 0;
  for (int x = 0; x < image.cols; ++x) {
    const double ink = 255 - image.at<uint8_t>(row, x);
    if (ink == 0 && weight > 0) {
      ticks_px.push_back(sum / weight);
      weight = sum = 0;
    }
    weight += ink;
    sum += ink * x;
  }
  ASSERT_EQ(ticks_px.size(), 11U);
  constexpr double kTolerancePx = 0.05;  // Accuracy of thin lines, anti-aliased with 8 bits.
  EXPECT_NEAR(ticks_px.back() - ticks_px.front(), 100 * 300 / 25.4, kTolerancePx);
}

TEST(Sheet, PngStatesItsResolution) {
  const TempFolder folder;
  WriteSheet(MakeSheet(TwoDiscs()), folder / "sheet.png");
  const std::string bytes = ReadTextFile(folder / "sheet.png");
  const size_t found = bytes.find("pHYs");
  ASSERT_NE(found, std::string::npos);
  // 300 dpi are 11811 (0x2e23) pixels per metre; the unit and the checksum as computed by libpng follow.
  EXPECT_EQ(bytes.substr(found - 4, 21), std::string("\0\0\0\x09pHYs\0\0\x2e\x23\0\0\x2e\x23\x01\x78\xa5\x3f\x76", 21));
}

TEST(Sheet, SvgHasThePagesSizeInMillimetres) {
  const TempFolder folder;
  WriteSheet(MakeSheet(TwoDiscs()), folder / "sheet.svg");
  const std::string svg = ReadTextFile(folder / "sheet.svg");
  EXPECT_THAT(svg, StartsWith("<?xml"));
  // The size is 60.5 mm + 2 * 5 mm by 41 mm + 2 * 5 mm + 14 mm; the width is that of the ruler with its margins, 110
  // mm.
  EXPECT_THAT(svg, HasSubstr("width=\"110mm\" height=\"65mm\" viewBox=\"0 0 11000 6500\""));
  EXPECT_THAT(svg, HasSubstr("</svg>"));
}

TEST(Sheet, PdfHasThePagesSizeInPoints) {
  const TempFolder folder;
  const Sheet sheet = MakeSheet(TwoDiscs());
  WriteSheet(sheet, folder / "sheet.pdf");
  const std::string pdf = ReadTextFile(folder / "sheet.pdf");
  EXPECT_THAT(pdf, StartsWith("%PDF-"));
  const size_t found = pdf.find("/MediaBox [ ");
  ASSERT_NE(found, std::string::npos);
  double box[4] = {};
  ASSERT_EQ(std::sscanf(pdf.c_str() + found, "/MediaBox [ %lf %lf %lf %lf ]", &box[0], &box[1], &box[2], &box[3]), 4);
  EXPECT_EQ(box[0], 0);
  EXPECT_EQ(box[1], 0);
  constexpr double kTolerancePt = 0.001;  // Resolution of the digits that Cairo prints.
  EXPECT_NEAR(box[2], sheet.page_mm.x() * 72 / 25.4, kTolerancePt);
  EXPECT_NEAR(box[3], sheet.page_mm.y() * 72 / 25.4, kTolerancePt);
}

TEST(Sheet, SameSheetGivesSameBytes) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  target.drawing.labels.push_back({"ids 5, 7", {0, 0.028}, 0.002});
  const Sheet sheet = MakeSheet(target);
  for (const std::string suffix : {".svg", ".pdf", ".png"}) {
    WriteSheet(sheet, folder / ("a" + suffix));
    WriteSheet(sheet, folder / ("b" + suffix));
    EXPECT_EQ(ReadTextFile(folder / ("a" + suffix)), ReadTextFile(folder / ("b" + suffix))) << suffix;
  }
}

TEST(Sheet, JsonFollowsTheDocumentedFormat) {
  const Sheet sheet = MakeSheet(TwoDiscs());
  const std::string expected = R"({"page_mm":[110.0,65.0],"dpi":300.0,"points":[)"
                               R"({"id":5,"target_m":[0.0,0.0,0.0],"page_mm":[15.2,15.1]},)"
                               R"({"id":7,"target_m":[0.04001,0.02003,0.0],"page_mm":[55.21,35.13]}]})";
  EXPECT_EQ(nlohmann::ordered_json::parse(SheetJson(sheet, "sheet.png")).dump(), expected);
  EXPECT_TRUE(nlohmann::json::parse(SheetJson(sheet, "sheet.svg"))["dpi"].is_null());
  EXPECT_TRUE(nlohmann::json::parse(SheetJson(sheet, "sheet.pdf"))["dpi"].is_null());
}

TEST(Sheet, RefusesUnknownSuffixesAndHugeImages) {
  const TempFolder folder;
  Sheet sheet = MakeSheet(TwoDiscs());
  EXPECT_THAT(InputErrorOf([&] { WriteSheet(sheet, folder / "sheet.jpg"); }), HasSubstr(".svg, .pdf or .png"));
  EXPECT_THAT(InputErrorOf([&] { WriteSheet(sheet, folder / "sheet"); }), HasSubstr(".svg, .pdf or .png"));
  EXPECT_THAT(InputErrorOf([&] { WriteSheet(sheet, folder / "missing" / "sheet.pdf"); }), HasSubstr("sheet.pdf"));
  sheet.page_mm = {2000, 1000};
  sheet.options.dpi = 1200;
  EXPECT_THAT(InputErrorOf([&] { WriteSheet(sheet, folder / "sheet.png"); }), HasSubstr("at most 416 dpi"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Sheet, ReportsInvalidOptions) {
  SheetOptions options;
  EXPECT_THAT(options.Check(), IsEmpty());
  options.dpi = std::nan("");
  options.margin_mm = -1;
  EXPECT_THAT(options.Check(), HasSubstr("dpi must be"));
  EXPECT_THAT(options.Check(), HasSubstr("margin_mm must be"));
}

}  // namespace
}  // namespace heba
