// ROS camera_info: the files of camera_calibration and camera_info_manager, and the message as printed by `ros2 topic
// echo` and `rostopic echo` (width, height, k, d or K, D).
#include <initializer_list>

#include "heba/io/camera_format.h"

namespace heba {
namespace {

bool Matches(const std::string& text) {
  return HasKey(text, "camera_matrix") ||
         (HasKey(text, "distortion_model") && (HasKey(text, "K") || HasKey(text, "k")));
}

// Returns the value of the first of `keys` that exists. Throws InputError for the first key if none exists.
ConfigValue GetOneOf(MapReader& reader, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (const std::optional<ConfigValue> found = reader.Find(key)) return *found;
  }
  return reader.Get(*keys.begin());
}

Camera Read(const std::string& text, const std::filesystem::path& name) {
  std::string document = text.substr(0, text.find_last_not_of(" \t\r\n") + 1);
  // `topic echo` prints this line after each message.
  if (document.ends_with("\n---")) document.resize(document.size() - 4);
  // Recorders write it under a key of their own, such as camera_info.
  const ConfigValue root = MapWithAny(ParseYaml(document, name), {"camera_matrix", "K", "k"});
  MapReader reader(root);
  const bool is_message = !reader.Has("camera_matrix");
  constexpr IntRange kSizes = {1, 100000};
  const int width_px = GetOneOf(reader, {is_message ? "width" : "image_width"}).AsInt(kSizes);
  const int height_px = GetOneOf(reader, {is_message ? "height" : "image_height"}).AsInt(kSizes);
  const ConfigValue matrix = is_message ? GetOneOf(reader, {"K", "k"}) : reader.Get("camera_matrix");
  const ConfigValue distortion = is_message ? GetOneOf(reader, {"D", "d"}) : reader.Get("distortion_coefficients");

  const Outcome<std::vector<double>> pinhole = PinholeFromMatrix(ReadMatrix(matrix));
  if (!pinhole) matrix.Fail(pinhole.reason());
  const std::vector<double> coefficients = ReadMatrix(distortion);
  // ROS assumes plumb_bob for a file without a model; a camera without distortion may omit the model.
  std::string model_name = "plumb_bob";
  const std::optional<ConfigValue> model = reader.Find("distortion_model");
  if (model && !(coefficients.empty() && model->IsText() && model->node().Scalar().empty())) {
    model_name = model->AsText();
  }
  const Outcome<Lens> lens = LensOfRosModel(model_name);
  if (!lens) model->Fail(lens.reason());
  Outcome<Camera> camera = CameraFromCoefficients(*pinhole, coefficients, *lens);
  if (!camera) distortion.Fail(camera.reason());
  camera->width_px = width_px;
  camera->height_px = height_px;
  return *camera;
}

}  // namespace

CameraReader CameraReader_ros() { return {Matches, Read}; }

}  // namespace heba
