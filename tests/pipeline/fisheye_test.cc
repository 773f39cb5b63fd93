// Simulates and calibrates fisheye lenses of every fisheye model with the program, from rendered images, with a camera
// of which the config gives nothing but the model.
#include <cmath>
#include <ostream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/camera/camera.h"
#include "heba/io/camera_file.h"
#include "tests/pipeline/cli.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;

constexpr int kWidthPx = 1280;
constexpr int kHeightPx = 960;

struct Fisheye {
  std::string model;
  std::vector<double> distortion;
  int view_deg;  // Horizontal field of view.
  double distance_mm;
};
void PrintTo(const Fisheye& lens, std::ostream* stream) { *stream << lens.model << "_" << lens.view_deg; }

std::vector<Fisheye> Fisheyes() {
  std::vector<Fisheye> lenses;
  for (const int view_deg : {120, 200}) {
    const double distance_mm = view_deg == 200 ? 150 : 220;
    lenses.push_back({"kannala_brandt4", {-0.02, 0.004, -0.002, 0.0003}, view_deg, distance_mm});
    lenses.push_back({"double_sphere", {-0.17, 0.59}, view_deg, distance_mm});
    lenses.push_back({"eucm", {0.58, 1.1}, view_deg, distance_mm});
    lenses.push_back({"omni", {1.1, -0.03, 0.004, 0.0004, -0.0003}, view_deg, distance_mm});
  }
  return lenses;
}

// Returns the camera whose image is as wide as the field of view.
Camera CameraOf(const Fisheye& lens) {
  Camera camera{lens.model, kWidthPx, kHeightPx, {1, 1, 0, 0}};
  camera.params.insert(camera.params.end(), lens.distortion.begin(), lens.distortion.end());
  const double angle_rad = DegToRad(0.5 * lens.view_deg);
  const double focal_px = 0.5 * kWidthPx / ProjectPoint(camera, {std::sin(angle_rad), 0, std::cos(angle_rad)})->x();
  camera.params[0] = focal_px;
  camera.params[1] = 1.001 * focal_px;
  camera.params[2] = 648.2;
  camera.params[3] = 473.9;
  return camera;
}

class FisheyeTest : public testing::TestWithParam<Fisheye> {
 protected:
  std::string Path(const std::string& name) const { return (folder_.path() / name).string(); }

 private:
  TempFolder folder_;
};

// The images are noisy, blurred and cluttered; the robot is exact.
TEST_P(FisheyeTest, IsCalibratedFromImages) {
  const Fisheye& lens = GetParam();
  const Camera camera = CameraOf(lens);
  const fs::path data = Path("data");
  std::vector<std::string> distortion;
  for (const double coefficient : lens.distortion) distortion.push_back(RoundTrip(coefficient));
  WriteAll(Path("scene.yaml"),
           "setup: eye_to_hand\n"
           "target: {type: coded_board, rows: 5, columns: 6, spacing: 30 mm, dot_diameter: 9 mm}\n"
           "camera: {model: " +
               lens.model + ", image_size: [1280, 960], fx: " + RoundTrip(camera.params[0]) + ", fy: " +
               RoundTrip(camera.params[1]) + ", cx: 648.2, cy: 473.9, distortion: [" + Join(distortion, ", ") +
               "]}\n"
               "hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}\n"
               "board: {translation: [-75 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}\n"
               "motion: {captures: 30, distance: " +
               RoundTrip(lens.distance_mm) +
               " mm, depth: 0.3, tilt: 35 deg, spin: 60 deg, spread: 0.75}\n"
               "image: {blur: 0.7 px, noise: 2 grey, uneven_light: 0.3, clutter: true}\n"
               "give_camera: false\nseed: 7\n");
  ASSERT_EQ(RunHeba({"simulate", Path("scene.yaml"), "--out", data.string(), "--quiet"}).status, 0);
  ASSERT_THAT(ReadAll(data / "config.yaml"), HasSubstr("model: " + lens.model));
  const CommandResult run = RunHeba({"run", (data / "config.yaml").string(), "--out", Path("run"), "--quiet"});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json result = Json::parse(ReadAll(Path("run") + "/result.json"));
  const Json& bundle = result["estimates"].back();
  ASSERT_EQ(bundle["method"], "bundle");
  EXPECT_GE(result["captures"].size(), 30u);
  // One sigma of the position is 1 um or less.
  EXPECT_LT(bundle["errors"]["truth"]["hand_eye_mm"].get<double>(), 0.005);
  EXPECT_LT(bundle["errors"]["truth"]["hand_eye_deg"].get<double>(), 0.001);

  // The camera survives the way through Kalibr's file; OpenCV, ROS and mrcal refuse what they do not have.
  const CommandResult kalibr = RunHeba({"export", Path("run"), "--to", "kalibr"});
  ASSERT_EQ(kalibr.status, 0) << kalibr.err;
  EXPECT_EQ(ParseCameraFile(kalibr.out, "kalibr").model, lens.model);
  const bool is_of_opencv = OpenCvLensOf(camera).has_value();
  for (const std::string form : {"opencv", "camera_info"}) {
    const CommandResult exported = RunHeba({"export", Path("run"), "--to", form});
    EXPECT_EQ(exported.status == 0, is_of_opencv) << form;
    if (!is_of_opencv) {
      EXPECT_THAT(exported.err, HasSubstr("no equivalent of the camera model " + lens.model));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Models, FisheyeTest, testing::ValuesIn(Fisheyes()),
                         [](const auto& test) { return test.param.model + "_" + std::to_string(test.param.view_deg); });

}  // namespace
}  // namespace heba
