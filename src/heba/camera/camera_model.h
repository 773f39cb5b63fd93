// The interface of camera models. A model maps points in the camera frame (OpenCV's axes: x right, y down, z forward;
// metres) to pixels; (0, 0) is the centre of the first pixel. Models are stateless; they are found by name in a table.
//
// For every model, the optical axis hits the principal point, (0, 0, -1) has no image, Unproject inverts Project, and
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
// Pixels in the same layout: row 0 holds all u, row 1 all v.
using Points2 = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;

// Derivatives of a batch of n projections: row j of `u` holds d u / d q_j for all points, where q is
// (x, y, z, parameter 0, parameter 1, ...).
struct ProjectionJacobian {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows u;
  Rows v;
};

// Input and output of the projection kernels. Entries after `size`, up to a multiple of kMaxLanes
// (heba/kernels/simd.h), are computed too and must be padded by PadBatch.
struct ProjectionBatch {
  static constexpr int kCapacity = 64;
  static constexpr int kMaxDistortion = 16;
  // The rows that a model does not need are free for the caller.
  static constexpr int kMaxRows = 8 + kMaxDistortion + 12;
  int size = 0;
  alignas(64) double points[3][kCapacity];  // Before the pose is applied, m.
  alignas(64) double pixels[2][kCapacity];  // u and v.
  // Derivatives of u and of v: first by a left perturbation of the pose (p' = p + v + w x p: v in m, then w in rad),
  // then by the focal length of the same axis, by the principal point of the same axis (1), and by the distortion
  // coefficients. The derivatives by the other axis's focal length and principal point are 0 and are not stored.
  alignas(64) double rows[2][kMaxRows][kCapacity];
};

// Returns the index of the camera parameter to which a row of ProjectionBatch::rows belongs. `row` must not be one of
// the first six, which belong to the pose.
constexpr int ParameterOfRow(int row, int axis) { return row < 8 ? 2 * (row - 6) + axis : row - 4; }

// Fills the entries up to a multiple of kMaxLanes with copies of the first point; `size` does not change.
void PadBatch(ProjectionBatch* batch);

// The groups of camera parameters that a user can free or hold fixed.
enum class ParameterGroup { kFocal, kPrincipalPoint, kDistortion };
inline constexpr std::string_view kParameterGroupNames[] = {"focal", "principal_point", "distortion"};

// The kinds of lens. A perspective model projects points in front of the camera only; a fisheye model also projects
// points at 90 deg from the optical axis and beyond.
enum class LensKind { kPerspective, kFisheye };

// A lens in OpenCV's terms: k1 k2 p1 p2 [k3 [k4 k5 k6]] of the module calib3d (empty: no distortion), or k1 k2 k3 k4 of
// the module fisheye.
struct OpenCvLens {
  LensKind kind = LensKind::kPerspective;
  std::vector<double> coefficients;
};

// The names of a model in Kalibr's camchain files. Kalibr divides the distortion coefficients of a model into those of
// the projection, which stand before the focal lengths, and those of the distortion.
struct KalibrNames {
  std::string camera_model;      // Empty if Kalibr has no such model.
  std::string distortion_model;  // One of none, radtan, equidistant.
  int num_projection = 0;        // Number of the first coefficients that belong to the projection.
};

// A camera with an image of 1280 x 960 px, every pixel of which has a ray.
struct CameraExample {
  std::string name;
  std::vector<double> params;
};

// The facts about a model that do not depend on a camera.
struct CameraModelFacts {
  LensKind kind = LensKind::kPerspective;
  // The distortion coefficients under their usual names and in their usual order.
  std::vector<std::string> distortion_names;
  // The coefficients from which the estimation of the intrinsics starts, one entry for each minimum that the residuals
  // of the model are known to have; empty if it starts from 0. They must project all points in front of the camera.
  std::vector<std::vector<double>> initial_distortions;
  KalibrNames kalibr;
  // In at least one of them, no coefficient is 0.
  std::vector<CameraExample> examples;
};

class CameraModel {
 public:
  virtual ~CameraModel() = default;
  virtual std::string_view name() const = 0;
  virtual const CameraModelFacts& facts() const = 0;
  // Names of the parameters: "fx", "fy", "cx", "cy", then CameraModelFacts::distortion_names.
  virtual const std::vector<std::string>& param_names() const = 0;

  // Returns OpenCV's lens that projects every point as the distortion coefficients (those after cy) do; nothing if
  // OpenCV has none.
  virtual std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) const = 0;
  // Returns the distortion coefficients with which the model is OpenCV's lens; nothing if there are none.
  virtual std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) const = 0;

  // Transforms the points of a batch by the pose and projects them (see ProjectionBatch). Returns false if a point has
  // no image (behind the camera, not finite); the output is then unspecified.
  virtual bool ProjectBatch(const double* params, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                            bool with_derivatives, ProjectionBatch* batch) const = 0;

  // Projects `points_in_camera`. `pixels` and, if not null, `jacobian` are resized to fit. Returns false if a point has
  // no image.
  bool Project(const double* params, const Points3& points_in_camera, Points2* pixels,
               ProjectionJacobian* jacobian) const;

  // Returns the unit ray that projects to `pixel`; nothing if there is none (the pixel lies outside the image of all
  // rays, or beyond the radius at which the distortion folds back).
  virtual std::optional<Eigen::Vector3d> Unproject(const double* params, const Eigen::Vector2d& pixel) const = 0;
};

inline int NumParams(const CameraModel& model) { return static_cast<int>(model.param_names().size()); }
// Returns the group of a parameter. For every model, parameters 0 and 1 are the focal lengths, 2 and 3 the principal
// point, and the others distortion coefficients.
ParameterGroup GroupOf(int parameter_index);

// Returns null if there is no model of that name.
const CameraModel* FindCameraModel(std::string_view name);
// Returns all models, in the order of models.def.
const std::vector<const CameraModel*>& CameraModels();
std::vector<std::string> CameraModelNames();
// Returns "'x' is unknown; one of: a, b, c" with the model that is meant before the list: the first whose description
// in models.def contains `unknown` as other programs' name of it, such as fisheye or plumb_bob, or else the nearest
// name.
std::string UnknownCameraModel(std::string_view unknown);

}  // namespace heba
