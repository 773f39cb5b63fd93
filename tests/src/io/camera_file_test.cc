#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/io/camera_file.h"
#include "heba/io/camera_format.h"
#include "heba/io/python_literal.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

Camera Parse(const std::string& text) { return ParseCameraFile(text, "camera"); }
std::string ErrorOf(const std::string& text) {
  return InputErrorOf([&] { Parse(text); });
}
// Returns `text` with the first occurrence of `from` replaced by `to`.
std::string With(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  CHECK(at != std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// Camera files in heba's own form.

const std::string kOwn =
    "# calibrated\n"
    "model: brown5\n"
    "image_size: [1280, 960]\n"
    "fx: 900.5\n"
    "fy: 901\n"
    "cx: 640\n"
    "cy: 480.25\n"
    "distortion: [-0.1, 0.01, 1e-4, -2e-4, 0]\n";

TEST(OwnCameraFile, Reads) {
  const Camera camera = Parse(kOwn);
  EXPECT_EQ(camera.model, "brown5");
  EXPECT_EQ(camera.width_px, 1280);
  EXPECT_EQ(camera.height_px, 960);
  EXPECT_THAT(camera.params, ElementsAre(900.5, 901, 640, 480.25, -0.1, 0.01, 1e-4, -2e-4, 0));
}

TEST(OwnCameraFile, ReadsTheCameraOfAResult) {
  const Camera camera = Parse(
      R"({"model": "pinhole", "image_size": [640, 480], "fx": 500, "fy": 501.5, "cx": 320, "cy": 240,
          "distortion": [], "std": {"fx": 0.1, "fy": 0.1}})");
  EXPECT_EQ(camera.model, "pinhole");
  EXPECT_THAT(camera.params, ElementsAre(500, 501.5, 320, 240));
  EXPECT_EQ(Parse(R"({"model": "pinhole", "image_size": [640, 480], "fx": 5e2, "fy": 501.5, "cx": 320, "cy": 240,
                      "distortion": [], "std": null})")
                .params[0],
            500);
  // The empty list of distortion coefficients may be omitted.
  EXPECT_EQ(Parse("{model: pinhole, image_size: [640, 480], fx: 500, fy: 500, cx: 320, cy: 240}").params.size(), 4u);
}

TEST(OwnCameraFile, WritesWhatItReads) {
  Rng rng(1);
  for (const CameraModel* model : CameraModels()) {
    Camera camera = {std::string(model->name()), 1920, 1080, {}};
    for (int i = 0; i < NumParams(*model); ++i) camera.params.push_back(i < 4 ? rng.Uniform(100, 2000) : rng.Normal());
    const Camera read = Parse(CameraToYaml(camera));
    EXPECT_EQ(read.model, camera.model);
    EXPECT_EQ(read.width_px, 1920);
    EXPECT_EQ(read.height_px, 1080);
    EXPECT_EQ(read.params, camera.params);
  }
}

TEST(OwnCameraFile, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf(With(kOwn, "brown5", "brown")),
              HasSubstr("camera:2: model: 'brown' is unknown; did you mean 'brown4'? One of: pinhole, brown4, brown5"));
  EXPECT_THAT(ErrorOf(With(kOwn, "model", "modle")), HasSubstr("'model' is missing"));
  EXPECT_THAT(ErrorOf(With(kOwn, "cx: 640\n", "")), HasSubstr("camera:2: 'cx' is missing"));
  EXPECT_THAT(ErrorOf(kOwn + "k1: 3\n"), HasSubstr("camera:9: unknown key 'k1'"));
  EXPECT_THAT(ErrorOf(With(kOwn, "900.5", "900 px")), HasSubstr("camera:4: fx: a number is needed"));
  EXPECT_THAT(ErrorOf(With(kOwn, "900.5", "-900")), HasSubstr("fx and fy must be positive"));
  EXPECT_THAT(ErrorOf(With(kOwn, "900.5", "nan")), HasSubstr("camera:4: fx: 'nan' is not finite"));
  EXPECT_THAT(ErrorOf(With(kOwn, ", 0]", "]")),
              HasSubstr("camera:8: distortion: 4 coefficients; brown5 has 5: k1, k2, p1, p2, k3"));
  EXPECT_THAT(ErrorOf(With(kOwn, "[1280, 960]", "[1280]")), HasSubstr("camera:3: image_size: two whole numbers"));
  EXPECT_THAT(ErrorOf(With(kOwn, "960", "0")), HasSubstr("0 is out of range"));
  EXPECT_THAT(ErrorOf("width: 3\n"), HasSubstr("contains no camera in a format that heba reads; one of: OpenCV"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("contains no camera"));
}

