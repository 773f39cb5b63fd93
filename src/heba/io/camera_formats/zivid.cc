// Zivid's camera intrinsics: CameraMatrix with FX, FY, CX, CY, and Distortion with K1, K2, K3, P1, P2. The file has no
// image size.
#include "heba/io/camera_format.h"

namespace heba {
namespace {

bool Matches(const std::string& text) { return HasKey(text, "CameraMatrix") && HasKey(text, "FX"); }

Camera Read(const std::string& text, const std::filesystem::path& name) {
  MapReader reader(MapWithAny(ParseYaml(text, name), {"CameraMatrix"}));
  MapReader matrix(reader.Get("CameraMatrix"));
  const std::vector<double> pinhole = {matrix.Number("FX"), matrix.Number("FY"), matrix.Number("CX"),
                                       matrix.Number("CY")};
  std::vector<double> coefficients;
  if (const std::optional<ConfigValue> distortion = reader.Find("Distortion")) {
    MapReader of_lens(*distortion);
    for (const char* const key : {"K1", "K2", "P1", "P2", "K3"}) coefficients.push_back(of_lens.Number(key));
  }
  const Outcome<Camera> camera = CameraFromCoefficients(pinhole, coefficients, Lens::kPolynomial);
  if (!camera) reader.value().Fail(camera.reason());
  return *camera;
}

}  // namespace

CameraReader CameraReader_zivid() { return {Matches, Read}; }

}  // namespace heba
