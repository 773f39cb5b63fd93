// heba's own format, in YAML or JSON; see ReadCamera.
#include "heba/io/camera_file.h"
#include "heba/io/camera_format.h"

namespace heba {
namespace {

bool Matches(const std::string& text) { return HasKey(text, "model") || HasKey(text, "fx"); }

Camera Read(const std::string& text, const std::filesystem::path& name) { return ReadCamera(ParseYaml(text, name)); }

}  // namespace

CameraReader CameraReader_native() { return {Matches, Read}; }

}  // namespace heba