// Camera files of ROS (camera_info).

const std::string kRos =
    "image_width: 640\n"
    "image_height: 480\n"
    "camera_name: narrow_stereo\n"
    "camera_matrix:\n"
    "  rows: 3\n"
    "  cols: 3\n"
    "  data: [500.5, 0., 320.25,\n"
    "         0., 501., 240.75,\n"
    "         0., 0., 1.]\n"
    "distortion_model: plumb_bob\n"
    "distortion_coefficients:\n"
    "  rows: 1\n"
    "  cols: 5\n"
    "  data: [0.1, -0.2, 0.001, -0.002, 0.3]\n"
    "rectification_matrix:\n"
    "  rows: 3\n"
    "  cols: 3\n"
    "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
    "projection_matrix:\n"
    "  rows: 3\n"
    "  cols: 4\n"
    "  data: [510, 0, 320, 0, 0, 511, 240, 0, 0, 0, 1, 0]\n";
// Returns the same file with another distortion model and other coefficients.
std::string Ros(const std::string& model, int num_coefficients, const std::string& coefficients) {
  std::string text = With(kRos, "plumb_bob", model);
  text = With(text, "cols: 5", "cols: " + std::to_string(num_coefficients));
  return With(text, "0.1, -0.2, 0.001, -0.002, 0.3", coefficients);
}

TEST(RosCameraFile, Reads) {
  const Camera camera = Parse(kRos);
  EXPECT_EQ(camera.model, "brown5");
  EXPECT_EQ(camera.width_px, 640);
  EXPECT_EQ(camera.height_px, 480);
  EXPECT_THAT(camera.params, ElementsAre(500.5, 501, 320.25, 240.75, 0.1, -0.2, 0.001, -0.002, 0.3));
}

TEST(RosCameraFile, ReadsEveryDistortionModel) {
  EXPECT_THAT(Parse(Ros("plumb_bob", 4, "0.1, 0.2, 0.3, 0.4")).params,
              ElementsAre(500.5, 501, 320.25, 240.75, 0.1, 0.2, 0.3, 0.4, 0));
  EXPECT_EQ(Parse(Ros("plumb_bob", 0, "")).model, "pinhole");
  EXPECT_EQ(Parse(Ros("\"\"", 0, "")).model, "pinhole");
  const Camera rational = Parse(Ros("rational_polynomial", 8, "1, 2, 3, 4, 5, 6, 7, 8"));
  EXPECT_EQ(rational.model, "rational8");
  EXPECT_THAT(rational.params, ElementsAre(500.5, 501, 320.25, 240.75, 1, 2, 3, 4, 5, 6, 7, 8));
  const Camera fisheye = Parse(Ros("equidistant", 4, "0.1, 0.2, 0.3, 0.4"));
  EXPECT_EQ(fisheye.model, "kannala_brandt4");
  EXPECT_THAT(fisheye.params, ElementsAre(500.5, 501, 320.25, 240.75, 0.1, 0.2, 0.3, 0.4));
  // A missing distortion_model means plumb_bob, as in ROS.
  EXPECT_EQ(Parse(With(kRos, "distortion_model: plumb_bob\n", "")).model, "brown5");
}

TEST(RosCameraFile, ReadsTheMessageAsPrinted) {
  const std::string echoed =
      "header:\n  frame_id: camera\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n"
      "d:\n- 0.1\n- 0.2\n- 0.3\n- 0.4\n- 0.5\n"
      "k:\n- 500.5\n- 0.0\n- 320.25\n- 0.0\n- 501.0\n- 240.75\n- 0.0\n- 0.0\n- 1.0\n---\n";
  const Camera camera = Parse(echoed);
  EXPECT_THAT(camera.params, ElementsAre(500.5, 501, 320.25, 240.75, 0.1, 0.2, 0.3, 0.4, 0.5));
  EXPECT_EQ(camera.width_px, 640);
  const Camera ros1 = Parse(
      "height: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\nD: [0.1, 0.2, 0.3, 0.4, 0.5]\n"
      "K: [500.5, 0.0, 320.25, 0.0, 501.0, 240.75, 0.0, 0.0, 1.0]\n");
  EXPECT_EQ(ros1.params, camera.params);
}

