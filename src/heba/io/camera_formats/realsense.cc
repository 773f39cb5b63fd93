// The intrinsics of librealsense as its users write them: width, height, fx, fy, ppx, ppy, model and coeffs, in JSON or
// YAML, also within other records.
#include <algorithm>

#include "heba/base/text.h"
#include "heba/io/camera_format.h"

namespace heba {
namespace {

bool Matches(const std::string& text) { return HasKey(text, "ppx") && HasKey(text, "ppy"); }

Camera Read(const std::string& text, const std::filesystem::path& name) {
  MapReader reader(MapWithAny(ParseYaml(text, name), {"ppx"}));
  constexpr IntRange kSizes = {1, 100000};
  const std::vector<double> pinhole = {reader.Number("fx"), reader.Number("fy"), reader.Number("ppx"),
                                       reader.Number("ppy")};
  std::vector<double> coefficients;
  if (const std::optional<ConfigValue> coeffs = reader.Find("coeffs")) coefficients = ReadNumbers(*coeffs);
  const bool is_undistorted =
      std::all_of(coefficients.begin(), coefficients.end(), [](double coefficient) { return coefficient == 0; });
  if (is_undistorted) coefficients.clear();
  // The names are those of rs2_distortion_to_string and of the Python module.
  const std::optional<ConfigValue> model = reader.Find("model");
  std::string lens_name = model ? Lower(model->AsText()) : "brown_conrady";
  std::replace(lens_name.begin(), lens_name.end(), ' ', '_');
  lens_name = lens_name.substr(lens_name.find('.') + 1);
  if (!is_undistorted && lens_name != "brown_conrady" && lens_name != "kannala_brandt4") {
    model->Fail("the distortion " + Quoted(lens_name) +
                (lens_name == "inverse_brown_conrady"
                     ? " maps pixels to rays, not rays to pixels as brown5 does, and heba has no such model"
                     : " is not supported") +
                "; leave the camera out, and its intrinsics are estimated from the captures");
  }
  Outcome<Camera> camera = CameraFromCoefficients(
      pinhole, coefficients, lens_name == "kannala_brandt4" && !is_undistorted ? Lens::kFisheye : Lens::kPolynomial);
  if (!camera) reader.value().Fail(camera.reason());
  camera->width_px = reader.Get("width").AsInt(kSizes);
  camera->height_px = reader.Get("height").AsInt(kSizes);
  return *camera;
}

}  // namespace

CameraReader CameraReader_realsense() { return {Matches, Read}; }

}  // namespace heba
