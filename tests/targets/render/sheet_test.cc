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
#include "heba/base/registry.h"
#include "targets/render/sheet_file.h"
#include "targets/render/sheet_layout.h"
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

// Returns the centroids, px, of the runs of ink along a row or a column.
std::vector<double> TicksOf(const cv::Mat& line) {
  std::vector<double> ticks_px;
  double weight = 0;
  double sum = 0;
  for (int i = 0; i < static_cast<int>(line.total()); ++i) {
    const double ink = 255 - line.at<uint8_t>(i);
    if (ink == 0 && weight > 0) {
      ticks_px.push_back(sum / weight);
      weight = sum = 0;
    }
    weight += ink;
    sum += ink * i;
  }
  return ticks_px;
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
  // The margin is 5 mm, the room above the drawing 5 mm with the mark of the x axis and 2 mm without it, and the
  // drawing extends 10.1 mm or 30.9 mm above the origin.
  EXPECT_NEAR(down.points[0].page_mm.y(), 20.1, 1e-9);
  EXPECT_NEAR(up.points[0].page_mm.y(), 37.9, 1e-9);
}

TEST(Sheet, LightOnDarkIsBlackAsFarAsTheDrawingExtends) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  target.drawing.ground = 0;
  for (Shape& shape : target.drawing.shapes) shape.albedo = 1;
  const Sheet sheet = MakeSheet(target);
  WriteSheet(sheet, folder / "sheet.png");
  const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
  const auto grey_at = [&](const Eigen::Vector2d& at_mm) {
    const Eigen::Vector2d at_px = at_mm * 300 / 25.4;
    return image.at<uint8_t>(static_cast<int>(at_px.y()), static_cast<int>(at_px.x()));
  };
  const Eigen::Vector2d begin_mm = sheet.drawing_at_mm;
  const Eigen::Vector2d end_mm = begin_mm + Eigen::Vector2d(60.5, 41);
  EXPECT_EQ(grey_at(begin_mm.array() + 0.2), 0);
  EXPECT_EQ(grey_at(end_mm.array() - 0.2), 0);
  EXPECT_EQ(grey_at(begin_mm.array() - 0.2), 255);
  EXPECT_EQ(grey_at(end_mm.array() + 0.2), 255);
  EXPECT_EQ(grey_at(sheet.points[0].page_mm), 255);
  EXPECT_EQ(image.at<uint8_t>(image.rows - 1, 0), 255);
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
  const Eigen::Vector2d begin_px = sheet.SheetFromTarget({0.002, 0.005}) * 300 / 25.4;
  const Eigen::Vector2d end_px = sheet.SheetFromTarget({0.020, 0.005}) * 300 / 25.4;
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
    // The ruler is beside the band of the vertical one.
    EXPECT_EQ(sheet.page_mm.x(), std::max(1000 * width_m, 101.0) + 20);
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
  const std::vector<double> ticks_px = TicksOf(image.row(row));
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
  // The width is that of the ruler, the band beside it and two margins: 101 mm + 10 mm + 2 * 5 mm. The height is that
  // of the drawing, the marks' room, the strip with three lines of small print and two margins: 41 mm + 7 mm + 17.8 mm
  // + 2 * 5 mm.
  EXPECT_THAT(svg, HasSubstr("width=\"121mm\" height=\"72.9mm\" viewBox=\"0 0 12100 7290\""));
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
  const std::string expected = R"({"page_mm":[121.0,72.9],"dpi":300.0,"scale_sigma":0.002,"points":[)"
                               R"({"id":5,"target_m":[0.0,0.0,0.0],"page_mm":[25.2,20.1]},)"
                               R"({"id":7,"target_m":[0.04001,0.02003,0.0],"page_mm":[65.21,40.13]}]})";
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
  sheet.size_mm = {2000, 1000};
  sheet.options.dpi = 1200;
  EXPECT_THAT(InputErrorOf([&] { WriteSheet(sheet, folder / "sheet.png"); }), HasSubstr("at most 416 dpi"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// A print that is stretched in one direction shows in one of the rulers.
TEST(Sheet, VerticalRulerOfThePngIsTrueToScale) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  for (const auto& [height_m, ruler_mm] : {std::pair(0.0309, 50.0), std::pair(0.12, 100.0)}) {
    target.drawing.max_m.y() = height_m;
    const Sheet sheet = MakeSheet(target);
    ASSERT_EQ(sheet.side_ruler_mm, ruler_mm);
    WriteSheet(sheet, folder / "sheet.png");
    const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
    // Only the ticks of full centimetres are so long.
    const int column = static_cast<int>((sheet.margin_mm + 2.7) * 300 / 25.4);
    const int last_row = static_cast<int>((sheet.margin_mm + ruler_mm + 2) * 300 / 25.4);
    const std::vector<double> ticks_px = TicksOf(image.col(column).rowRange(0, last_row + 1));
    ASSERT_EQ(ticks_px.size(), ruler_mm / 10 + 1);
    constexpr double kTolerancePx = 0.05;  // Accuracy of thin lines, anti-aliased with 8 bits.
    EXPECT_NEAR(ticks_px.back() - ticks_px.front(), ruler_mm * 300 / 25.4, kTolerancePx);
  }
}

Paper PaperOf(const std::string& name) { return *FindEntry(Papers(), name); }

TEST(Sheet, PaperHoldsTheSheetUprightOrOnItsSide) {
  FakeTarget target = TwoDiscs();
  SheetOptions options;
  options.paper = PaperOf("a4");
  target.drawing.max_m = {0.1698, 0.2299};
  const Sheet upright = MakeSheet(target, options);
  EXPECT_EQ(upright.page_mm, Eigen::Vector2d(210, 297));
  EXPECT_EQ(upright.pages.size(), 1U);
  target.drawing.max_m = {0.2398, 0.1299};
  const Sheet on_side = MakeSheet(target, options);
  EXPECT_EQ(on_side.page_mm, Eigen::Vector2d(297, 210));
  // The drawing of 250 mm x 140 mm is in the middle of what the band and the margins leave of 297 mm, and of what lies
  // above the strip, beside the marks' room of 7 mm.
  EXPECT_NEAR(on_side.drawing_at_mm.x(), 15 + 0.5 * (297 - 20 - 250), 1e-9);
  EXPECT_NEAR(on_side.drawing_at_mm.y(), 10 + 0.5 * (210 - 5 - on_side.strip_mm - 7 - 140), 1e-9);
  EXPECT_EQ(on_side.points[0].page_mm, on_side.SheetFromTarget({0, 0}));
  EXPECT_LT((on_side.points[1].page_mm - on_side.points[0].page_mm - Eigen::Vector2d(40.01, 20.03)).norm(), 1e-9);
}

TEST(Sheet, SmallestPaperIsTheFirstThatHoldsTheSheet) {
  FakeTarget target = TwoDiscs();
  EXPECT_EQ(SmallestPaper(target, {})->name, "a5");
  target.drawing.max_m = {0.38, 0.25};
  EXPECT_EQ(SmallestPaper(target, {})->name, "a3");
  target.drawing.max_m = {0.28, 0.2};
  SheetOptions options;
  options.paper = PaperOf("a4");
  EXPECT_EQ(SmallestPaper(target, options)->name, "a3");
  options.paper = PaperOf("letter");
  EXPECT_EQ(SmallestPaper(target, options)->name, "tabloid");
  // No paper of the series is large enough.
  target.drawing.max_m = {0.7, 0.5};
  EXPECT_EQ(SmallestPaper(target, options)->name, "a1");
  target.drawing.max_m = {2, 2};
  EXPECT_FALSE(SmallestPaper(target, {}).has_value());
}

TEST(Papers, IncreaseInArea) {
  for (size_t i = 1; i < Papers().size(); ++i) {
    EXPECT_GT(Papers()[i].width_mm * Papers()[i].height_mm, Papers()[i - 1].width_mm * Papers()[i - 1].height_mm);
    EXPECT_LE(Papers()[i].width_mm, Papers()[i].height_mm);
  }
}

// Returns a target of 400 x 300 mm with a grid of discs, and a point at each.
FakeTarget ManyDiscs() {
  FakeTarget target;
  target.drawing.max_m = {0.4, 0.3};
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 8; ++column) {
      const Eigen::Vector3d at_m(0.025 + 0.05 * column, 0.025 + 0.05 * row, 0);
      target.drawing.AddDisc(at_m.head<2>(), 0.01, 0);
      target.target_points.push_back({8 * row + column, at_m});
    }
  }
  return target;
}