TEST(RosCameraFile, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf(Ros("plum_bob", 5, "1, 2, 3, 4, 5")),
              HasSubstr("camera:10: distortion_model: distortion model 'plum_bob' is unknown; "
                        "did you mean 'plumb_bob'? One of: plumb_bob, rational_polynomial, equidistant"));
  EXPECT_THAT(ErrorOf(Ros("plumb_bob", 3, "1, 2, 3")),
              HasSubstr("distortion_coefficients: 3 coefficients; 0, 4, 5 or 8"));
  EXPECT_THAT(ErrorOf(Ros("equidistant", 0, "")), HasSubstr("0 coefficients; a fisheye lens has 4"));
  EXPECT_THAT(ErrorOf(Ros("plumb_bob", 4, "1, 2, 3, 4, 5")),
              HasSubstr("camera:14: distortion_coefficients.data: 5 numbers, but a matrix of 1 x 4 has 4"));
  EXPECT_THAT(ErrorOf(With(kRos, "[500.5, 0.,", "[500.5, 0.7,")),
              HasSubstr("camera_matrix: the camera matrix has a skew of 0.7"));
  EXPECT_THAT(ErrorOf(With(kRos, "0., 0., 1.", "0., 0., 0.")), HasSubstr("not [fx 0 cx; 0 fy cy; 0 0 1]"));
  EXPECT_THAT(ErrorOf(With(kRos, "image_width: 640\n", "")), HasSubstr("'image_width' is missing"));
  EXPECT_THAT(ErrorOf(With(kRos, "distortion_coefficients", "distortion_coefficents")),
              HasSubstr("'distortion_coefficients' is missing"));
  EXPECT_THAT(ErrorOf(With(kRos, "500.5", ".nan")),
              HasSubstr("camera:7: camera_matrix.data[0]: a number is needed, not '.nan'"));
}

// Camera files of OpenCV.

const std::string kOpenCv =
    "%YAML:1.0\n"
    "---\n"
    "calibration_time: \"Thu Sep 23 23:42:14 2021\"\n"
    "image_width: 640\n"
    "image_height: 480\n"
    "flags: 0\n"
    "camera_matrix: !!opencv-matrix\n"
    "   rows: 3\n"
    "   cols: 3\n"
    "   dt: d\n"
    "   data: [ 5.005e+02, 0., 3.2025e+02, 0., 5.01e+02, 2.4075e+02, 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n"
    "   rows: 5\n"
    "   cols: 1\n"
    "   dt: d\n"
    "   data: [ 1., 2., 3., 4., 5. ]\n"
    "avg_reprojection_error: 3.3e-01\n";
std::string OpenCv(int num_coefficients, const std::string& coefficients) {
  return With(With(kOpenCv, "rows: 5", "rows: " + std::to_string(num_coefficients)), "1., 2., 3., 4., 5.",
              coefficients);
}

TEST(OpenCvCameraFile, Reads) {
  for (const std::string& text :
       {kOpenCv, With(kOpenCv, "---\n", ""), "\xEF\xBB\xBF" + kOpenCv, With(kOpenCv, "%YAML:1.0\n", "%YAML 1.0\n")}) {
    const Camera camera = Parse(text);
    EXPECT_EQ(camera.model, "brown5");
    EXPECT_EQ(camera.width_px, 640);
    EXPECT_EQ(camera.height_px, 480);
    EXPECT_THAT(camera.params, ElementsAre(500.5, 501, 320.25, 240.75, 1, 2, 3, 4, 5));
  }
}

