#include "heba/camera/camera_model.h"

#include <algorithm>
#include <cctype>
#include <utility>

#include "heba/base/registry.h"
#include "heba/kernels/simd.h"

namespace heba {

void PadBatch(ProjectionBatch* batch) {
  const int padded = PaddedToLanes(batch->size);
  for (auto& coordinate : batch->points) std::fill(coordinate + batch->size, coordinate + padded, coordinate[0]);
}

bool CameraModel::Project(const double* params, const Points3& points_in_camera, Points2* pixels,
                          ProjectionJacobian* jacobian) const {
  const Eigen::Index n = points_in_camera.cols();
  const Eigen::Index num_params = NumParams(*this);
  pixels->resize(2, n);
  if (jacobian != nullptr) {
    jacobian->u.setZero(3 + num_params, n);
    jacobian->v.setZero(3 + num_params, n);
  }
  ProjectionBatch batch;
  for (Eigen::Index first = 0; first < n; first += batch.size) {
    batch.size = static_cast<int>(std::min<Eigen::Index>(n - first, ProjectionBatch::kCapacity));
    const auto copy_in = [&](int row) {
      std::copy_n(points_in_camera.row(row).data() + first, batch.size, batch.points[row]);
    };
    for (int row = 0; row < 3; ++row) copy_in(row);
    PadBatch(&batch);
    if (!ProjectBatch(params, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), jacobian != nullptr, &batch)) {
      return false;
    }
    for (int axis = 0; axis < 2; ++axis) {
      std::copy_n(batch.pixels[axis], batch.size, pixels->row(axis).data() + first);
      if (jacobian == nullptr) continue;
      ProjectionJacobian::Rows& rows = axis == 0 ? jacobian->u : jacobian->v;
      const auto copy_out = [&](int from, Eigen::Index to) {
        std::copy_n(batch.rows[axis][from], batch.size, rows.row(to).data() + first);
      };
      for (int k = 0; k < 3; ++k) copy_out(k, k);  // Derivatives by a shift of the point.
      for (int row = 6; row < 4 + num_params; ++row) copy_out(row, 3 + ParameterOfRow(row, axis));
    }
  }
  return true;
}

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
  const CameraModel* const* found = FindEntry(CameraModels(), name);
  return found == nullptr ? nullptr : *found;
}

std::vector<std::string> CameraModelNames() { return NamesOf(CameraModels()); }

std::string UnknownCameraModel(std::string_view unknown) {
  static constexpr std::pair<std::string_view, std::string_view> kDescriptions[] = {
#define HEBA_CAMERA_MODEL(name, description) {#name, description},
#include "heba/camera/models.def"
#undef HEBA_CAMERA_MODEL
  };
  const std::string sought = Lower(unknown);
  for (const auto& [name, description] : kDescriptions) {
    const std::string text = Lower(description);
    const size_t place = sought.empty() ? std::string::npos : text.find(sought);
    if (place == std::string::npos) continue;
    const auto is_part_of_word = [&](size_t i) {
      return i < text.size() && (std::isalnum(text[i]) != 0 || text[i] == '_');
    };
    if (is_part_of_word(place - 1) || is_part_of_word(place + sought.size())) continue;
    return Quoted(unknown) + " is unknown; did you mean '" + std::string(name) + "' (" + std::string(description) +
           ")? One of: " + Join(CameraModelNames(), ", ");
  }
  return UnknownName(unknown, CameraModelNames());
}

}  // namespace heba