TEST(Sheet, PagesOfOnePaperOverlapAndCoverTheSheet) {
  SheetOptions options;
  options.paper = PaperOf("a4");
  const Sheet sheet = MakeSheet(ManyDiscs(), options);
  ASSERT_EQ(sheet.pages.size(), 4U);
  EXPECT_EQ(sheet.NumPageRows(), 2);
  EXPECT_EQ(sheet.NumPageColumns(), 2);
  for (const SheetPage& page : sheet.pages) {
    const Eigen::Vector2d size_mm = page.to_mm - page.from_mm;
    // The margin of 5 mm and the frame with the marks of 5 mm remain on every side.
    EXPECT_LE((page.at_mm + size_mm).x(), sheet.page_mm.x() - 10);
    EXPECT_LE((page.at_mm + size_mm).y(), sheet.page_mm.y() - 10);
    EXPECT_GE(page.at_mm.minCoeff(), 10);
  }
  EXPECT_GE(sheet.pages[0].to_mm.x() - sheet.pages[1].from_mm.x(), 10);
  EXPECT_GE(sheet.pages[0].to_mm.y() - sheet.pages[2].from_mm.y(), 10);
  EXPECT_EQ(sheet.pages[0].from_mm, Eigen::Vector2d::Zero());
  EXPECT_LT((sheet.pages[3].to_mm - sheet.size_mm).norm(), 1e-9);
  // Glued together by their rectangles, the pages have every point where it belongs.
  for (const SheetPoint& point : sheet.points) {
    const SheetPage& page = sheet.pages[static_cast<size_t>(point.page)];
    const Eigen::Vector2d on_sheet_mm = point.page_mm - page.at_mm + page.from_mm;
    EXPECT_LT((on_sheet_mm - sheet.SheetFromTarget(point.in_target.head<2>())).norm(), 1e-9);
    EXPECT_TRUE(((on_sheet_mm - page.from_mm).array() >= 0).all() && ((page.to_mm - on_sheet_mm).array() >= 0).all());
  }
  const nlohmann::json json = nlohmann::json::parse(SheetJson(sheet, "sheet.pdf"));
  EXPECT_EQ(json["page_mm"], nlohmann::json({297.0, 210.0}));
  EXPECT_EQ(json["pages"], nlohmann::json({{"rows", 2}, {"columns", 2}}));
  EXPECT_EQ(json["points"][0]["page"], 1);
  EXPECT_EQ(json["points"].back()["page"], 4);
}