TEST(OpenCvCameraFile, ReadsOtherNumbersOfCoefficients) {
  EXPECT_THAT(Parse(OpenCv(4, "1, 2, 3, 4")).params, ElementsAre(500.5, 501, 320.25, 240.75, 1, 2, 3, 4, 0));
  EXPECT_EQ(Parse(OpenCv(8, "1, 2, 3, 4, 5, 6, 7, 8")).model, "rational8");
  const Camera extended = Parse(OpenCv(14, "1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0., 0, 0, 0"));
  EXPECT_EQ(extended.model, "rational8");
  EXPECT_THAT(extended.params, ElementsAre(500.5, 501, 320.25, 240.75, 1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_THAT(ErrorOf(OpenCv(12, "1, 2, 3, 4, 5, 6, 7, 8, 0, 0.1, 0, 0")),
              HasSubstr("after the eighth (thin prism, tilt) are not zero"));
  EXPECT_EQ(Parse(OpenCv(4, "1, 2, 3, 4") + "fisheye_model: 1\n").model, "kannala_brandt4");
  EXPECT_EQ(Parse(OpenCv(4, "1, 2, 3, 4") + "distortion_model: equidistant\n").model, "kannala_brandt4");
}

TEST(OpenCvCameraFile, ReadsTheUsualNames) {
  std::string named = With(With(kOpenCv, "camera_matrix", "cameraMatrix"), "distortion_coefficients", "distCoeffs");
  named = With(With(named, "image_width: 640\n", "imageSize: [ 640, 480 ]\n"), "image_height: 480\n", "");
  EXPECT_EQ(Parse(named).params[0], 500.5);
  EXPECT_EQ(Parse(named).height_px, 480);
  named = With(With(kOpenCv, "camera_matrix", "K"), "distortion_coefficients", "D");
  EXPECT_EQ(Parse(named).params[4], 1);
  named = With(With(kOpenCv, "camera_matrix", "Camera_Matrix"), "distortion_coefficients", "Distortion_Coefficients");
  named = With(With(named, "image_width", "image_Width"), "image_height", "image_Height");
  EXPECT_EQ(Parse(named).width_px, 640);
}

TEST(OpenCvCameraFile, ReadsJson) {
  const Camera camera = Parse(
      R"({ "camera_matrix": { "type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
           "data": [ 500.5, 0.0, 320.25, 0.0, 501.0, 240.75, 0.0, 0.0, 1.0 ] },
           "dist_coeffs": { "type_id": "opencv-matrix", "rows": 1, "cols": 4, "dt": "d", "data": [ 1.0, 2.0, 3.0, 4.0 ] } })");
  EXPECT_THAT(camera.params, ElementsAre(500.5, 501, 320.25, 240.75, 1, 2, 3, 4, 0));
}

TEST(OpenCvCameraFile, ImageSizeIsZeroIfMissing) {
  const Camera camera = Parse(With(With(kOpenCv, "image_width: 640\n", ""), "image_height: 480\n", ""));
  EXPECT_EQ(camera.width_px, 0);
  EXPECT_EQ(camera.height_px, 0);
  EXPECT_EQ(camera.params[0], 500.5);
}

TEST(OpenCvCameraFile, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf(With(kOpenCv, "camera_matrix", "matrix")),
              HasSubstr("has no camera matrix; it may be called: camera_matrix"));
  EXPECT_THAT(ErrorOf(With(kOpenCv, "distortion_coefficients", "lens")),
              HasSubstr("has no list of distortion coefficients"));
  EXPECT_THAT(ErrorOf(kOpenCv + "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"),
              HasSubstr("camera:18: K: a second camera matrix, besides 'camera_matrix'"));
  EXPECT_THAT(ErrorOf(With(kOpenCv, "5.005e+02, 0.,", "5.005e+02, 1.5,")), HasSubstr("skew of 1.5"));
  EXPECT_THAT(ErrorOf(With(kOpenCv, "5.005e+02", ".Nan")),
              HasSubstr("camera:11: camera_matrix.data[0]: a number is needed"));
  EXPECT_THAT(ErrorOf(With(kOpenCv, "5.005e+02", "0.")), HasSubstr("fx and fy must be positive"));
  EXPECT_THAT(ErrorOf(With(kOpenCv, "image_height: 480\n", "")), HasSubstr("'image_height' is missing"));
  EXPECT_THAT(ErrorOf("<?xml version=\"1.0\"?>\n<opencv_storage>\n</opencv_storage>\n"),
              HasSubstr("is XML, which heba does not read; save it as .yml"));
}

// Camera models of mrcal.

