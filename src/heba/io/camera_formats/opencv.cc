// OpenCV's cv::FileStorage in YAML or JSON. Each program chooses its own names for the values; those of OpenCV's
// samples and other usual names are known. A file does not state whether the lens is a fisheye lens, except for files
// of OpenCV's sample (fisheye_model) and files with ROS's distortion_model.
#include <array>

#include "heba/base/text.h"
#include "heba/io/camera_format.h"
#include "heba/io/file_storage.h"

namespace heba {
namespace {

const std::vector<std::string>& MatrixNames() {
  static const std::vector<std::string> names = {"camera_matrix",
                                                 "Camera_Matrix",
                                                 "cameraMatrix",
                                                 "CameraMatrix",
                                                 "intrinsic_matrix",
                                                 "K",
                                                 "M",
                                                 "M1",
                                                 "M2",
                                                 "K1",
                                                 "K2",
                                                 "cameraMatrix1",
                                                 "cameraMatrix2",
                                                 "mtx"};
  return names;
}

const std::vector<std::string>& DistortionNames() {
  static const std::vector<std::string> names = {"distortion_coefficients",
                                                 "Distortion_Coefficients",
                                                 "distortionCoefficients",
                                                 "distortion_coeffs",
                                                 "dist_coeffs",
                                                 "distCoeffs",
                                                 "DistCoeffs",
                                                 "dist_coeff",
                                                 "dist",
                                                 "D",
                                                 "D1",
                                                 "D2",
                                                 "distCoeffs1",
                                                 "distCoeffs2"};
  return names;
}

// Returns the value of the one key of `names` that exists. Throws InputError if there is none, or more than one.
ConfigValue FindOnly(MapReader& reader, const std::vector<std::string>& names, const std::string& what) {
  std::optional<ConfigValue> only;
  for (const std::string& name : names) {
    const std::optional<ConfigValue> found = reader.Find(name);
    if (!found) continue;
    if (only) {
      found->Fail("a second " + what + ", besides '" + only->key() + "'; write the intended one to a separate file");
    }
    only = found;
  }
  if (!only) reader.value().Fail("has no " + what + "; it may be called: " + Join(names, ", "));
  return *only;
}

// Returns the camera with the size of its images if the file contains it.
Camera WithImageSize(Camera camera, MapReader& reader) {
  constexpr IntRange kSizes = {1, 100000};
  for (const auto& [width, height] : {std::array{"image_width", "image_height"},
                                      std::array{"image_Width", "image_Height"}, std::array{"width", "height"}}) {
    if (!reader.Has(width)) continue;
    camera.width_px = reader.Int(width, kSizes);
    camera.height_px = reader.Int(height, kSizes);
    return camera;
  }
  for (const char* key : {"image_size", "imageSize", "ImageSize", "img_size", "resolution"}) {
    const std::optional<ConfigValue> size = reader.Find(key);
    if (!size) continue;
    const std::vector<double> numbers = ReadMatrix(*size);
    const bool valid = numbers.size() == 2 && numbers[0] >= kSizes.min && numbers[0] <= kSizes.max &&
                       numbers[1] >= kSizes.min && numbers[1] <= kSizes.max;
    if (!valid) size->Fail("two whole numbers are needed: [width, height]");
    camera.width_px = static_cast<int>(numbers[0]);
    camera.height_px = static_cast<int>(numbers[1]);
    if (camera.width_px != numbers[0] || camera.height_px != numbers[1]) size->Fail("whole numbers are needed");
    return camera;
  }
  return camera;
}

Lens ReadLens(MapReader& reader) {
  if (const std::optional<ConfigValue> model = reader.Find("distortion_model")) {
    const Outcome<Lens> lens = LensOfRosModel(model->AsText());
    if (!lens) model->Fail(lens.reason());
    return *lens;
  }
  return reader.Int("fisheye_model", {0, 1}, 0) == 1 ? Lens::kFisheye : Lens::kPolynomial;
}

Camera Read(const std::string& text, const std::filesystem::path& name) {
  const ConfigValue root = ParseFileStorage(text, name);
  MapReader reader(root);
  const ConfigValue matrix = FindOnly(reader, MatrixNames(), "camera matrix");
  const ConfigValue distortion = FindOnly(reader, DistortionNames(), "list of distortion coefficients");
  const Outcome<std::vector<double>> pinhole = PinholeFromMatrix(ReadMatrix(matrix));
  if (!pinhole) matrix.Fail(pinhole.reason());
  const Outcome<Camera> camera = CameraFromCoefficients(*pinhole, ReadMatrix(distortion), ReadLens(reader));
  if (!camera) distortion.Fail(camera.reason());
  return WithImageSize(*camera, reader);
}

}  // namespace

CameraReader CameraReader_opencv() { return {IsFileStorage, Read}; }

}  // namespace heba
