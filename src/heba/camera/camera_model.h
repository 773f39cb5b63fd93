// What a camera model is. A model maps points in the camera frame (OpenCV's axes: x right, y down, z forward; metres)
// to pixels, (0, 0) being the centre of the first pixel. Models are stateless; they are found by name in a table.
//
// For every model: the optical axis hits the principal point, (0, 0, -1) has no image, Unproject inverts Project, and
// the Jacobians are the derivatives of Project (tests/conformance/camera_model_test.cc).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace heba {

// Points as a structure of arrays: row 0 holds all x, row 1 all y, row 2 all z.
using Points3 = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
// Pixels in the same way: row 0 all u, row 1 all v.
using Points2 = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;

// Derivatives of a batch of n projections: row j of `u` holds d u / d q_j for all points, where q is
// (x, y, z, parameter 0, parameter 1, ...).
struct ProjectionJacobian {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows u;
  Rows v;
};

// Some points and their images, for kernels. Those after `size`, up to a
// multiple of kMaxLanes (heba/kernels/simd.h), are calculated too: PadBatch.
struct ProjectionBatch {
  static constexpr int kCapacity = 64;
  static constexpr int kMaxDistortion = 16;
  // Beyond those of a model there is room for the caller's own.
  static constexpr int kMaxRows = 8 + kMaxDistortion + 8;
  int size = 0;
  alignas(64) double points[3][kCapacity];  // Before the pose, m.
  alignas(64) double pixels[2][kCapacity];  // u and v.
  // Derivatives of u, and of v: by a left perturbation of the pose (p' = p + v + w x p: v in m, then w in rad), by the
  // axis's own focal length, its own part of the principal point (1), and the distortion coefficients. By the other
  // axis's focal length and principal point they are 0.
  alignas(64) double rows[2][kMaxRows][kCapacity];
};

// Which of a camera's parameters a row of ProjectionBatch::rows after the pose's six is of.
constexpr int ParameterOfRow(int row, int axis) { return row < 8 ? 2 * (row - 6) + axis : row - 4; }

// Fills up to a multiple of kMaxLanes; `size` stays.
void PadBatch(ProjectionBatch* batch);

// The parts of a model's parameters that a user can free or hold.
enum class ParameterGroup { kFocal, kPrincipalPoint, kDistortion };
inline constexpr std::string_view kParameterGroupNames[] = {"focal", "principal_point", "distortion"};

class CameraModel {
 public:
  virtual ~CameraModel() = default;
  virtual std::string_view name() const = 0;
  // "fx", "fy", "cx", "cy", then the distortion coefficients in the field's usual names and order.
  virtual const std::vector<std::string>& param_names() const = 0;

  // Projects the points of a batch, moved by the pose; as ProjectionBatch says. False if a point has no image (behind
  // the camera, not finite): the output is then unspecified.
  virtual bool ProjectBatch(const double* params, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                            bool with_derivatives, ProjectionBatch* batch) const = 0;

  // Projects `points_in_camera`; `pixels` and, if not null, `jacobian` are resized to fit. False as above.
  bool Project(const double* params, const Points3& points_in_camera, Points2* pixels,
               ProjectionJacobian* jacobian) const;

  // The unit ray that projects to `pixel`; nothing if there is none (beyond the image of every ray, or beyond the
  // radius at which the distortion folds back).
  virtual std::optional<Eigen::Vector3d> Unproject(const double* params, const Eigen::Vector2d& pixel) const = 0;
};

inline int NumParams(const CameraModel& model) { return static_cast<int>(model.param_names().size()); }
// Parameters 0 and 1 are the focal lengths, 2 and 3 the principal point, the others distortion: for every model.
ParameterGroup GroupOf(int parameter_index);

// Null if there is no model of that name.
const CameraModel* FindCameraModel(std::string_view name);
// All of them, in the order of models.def.
const std::vector<const CameraModel*>& CameraModels();
std::vector<std::string> CameraModelNames();

}  // namespace heba