const std::string kMrcal =
    "# generated on 2020-11-17 with /usr/bin/mrcal-calibrate-cameras\n"
    "#\n"
    "{\n"
    "    'lensmodel':  'LENSMODEL_OPENCV8',\n"
    "\n"
    "    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n"
    "    'intrinsics': [ 1761.181055,\n 1761.25, 1965.5, 1087.5,  # comment: with 'quotes'\n"
    "                    -0.01, 0.03, -3e-4, .0002, 0.01, 0.2, 0.1, 0.02,],\n"
    "    'valid_intrinsics_region': [ [ 10, 20 ], [ 30, 40 ], ],\n"
    "    'extrinsics': ( 0.1, -2, 3., 0, 0, 0, ),\n"
    "    'imagersize': [ 4000, 2200,],\n"
    "    'icam_intrinsics': 0,\n"
    "    'optimization_inputs': b'LRx4!F+o`-Q(3v\"6&W}[{(#\\'x\\\\',\n"
    "}\n";
std::string Mrcal(const std::string& model, const std::string& coefficients) {
  return With(With(kMrcal, "LENSMODEL_OPENCV8", model), "-0.01, 0.03, -3e-4, .0002, 0.01, 0.2, 0.1, 0.02,",
              coefficients);
}

TEST(MrcalCameraFile, Reads) {
  const Camera camera = Parse(kMrcal);
  EXPECT_EQ(camera.model, "rational8");
  EXPECT_EQ(camera.width_px, 4000);
  EXPECT_EQ(camera.height_px, 2200);
  EXPECT_THAT(camera.params,
              ElementsAre(1761.181055, 1761.25, 1965.5, 1087.5, -0.01, 0.03, -3e-4, 2e-4, 0.01, 0.2, 0.1, 0.02));
}

TEST(MrcalCameraFile, ReadsSupportedModels) {
  EXPECT_EQ(Parse(Mrcal("LENSMODEL_PINHOLE", "")).model, "pinhole");
  EXPECT_THAT(Parse(Mrcal("LENSMODEL_OPENCV4", "1, 2, 3, 4")).params,
              ElementsAre(1761.181055, 1761.25, 1965.5, 1087.5, 1, 2, 3, 4, 0));
  EXPECT_THAT(Parse(Mrcal("LENSMODEL_OPENCV5", "1, 2, 3, 4, 5")).params,
              ElementsAre(1761.181055, 1761.25, 1965.5, 1087.5, 1, 2, 3, 4, 5));
  EXPECT_EQ(Parse(Mrcal("LENSMODEL_OPENCV12", "1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0")).model, "rational8");
}

TEST(MrcalCameraFile, SkipsLongBinaryStrings) {
  const Camera camera = Parse(With(kMrcal, "LRx4", std::string(5 << 20, '#')));
  EXPECT_EQ(camera.model, "rational8");
}

TEST(MrcalCameraFile, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf(Mrcal("LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=18_fov_x_deg=150", "1")),
              HasSubstr("camera:4: lensmodel 'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=18_fov_x_de...' "
                        "is not supported; "
                        "one of: LENSMODEL_PINHOLE, LENSMODEL_OPENCV4"));
  EXPECT_THAT(ErrorOf(Mrcal("LENSMODEL_OPENCV8", "1, 2")),
              HasSubstr("camera:7: intrinsics: 6 numbers; LENSMODEL_OPENCV8 has 12"));
  EXPECT_THAT(ErrorOf(Mrcal("LENSMODEL_OPENCV12", "1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 9, 0")),
              HasSubstr("after the eighth"));
  EXPECT_THAT(ErrorOf(With(kMrcal, "4000, 2200,", "4000")), HasSubstr("camera:12: imagersize: [width, height]"));
  EXPECT_THAT(ErrorOf(With(kMrcal, "'imagersize'", "'imager_size'")), HasSubstr("'imagersize' is missing"));
  EXPECT_THAT(ErrorOf(With(kMrcal, "1761.25", "'x'")), HasSubstr("camera:8: intrinsics: finite numbers are needed"));
  EXPECT_THAT(ErrorOf(With(kMrcal, "1761.25", "inf")), HasSubstr("intrinsics: finite numbers are needed"));
  EXPECT_THAT(ErrorOf(With(kMrcal, "1761.25", "-1")), HasSubstr("fx and fy must be positive"));
}

// The reader of Python literals, which camera models of mrcal are.