// No page is a sliver: the rulers can be measured on one page, and the code be read from one, before they are glued.
TEST(Sheet, RulersAndCodeAreNotDividedAmongPages) {
  for (const double width_m : {0.19, 0.27, 0.38, 0.561, 0.75}) {
    for (const double height_m : {0.15, 0.26, 0.35, 0.54}) {
      FakeTarget target;
      target.drawing.max_m = {width_m, height_m};
      SheetOptions options;
      options.paper = PaperOf("a5");
      options.config = std::string(400, 'x');
      const Sheet sheet = MakeSheet(target, options);
      ASSERT_GT(sheet.pages.size(), 1U);
      const Eigen::Vector2d part_mm = sheet.pages[0].to_mm - sheet.pages[0].from_mm;
      for (const SheetPage& page : sheet.pages) {
        EXPECT_LT((page.to_mm - page.from_mm - part_mm).norm(), 1e-9);
        const Eigen::Vector2d end_mm = page.at_mm + part_mm;
        EXPECT_TRUE((end_mm.array() <= sheet.page_mm.array() - 10 + 1e-9).all());
      }
      const SheetPage& bottom_left = sheet.pages[sheet.pages.size() - static_cast<size_t>(sheet.NumPageColumns())];
      EXPECT_GE(bottom_left.to_mm.x(), 10 + sheet.ruler_mm + 1);
      EXPECT_LE(bottom_left.from_mm.y(), sheet.size_mm.y() - sheet.strip_mm);
      EXPECT_GE(sheet.pages[0].to_mm.y(), sheet.side_ruler_mm + 1);
      const double code_mm = (sheet.code->size + 2 * kQrQuietModules) * kSheetCodeModuleMm;
      EXPECT_LE(sheet.pages.back().from_mm.x(), sheet.size_mm.x() - code_mm);
    }
  }
}

// Returns 1900 bytes in words.
std::string LongText() {
  std::string text;
  for (int i = 0; i < 380; ++i) text += "word ";
  return text;
}

// The shorter rulers are taken if the pages have no room for the longer ones.
TEST(Sheet, RulersAreWholeOnOnePageWhateverTheMargin) {
  int num_possible = 0;
  for (const double margin_mm : {5.0, 12.0, 15.0, 25.0, 33.0, 38.0, 40.0}) {
    for (const auto& [width_m, height_m] : {std::pair(0.19, 0.26), std::pair(0.08, 0.5), std::pair(0.5, 0.08)}) {
      FakeTarget target;
      target.drawing.max_m = {width_m, height_m};
      SheetOptions options;
      options.paper = PaperOf("a5");
      options.margin_mm = margin_mm;
      options.config = margin_mm < 35 ? LongText() : "";
      if (!options.Check().empty()) continue;
      ++num_possible;
      const Sheet sheet = MakeSheet(target, options);
      ASSERT_GT(sheet.pages.size(), 1U);
      const SheetPage& bottom_left = sheet.pages[sheet.pages.size() - static_cast<size_t>(sheet.NumPageColumns())];
      EXPECT_GE(bottom_left.to_mm.x(), kSheetBandMm + sheet.ruler_mm + 1) << margin_mm;
      EXPECT_LE(bottom_left.from_mm.y(), sheet.size_mm.y() - sheet.strip_mm) << margin_mm;
      EXPECT_GE(sheet.pages[0].to_mm.y(), sheet.side_ruler_mm + 1) << margin_mm;
      EXPECT_EQ(sheet.ruler_mm, margin_mm < 13 ? 100 : 50);
      const double code_mm = sheet.code ? (sheet.code->size + 2 * kQrQuietModules) * kSheetCodeModuleMm : 0;
      EXPECT_LE(sheet.pages.back().from_mm.x(), sheet.size_mm.x() - code_mm) << margin_mm;
    }
  }
  EXPECT_EQ(num_possible, 6 * 3);  // A margin of 40 mm leaves too little.
}

