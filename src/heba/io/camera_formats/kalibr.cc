// Kalibr's camchain of one camera: camera_model pinhole with distortion_model none, radtan (k1 k2 p1 p2) or
// equidistant. More than one camera is an error, because the file does not state which one is meant.
#include "heba/base/text.h"
#include "heba/io/camera_format.h"

namespace heba {
namespace {

bool Matches(const std::string& text) { return HasKey(text, "distortion_coeffs") && HasKey(text, "intrinsics"); }

Camera Read(const std::string& text, const std::filesystem::path& name) {
  const ConfigValue root = ParseYaml(text, name);
  MapReader chain(root);
  std::optional<ConfigValue> only = chain.Find("cam0");
  if (only && chain.Has("cam1")) {
    only->Fail("the file contains a second camera, cam1; write the intended one to a separate file");
  }
  // Users often extract the camera alone, without its name.
  MapReader reader(only ? *only : root);
  reader.Choice("camera_model", {"pinhole"}, "pinhole");
  const std::string lens = reader.Choice("distortion_model", {"none", "radtan", "equidistant"});
  const ConfigValue intrinsics = reader.Get("intrinsics");
  const std::vector<double> pinhole = ReadNumbers(intrinsics);
  if (pinhole.size() != 4) intrinsics.Fail("four numbers are needed: [fu, fv, cu, cv]");
  const ConfigValue distortion = reader.Get("distortion_coeffs");
  const std::vector<double> coefficients = lens == "none" ? std::vector<double>() : ReadNumbers(distortion);
  Outcome<Camera> camera =
      CameraFromCoefficients(pinhole, coefficients, lens == "equidistant" ? Lens::kFisheye : Lens::kPolynomial);
  if (!camera) distortion.Fail(camera.reason());
  const std::vector<ConfigValue> size = reader.Get("resolution").AsList();
  if (size.size() != 2) reader.Get("resolution").Fail("two whole numbers are needed: [width, height]");
  constexpr IntRange kSizes = {1, 100000};
  camera->width_px = size[0].AsInt(kSizes);
  camera->height_px = size[1].AsInt(kSizes);
  return *camera;
}

}  // namespace

CameraReader CameraReader_kalibr() { return {Matches, Read}; }

}  // namespace heba