TEST(PythonLiteral, ReadsEveryKind) {
  const PythonValue value = ParsePythonLiteral(
      "{'a': [1, -2.5e3, +.5,], \"b\": (None, True), 'c': r'x\\n' \"y'\", 'd': {}, 'e': '''z'\n'''}", "f");
  EXPECT_EQ(value.keys.size(), 5u);
  EXPECT_EQ(value.Find("a")->items[1].number, -2500);
  EXPECT_EQ(value.Find("a")->items[2].number, 0.5);
  EXPECT_EQ(value.Find("b")->items[0].text, "None");
  EXPECT_EQ(value.Find("c")->text, "x\\ny'");
  EXPECT_EQ(value.Find("d")->kind, PythonValue::Kind::kDict);
  EXPECT_EQ(value.Find("e")->text, "z'\n");
  EXPECT_EQ(value.Find("f"), nullptr);
}

TEST(PythonLiteral, FaultsNameTheLine) {
  const auto error = [](const std::string& text) { return InputErrorOf([&] { ParsePythonLiteral(text, "f"); }); };
  EXPECT_EQ(error("{'a': 1,\n 'b' 2}"), "f:2: ':' is needed after a key");
  EXPECT_EQ(error("{'a': 1 'b': 2}"), "f:1: ',' or '}' is needed");
  EXPECT_EQ(error("[1 2]"), "f:1: ',' or ']' is needed");
  EXPECT_EQ(error("{'a': 1,\n'a': 2}"), "f:2: 'a' occurs twice");
  EXPECT_EQ(error("{1: 2}"), "f:1: a key in quotes is needed");
  EXPECT_EQ(error("{'a': \n"), "f:2: the file ends too early");
  EXPECT_EQ(error("'abc"), "f:1: a quote is not closed");
  EXPECT_EQ(error("'abc\n'"), "f:1: a quote is not closed");
  EXPECT_EQ(error("'abc\\"), "f:1: a quote is not closed");
  EXPECT_EQ(error("array([1])"), "f:1: 'array' is not a value");
  EXPECT_EQ(error("{} {}"), "f:1: unexpected text after the closing bracket");
  EXPECT_EQ(error(std::string(100000, '[')), "f:1: nested deeper than 32 levels");
}

// Files of any form.

TEST(CameraFile, HasKeyFindsKeysOnly) {
  EXPECT_TRUE(HasKey("a: 1\nmodel: x", "model"));
  EXPECT_TRUE(HasKey("{\"model\" : 1}", "model"));
  EXPECT_TRUE(HasKey("{'model': 1}", "model"));
  EXPECT_FALSE(HasKey("camera_model: x", "model"));
  EXPECT_FALSE(HasKey("models: x", "model"));
  EXPECT_FALSE(HasKey("text: model", "model"));
}

TEST(CameraFile, ReadsFiles) {
  const TempFolder folder;
  std::ofstream(folder / "camera.yaml") << kOwn;
  EXPECT_EQ(ReadCameraFile(folder / "camera.yaml").params[0], 900.5);
  EXPECT_THAT(InputErrorOf([&] { ReadCameraFile(folder / "none.yaml"); }),
              HasSubstr("none.yaml: there is no such file"));
  EXPECT_THAT(InputErrorOf([&] { ReadCameraFile(folder.path()); }), HasSubstr("this is a folder"));
}

// Any sequence of bytes gives either a camera or an InputError whose message is one line.
TEST(CameraFile, AnyTextGivesACameraOrAnInputError) {
  Rng rng(2);
  int num_valid = 0;
  constexpr int kCount = 8000;
  for (int i = 0; i < kCount; ++i) {
    const std::string* const sources[] = {&kOwn, &kRos, &kOpenCv, &kMrcal};
    std::string text = *sources[i % 4];
    for (int k = 0; k <= rng.Index(3); ++k) {
      const size_t at = static_cast<size_t>(rng.Index(static_cast<int>(text.size())));
      const char c = rng.Uniform() < 0.7 ? ":{}[]'\",#&*!-\n 0."[rng.Index(17)] : static_cast<char>(rng.Index(256));
      const double kind = rng.Uniform();
      if (kind < 0.4) {
        text[at] = c;
      } else if (kind < 0.8) {
        text.insert(at, 1, c);
      } else {
        text.erase(at, static_cast<size_t>(rng.Index(30)));
      }
    }
    try {
      const Camera camera = Parse(text);
      Camera checked = camera;
      if (camera.width_px == 0) checked.width_px = checked.height_px = 1;
      EXPECT_EQ(CheckCamera(checked), "");
      ++num_valid;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), StartsWith("camera:"));
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n"))) << text;
    }
  }
  // Changes in comments and in skipped keys keep a file valid; changes of brackets do not.
  EXPECT_GT(num_valid, kCount / 20);
  EXPECT_LT(num_valid, kCount * 19 / 20);
}