TEST(Sheet, OnlyAPdfHasSeveralPages) {
  const TempFolder folder;
  SheetOptions options;
  options.paper = PaperOf("a4");
  const Sheet sheet = MakeSheet(ManyDiscs(), options);
  for (const char* name : {"sheet.svg", "sheet.png"}) {
    EXPECT_THAT(InputErrorOf([&] { WriteSheet(sheet, folder / name); }),
                HasSubstr("does not fit on a4 (210 x 297 mm); use a larger paper, or .pdf"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  WriteSheet(sheet, folder / "sheet.pdf");
  const std::string pdf = ReadTextFile(folder / "sheet.pdf");
  EXPECT_THAT(pdf, HasSubstr("/Count 4"));
}

TEST(Sheet, PdfHasTheTitle) {
  const TempFolder folder;
  SheetOptions options;
  options.title = "fake 2 x 1, 40 mm";
  WriteSheet(MakeSheet(TwoDiscs(), options), folder / "sheet.pdf");
  EXPECT_THAT(ReadTextFile(folder / "sheet.pdf"), HasSubstr("/Title (fake 2 x 1, 40 mm)"));
}

// The bars at the arrows are in line with the origin, outside of the drawing.
TEST(Sheet, AxesAreMarkedInLineWithTheOrigin) {
  const TempFolder folder;
  FakeTarget target = TwoDiscs();
  for (const bool y_up : {false, true}) {
    target.drawing.y_up = y_up;
    const Sheet sheet = MakeSheet(target);
    WriteSheet(sheet, folder / "sheet.png");
    const cv::Mat image = cv::imread((folder / "sheet.png").string(), cv::IMREAD_UNCHANGED);
    const Eigen::Vector2d origin_mm = sheet.SheetFromTarget({0, 0});
    const auto ink_at = [&](double x_mm, double y_mm) {
      return 255 - image.at<uint8_t>(static_cast<int>(y_mm * 300 / 25.4), static_cast<int>(x_mm * 300 / 25.4));
    };
    const double x_mark_mm = sheet.drawing_at_mm.y() + (y_up ? 41 + 2.5 : -2.5);
    const double y_mark_mm = sheet.drawing_at_mm.x() - 2.5;
    // Each bar extends to both sides of its arrow, which begins at the bar.
    for (const double side_mm : {-0.9, 0.9}) {
      EXPECT_GT(ink_at(origin_mm.x(), x_mark_mm + side_mm), 100);
      EXPECT_GT(ink_at(y_mark_mm + side_mm, origin_mm.y()), 100);
      EXPECT_EQ(ink_at(origin_mm.x() + 1, x_mark_mm + side_mm), 0);
    }
    const double up = y_up ? -1 : 1;
    EXPECT_GT(ink_at(origin_mm.x() + 3, x_mark_mm), 100);
    EXPECT_EQ(ink_at(origin_mm.x() - 1, x_mark_mm), 0);
    EXPECT_GT(ink_at(y_mark_mm, origin_mm.y() + up * 3), 100);
    EXPECT_EQ(ink_at(y_mark_mm, origin_mm.y() - up * 1), 0);
  }
}

TEST(Sheet, ReportsInvalidOptions) {
  SheetOptions options;
  EXPECT_THAT(options.Check(), IsEmpty());
  options.dpi = std::nan("");
  options.margin_mm = -1;
  EXPECT_THAT(options.Check(), HasSubstr("dpi must be"));
  EXPECT_THAT(options.Check(), HasSubstr("margin_mm must be"));
  options.margin_mm = 60;
  options.paper = PaperOf("a5");
  EXPECT_THAT(options.Check(), HasSubstr("paper must leave 61 mm"));
  options.config = std::string(1900, 'x');
  EXPECT_THAT(options.Check(), HasSubstr("paper must leave 67.6 mm"));
  options.config = std::string(3000, 'x');
  EXPECT_THAT(options.Check(), HasSubstr("config must have"));
}

}  // namespace
}  // namespace heba
