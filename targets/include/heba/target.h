// A calibration target: it lists its points, detects them in an image and draws itself. Types of targets are selected
// by name from a table; a new one takes one file in types/ and one line in targets.def.
//
//   const std::unique_ptr<heba::Target> target = heba::ParseTarget("{type: chessboard, rows: 8, columns: 11, square: 15
//   mm}"); const heba::Detection detection = target->Detect(grey);  // A cv::Mat of CV_8UC1.
//
// Every target guarantees that ids are unique, that its points do not all lie on one line, and that the points
// detected in an image rendered with a known pose are where the camera model predicts them
// (tests/conformance/target_test.cc).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/drawing.h"
#include "heba/geometry/rigid3.h"

namespace heba {

class MapReader;

struct TargetPoint {
  int id = 0;
  Eigen::Vector3d in_target = Eigen::Vector3d::Zero();  // m
  // The radius of the flat disc (in the plane z = 0) that is measured by the centroid of its imaged area; 0 for a
  // point. Perspective and lens distortion move the image of the disc's centre away from that centroid, towards the
  // image of the disc's far side.
  double radius_m = 0;
};

// The points found in one image: ids[i] is at pixels[i], where (0, 0) is the centre of the first pixel.
struct Detection {
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> pixels;
  // Covariances of the pixels in px^2, estimated from the grey values. Each matrix covers as many of the next points
  // as it has pairs of rows (u, v, u, v, ...): one point, or several that were measured together, such as the corners
  // of a tag. Empty if the detector cannot estimate them.
  std::vector<Eigen::MatrixXd> covariances_px2;
  std::string reason;  // Explains in plain words why points are missing; may be empty.
};

// Keys of a target's mapping with their values.
using TargetSettings = std::vector<std::pair<std::string, std::string>>;

class Target {
 public:
  virtual ~Target() = default;
  // Returns the name of the type in targets.def.
  virtual std::string_view type() const = 0;
  // Returns all points by increasing id.
  virtual const std::vector<TargetPoint>& points() const = 0;
  // Detects points of this target, each at most once. `grey` is CV_8UC1, is not modified, and may be a part of a
  // larger image. The function is called from several threads at once. If the target can be read in several orders
  // (Symmetries), the points may be returned in any of them.
  virtual Detection Detect(const cv::Mat& grey) const = 0;
  // Returns the drawing, which is created once and lives as long as the target.
  virtual const Drawing& Draw() const = 0;
  // Returns the codes by which the target is recognised in an image, such as "tag36h11 7". Two targets without a common
  // code can be told apart. A target without codes is recognised by its shape, which stands for one.
  virtual std::vector<std::string> Codes() const {
    return {std::string(type()) + " of " + std::to_string(points().size()) + " points"};
  }
  // Returns the rotations, as target_from_target, under which the target looks the same, the identity first. A target
  // whose points carry ids or a mark has only the identity.
  virtual std::vector<Rigid3d> Symmetries() const { return {Rigid3d()}; }
  // Returns the keys to change, with their new values, to obtain a target of this type without any symmetry but the
  // identity. Empty if this target has no symmetry.
  virtual TargetSettings WithoutSymmetry() const { return {}; }
  // Returns other targets of this type that `grey` may show if this one was configured by mistake, the most likely
  // first. Each lists the keys that would have to be changed, with the values of the other target. Some may not
  // describe a valid target.
  virtual std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& /*grey*/) const { return {}; }
  // Returns the keys of all lengths, with the values of a target of the same proportions that do not depend on this
  // target's size: an image of one of the two is an image of the other as well. Empty if the type has no such keys.
  virtual TargetSettings UnitLengths() const { return {}; }

  // One sigma of the scales of the print about those of the design, as a ratio, if the mapping states it.
  const std::optional<double>& scale_sigma() const { return scale_sigma_; }
  void set_scale_sigma(double sigma) { scale_sigma_ = sigma; }

 private:
  std::optional<double> scale_sigma_;
};

// Reads a target from its whole mapping, in heba's or Kalibr's format. Afterwards the reader holds the target as it
// is used, with heba's keys and all defaults. Throws InputError with file and line if the mapping is invalid.
std::unique_ptr<Target> CreateTarget(MapReader& reader);
// Parses a target from YAML text. Throws InputError, which begins with "target", if the text is invalid.
std::unique_ptr<Target> ParseTarget(const std::string& yaml);
std::vector<std::string> TargetTypeNames();

// Formats a length as a value of Target::UnitLengths, where `unit_m` counts as 1 m. The number is rounded so that it
// is the same for every size of the target.
std::string UnitLength(double length_m, double unit_m);

// Returns the rotations by multiples of 90 degrees about the normal of the plane, as target_from_target, that map
// `points` onto themselves to within 1e-6 of their extent, the identity first.
std::vector<Rigid3d> PlaneSymmetries(const std::vector<TargetPoint>& points);

// Returns whether the pixels of the points have the orientation of the target's front side as seen by a camera: x
// rotates into y clockwise in the image for a target whose z axis points into the sheet, and counter-clockwise for
// one whose z axis points out of it (`y_up`).
bool SeenFromFront(const std::vector<Eigen::Vector2d>& points_m, const std::vector<Eigen::Vector2d>& pixels, bool y_up);

}  // namespace heba