// Kalibr's camchain.

std::string Kalibr(const std::string& camera_model, const std::string& intrinsics,
                   const std::string& distortion_model = "none", const std::string& coefficients = "") {
  return "cam0:\n  camera_model: " + camera_model + "\n  intrinsics: [" + intrinsics +
         "]\n  distortion_model: " + distortion_model + "\n  distortion_coeffs: [" + coefficients +
         "]\n  resolution: [640, 480]\n";
}

// Kalibr writes the coefficients of the projection before the focal lengths.
TEST(KalibrCameraFile, ReadsTheUnifiedModels) {
  const Camera sphere = Parse(Kalibr("ds", "-0.2, 0.6, 300, 301, 320, 240"));
  EXPECT_EQ(sphere.model, "double_sphere");
  EXPECT_EQ(sphere.width_px, 640);
  EXPECT_THAT(sphere.params, ElementsAre(300, 301, 320, 240, -0.2, 0.6));
  const Camera enhanced = Parse(Kalibr("eucm", "0.6, 1.1, 300, 301, 320, 240"));
  EXPECT_EQ(enhanced.model, "eucm");
  EXPECT_THAT(enhanced.params, ElementsAre(300, 301, 320, 240, 0.6, 1.1));
  const Camera omni = Parse(Kalibr("omni", "1.1, 300, 301, 320, 240", "radtan", "0.1, 0.2, 0.3, 0.4"));
  EXPECT_EQ(omni.model, "omni");
  EXPECT_THAT(omni.params, ElementsAre(300, 301, 320, 240, 1.1, 0.1, 0.2, 0.3, 0.4));
  EXPECT_THAT(Parse(Kalibr("omni", "1.1, 300, 301, 320, 240")).params,
              ElementsAre(300, 301, 320, 240, 1.1, 0, 0, 0, 0));
}

TEST(KalibrCameraFile, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf(Kalibr("ds", "300, 301, 320, 240")), HasSubstr("6 numbers are needed: [xi, alpha, fu, fv"));
  EXPECT_THAT(ErrorOf(Kalibr("omni", "1.1, 300, 301, 320, 240", "radtan", "0.1")),
              HasSubstr("1 coefficients; omni with radtan has 4"));
  EXPECT_THAT(ErrorOf(Kalibr("eucm", "0.6, 1.1, 300, 301, 320, 240", "radtan", "0, 0, 0, 0")),
              HasSubstr("eucm with distortion_model radtan is not supported"));
  EXPECT_THAT(ErrorOf(Kalibr("scaramuzza", "300, 301, 320, 240")), HasSubstr("one of: pinhole, ds, eucm, omni"));
}

// A chain of two cameras; the second is a fisheye camera.
std::string Chain() {
  const std::string second = Kalibr("pinhole", "500, 501, 320, 240", "equidistant", "0.1, 0, 0, 0");
  return Kalibr("pinhole", "300, 301, 320, 240", "radtan", "-0.1, 0.02, 0.001, 0.002") +
         "cam1:" + second.substr(second.find(':') + 1) +
         "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.11]\n  - [0.0, 1.0, 0.0, 0.002]\n  - [0.0, 0.0, 1.0, 0.0]\n"
         "  - [0.0, 0.0, 0.0, 1.0]\n";
}

