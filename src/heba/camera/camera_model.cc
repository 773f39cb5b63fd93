#include "heba/camera/camera_model.h"

namespace heba {

#define HEBA_CAMERA_MODEL(name, description) const CameraModel& CameraModel_##name();
#include "heba/camera/models.def"
#undef HEBA_CAMERA_MODEL

ParameterGroup GroupOf(int parameter_index) {
  if (parameter_index < 2) return ParameterGroup::kFocal;
  return parameter_index < 4 ? ParameterGroup::kPrincipalPoint : ParameterGroup::kDistortion;
}

const std::vector<const CameraModel*>& CameraModels() {
  static const std::vector<const CameraModel*> models = {
#define HEBA_CAMERA_MODEL(name, description) &CameraModel_##name(),
#include "heba/camera/models.def"
#undef HEBA_CAMERA_MODEL
  };
  return models;
}

const CameraModel* FindCameraModel(std::string_view name) {
  for (const CameraModel* model : CameraModels()) {
    if (model->name() == name) return model;
  }
  return nullptr;
}

std::vector<std::string> CameraModelNames() {
  std::vector<std::string> names;
  for (const CameraModel* model : CameraModels()) names.emplace_back(model->name());
  return names;
}

}  // namespace heba
