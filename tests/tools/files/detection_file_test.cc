#include "tools/files/detection_file.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

CaptureDetection DetectionOf(const std::vector<int>& ids, const std::vector<Eigen::Vector2d>& pixels) {
  CaptureDetection capture;
  capture.width_px = 640;
  capture.height_px = 480;
  capture.detection.ids = ids;
  capture.detection.pixels = pixels;
  return capture;
}

class DetectionFileTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& text) const {
    std::ofstream(folder_ / "detections.json") << text;
    return folder_ / "detections.json";
  }
  TempFolder folder_;
};

TEST_F(DetectionFileTest, ReadsWhatItWrites) {
  CaptureDetection unseen = DetectionOf({}, {});
  unseen.detection.reason = "no tag was found";
  const std::string text =
      DetectionsToJson({{"a.png", DetectionOf({3, 7}, {{1.0 / 3, 2.5}, {639.25, 479}})}, {"b.png", unseen}});
  const auto captures = ReadDetections(Write(text));
  ASSERT_EQ(captures.size(), 2u);
  EXPECT_EQ(captures[0].first, "a.png");
  EXPECT_EQ(captures[0].second.width_px, 640);
  EXPECT_EQ(captures[0].second.height_px, 480);
  EXPECT_THAT(captures[0].second.detection.ids, ElementsAre(3, 7));
  // Pixels keep every digit.
  EXPECT_THAT(captures[0].second.detection.pixels,
              ElementsAre(Eigen::Vector2d(1.0 / 3, 2.5), Eigen::Vector2d(639.25, 479)));
  EXPECT_EQ(captures[1].first, "b.png");
  EXPECT_THAT(captures[1].second.detection.ids, IsEmpty());
  EXPECT_EQ(captures[0].second.detection.reason, "");
  EXPECT_EQ(captures[1].second.detection.reason, "no tag was found");
}

TEST_F(DetectionFileTest, WritesTheSchema) {
  CaptureDetection unseen = DetectionOf({}, {});
  unseen.detection.reason = "no tag was found";
  const nlohmann::json json = nlohmann::json::parse(DetectionsToJson({{"a.png", unseen}}));
  EXPECT_EQ(json["schema"], "heba/detections/1");
  EXPECT_EQ(json["captures"][0]["image"], "a.png");
  EXPECT_EQ(json["captures"][0]["image_size"], (nlohmann::json{640, 480}));
  EXPECT_EQ(json["captures"][0]["ids"], nlohmann::json::array());
  EXPECT_EQ(json["captures"][0]["pixels"], nlohmann::json::array());
  EXPECT_EQ(json["captures"][0]["reason"], "no tag was found");
}

// Names of files need not be UTF-8, but JSON must be.
TEST_F(DetectionFileTest, WritesAnyNameAsValidJson) {
  const std::string text = DetectionsToJson({{"\xff\"\n.png", DetectionOf({}, {})}});
  EXPECT_EQ(nlohmann::json::parse(text)["captures"][0]["image"], "\xef\xbf\xbd\"\n.png");
}

// The fit of a tag at the border may place a corner slightly outside of the image.
TEST_F(DetectionFileTest, PixelsMayBeSlightlyOutside) {
  EXPECT_EQ(ReadDetections(Write(DetectionsToJson({{"a.png", DetectionOf({0, 1}, {{-5, 0}, {645, 485}})}}))).size(),
            1u);
  EXPECT_THAT(InputErrorOf([&] {
                ReadDetections(Write(DetectionsToJson({{"a.png", DetectionOf({0}, {{645.5, 0}})}})));
              }),
              HasSubstr("detections.json: captures[0]: pixels[0]: lies outside of the image"));
}

TEST_F(DetectionFileTest, SchemaAndReasonMayBeMissing) {
  const auto captures =
      ReadDetections(Write(R"({"captures": [{"image": "a.png", "image_size": [9, 9], "ids": [], "pixels": []}]})"));
  EXPECT_EQ(captures.at(0).second.detection.reason, "");
}

TEST_F(DetectionFileTest, AnImageOfUnknownSizeHasNoOutside) {
  const auto captures = ReadDetections(
      Write(R"({"captures": [{"image": "a.png", "image_size": [0, 0], "ids": [0], "pixels": [[5000, 1]]}]})"));
  EXPECT_EQ(captures.at(0).second.detection.pixels.at(0), Eigen::Vector2d(5000, 1));
}

struct WrongFile {
  std::string name;
  std::string text;
  std::string message;
};

class WrongDetectionFileTest : public DetectionFileTest, public testing::WithParamInterface<WrongFile> {};

TEST_P(WrongDetectionFileTest, IsRefusedWithItsPosition) {
  EXPECT_THAT(InputErrorOf([&] { ReadDetections(Write(GetParam().text)); }),
              HasSubstr("detections.json: " + GetParam().message));
}

std::string OneCapture(const std::string& size, const std::string& ids, const std::string& pixels) {
  return R"({"captures": [{"image": "a.png", "image_size": )" + size + R"(, "ids": )" + ids + R"(, "pixels": )" +
         pixels + "}]}";
}

INSTANTIATE_TEST_SUITE_P(
    , WrongDetectionFileTest,
    testing::Values(WrongFile{"NotJson", "captures: []", "not valid JSON at byte 1"},
                    WrongFile{"OtherSchema", R"({"schema": "heba/detections/2", "captures": []})",
                              "has the schema 'heba/detections/2', not 'heba/detections/1'"},
                    WrongFile{"SchemaIsNoText", R"({"schema": 1, "captures": []})", "schema: a text is needed"},
                    WrongFile{"NoCaptures", "{}", "'captures' is missing"},
                    WrongFile{"CapturesAreNoList", R"({"captures": 1})", "captures: a list is needed"},
                    WrongFile{"NoIds", R"({"captures": [{"image": "a.png", "image_size": [1, 1], "pixels": []}]})",
                              "captures[0]: 'ids' is missing"},
                    WrongFile{"Size", OneCapture("[640]", "[]", "[]"),
                              "captures[0]: image_size: two whole numbers are needed: [width, height]"},
                    WrongFile{"HugeSize", OneCapture("[640, 1e9]", "[]", "[]"),
                              "captures[0]: image_size[1]: a whole number from 0 to 100000 is needed"},
                    WrongFile{"FractionalId", OneCapture("[640, 480]", "[0.5]", "[[1, 1]]"),
                              "captures[0]: ids[0]: a whole number from 0 to 1000000000 is needed"},
                    WrongFile{"Counts", OneCapture("[640, 480]", "[0, 1]", "[[1, 1]]"),
                              "captures[0]: 2 ids, but 1 pixels"},
                    WrongFile{"Pixel", OneCapture("[640, 480]", "[0]", "[[1, 1, 1]]"),
                              "captures[0]: pixels[0]: 2 numbers are needed, not 3"}),
    [](const auto& wrong) { return wrong.param.name; });

}  // namespace
}  // namespace heba