TEST(KalibrCameraFile, ReadsTheCameraOfAChainThatIsNamed) {
  EXPECT_EQ(ParseCameraFile(Chain(), "camera", "cam0").model, "brown4") << "radtan has no k3";
  const Camera second = ParseCameraFile(Chain(), "camera", "cam1");
  EXPECT_EQ(second.model, "kannala_brandt4");
  EXPECT_THAT(second.params, ElementsAre(500, 501, 320, 240, 0.1, 0, 0, 0));
  // A fault of another camera does not matter.
  const std::string faulty = With(Chain(), "intrinsics: [300, 301, 320, 240]", "intrinsics: [300]");
  EXPECT_EQ(ParseCameraFile(faulty, "camera", "cam1").params, second.params);
  EXPECT_EQ(ParseCameraFile(Kalibr("ds", "-0.2, 0.6, 300, 301, 320, 240"), "camera", "cam0").model, "double_sphere");
}

TEST(KalibrCameraFile, NamesTheCamerasOfAChain) {
  EXPECT_THAT(ErrorOf(Chain()), HasSubstr("several cameras, cam0, cam1; state the one"));
  const auto error_of = [](const std::string& text, const std::string& camera) {
    return InputErrorOf([&] { ParseCameraFile(text, "camera", camera); });
  };
  EXPECT_THAT(error_of(Chain(), "cam2"), HasSubstr("'cam2' is unknown; did you mean 'cam0'? One of: cam0, cam1"));
  EXPECT_THAT(error_of(kOwn, "cam0"), HasSubstr("one camera without a name"));
  const std::string alone =
      "intrinsics: [300, 301, 320, 240]\ndistortion_model: radtan\n"
      "distortion_coeffs: [0, 0, 0, 0]\nresolution: [640, 480]\n";
  EXPECT_EQ(Parse(alone).params[0], 300);
  EXPECT_THAT(error_of(alone, "cam0"), HasSubstr("its camera has no name"));
}

// Returns the intrinsics of a camera in the form that librealsense reports, within a record.
std::string RealSense(const std::string& model, const std::string& coefficients) {
  return R"({"device": "D435", "intrinsics": {"width": 640, "height": 480, "fx": 605.5, "fy": 605, "ppx": 320.5,
             "ppy": 241, "model": ")" +
         model + R"(", "coeffs": [)" + coefficients + "]}}";
}

TEST(RealSenseCameraFile, ReadsIntrinsicsWithinRecords) {
  const Camera camera = Parse(RealSense("Brown Conrady", "0.1, -0.2, 1e-3, 2e-3, 0.05"));
  EXPECT_EQ(camera.model, "brown5");
  EXPECT_EQ(camera.width_px, 640);
  EXPECT_THAT(camera.params, ElementsAre(605.5, 605, 320.5, 241, 0.1, -0.2, 1e-3, 2e-3, 0.05));
  // Without coefficients, the name of the model does not matter.
  EXPECT_EQ(Parse(RealSense("distortion.inverse_brown_conrady", "0, 0, 0, 0, 0")).model, "pinhole");
}

// The same letters stand for another map there.
TEST(RealSenseCameraFile, RefusesTheInverseModel) {
  EXPECT_THAT(ErrorOf(RealSense("distortion.inverse_brown_conrady", "0.1, -0.2, 0, 0, 0")),
              HasSubstr("'inverse_brown_conrady' maps pixels to rays, not rays to pixels as brown5 does"));
}

TEST(ZividCameraFile, Reads) {
  const Camera camera = Parse(
      "__version__: 3\nCameraIntrinsics:\n  CameraMatrix:\n    CX: 957.25\n    CY: 599.5\n    FX: 1776\n    FY: 1775\n"
      "  Distortion:\n    K1: -0.1\n    K2: 0.2\n    K3: 0.3\n    P1: 1e-3\n    P2: 2e-3\n");
  EXPECT_EQ(camera.model, "brown5");
  EXPECT_EQ(camera.width_px, 0);
  EXPECT_THAT(camera.params, ElementsAre(1776, 1775, 957.25, 599.5, -0.1, 0.2, 1e-3, 2e-3, 0.3));
}

TEST(RosCameraFile, ReadsTheMessageUnderAKey) {
  const Camera camera = Parse(
      R"({"stamp": 1, "camera_info": {"width": 640, "height": 480, "distortion_model": "plumb_bob", "D": [],
          "K": [600, 0, 320, 0, 601, 240, 0, 0, 1]}})");
  EXPECT_EQ(camera.model, "pinhole");
  EXPECT_THAT(camera.params, ElementsAre(600, 601, 320, 240));
}

}  // namespace
}  // namespace heba
