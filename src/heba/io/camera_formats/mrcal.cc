// mrcal's .cameramodel, a Python dictionary. Pixel (0, 0) is the centre of the first pixel, as in heba.
#include <cmath>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/io/camera_format.h"
#include "heba/io/python_literal.h"

namespace heba {
namespace {

bool Matches(const std::string& text) { return HasKey(text, "lensmodel"); }

struct LensModel {
  std::string name;
  size_t num_intrinsics;  // fx fy cx cy, then OpenCV's coefficients.
};
const std::vector<LensModel>& LensModels() {
  static const std::vector<LensModel> models = {{"LENSMODEL_PINHOLE", 4},
                                                {"LENSMODEL_OPENCV4", 8},
                                                {"LENSMODEL_OPENCV5", 9},
                                                {"LENSMODEL_OPENCV8", 12},
                                                {"LENSMODEL_OPENCV12", 16}};
  return models;
}

// The dictionary of a file, with the file's name for error messages.
class Dictionary {
 public:
  Dictionary(const std::string& text, const std::filesystem::path& name)
      : name_(name), root_(ParsePythonLiteral(text, name)) {
    if (root_.kind != PythonValue::Kind::kDict) Fail(root_, "a dictionary {...} is needed");
  }
  [[noreturn]] void Fail(const PythonValue& at, const std::string& fault) const {
    throw InputError(name_.string() + ":" + std::to_string(at.line) + ": " + fault);
  }
  // `what` describes the required value in messages.
  const PythonValue& Get(const std::string& key, PythonValue::Kind kind, const std::string& what) const {
    const PythonValue* found = root_.Find(key);
    if (found == nullptr) Fail(root_, "'" + key + "' is missing");
    if (found->kind != kind) Fail(*found, key + ": " + what + " is needed");
    return *found;
  }
  std::vector<double> Numbers(const PythonValue& list, const std::string& key) const {
    std::vector<double> values;
    for (const PythonValue& item : list.items) {
      const bool is_number = item.kind == PythonValue::Kind::kNumber && std::isfinite(item.number);
      if (!is_number) Fail(item, key + ": finite numbers are needed");
      values.push_back(item.number);
    }
    return values;
  }

 private:
  const std::filesystem::path& name_;
  PythonValue root_;
};

const LensModel& ReadLensModel(const Dictionary& dictionary) {
  const PythonValue& lens_model = dictionary.Get("lensmodel", PythonValue::Kind::kText, "a name in quotes");
  if (const LensModel* model = FindEntry(LensModels(), lens_model.text)) return *model;
  dictionary.Fail(lens_model, "lensmodel " + Quoted(lens_model.text) + " is not supported; one of: " +
                                  Join(NamesOf(LensModels()), ", ") + " (mrcal-convert-lensmodel converts to one)" +
                                  DidYouMean(lens_model.text, NamesOf(LensModels())));
}

Camera Read(const std::string& text, const std::filesystem::path& name) {
  const Dictionary dictionary(text, name);
  const LensModel& model = ReadLensModel(dictionary);
  const PythonValue& intrinsics = dictionary.Get("intrinsics", PythonValue::Kind::kList, "a list of numbers");
  std::vector<double> pinhole = dictionary.Numbers(intrinsics, "intrinsics");
  if (pinhole.size() != model.num_intrinsics) {
    dictionary.Fail(intrinsics, "intrinsics: " + std::to_string(pinhole.size()) + " numbers; " + model.name + " has " +
                                    std::to_string(model.num_intrinsics));
  }
  const std::vector<double> coefficients(pinhole.begin() + 4, pinhole.end());
  pinhole.resize(4);
  Outcome<Camera> camera = CameraFromCoefficients(pinhole, coefficients, Lens::kPolynomial);
  if (!camera) dictionary.Fail(intrinsics, "intrinsics: " + camera.reason());

  const PythonValue& imager_size = dictionary.Get("imagersize", PythonValue::Kind::kList, "[width, height]");
  const std::vector<double> size = dictionary.Numbers(imager_size, "imagersize");
  constexpr double kMaxSize = 100000;
  const auto is_size = [](double v) { return v >= 1 && v <= kMaxSize && v == std::floor(v); };
  if (size.size() != 2 || !is_size(size[0]) || !is_size(size[1])) {
    dictionary.Fail(imager_size, "imagersize: [width, height] in whole numbers is needed");
  }
  camera->width_px = static_cast<int>(size[0]);
  camera->height_px = static_cast<int>(size[1]);
  return *camera;
}

}  // namespace

CameraReader CameraReader_mrcal() { return {Matches, Read}; }

}  // namespace heba
