// What a target is: it lists its points, finds them in a picture and draws itself. Kinds of targets are found by name
// in a table; a new one is one file in types/ and one line of targets.def.
//
// For every target: ids are unique, points do not lie on one line, and the points found in a rendered picture of a
// known pose are where the camera model says (tests/conformance/target_test.cc).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/config/yaml_reader.h"
#include "heba/geometry/rigid3.h"
#include "targets/drawing.h"

namespace heba {

struct TargetPoint {
  int id = 0;
  Eigen::Vector3d in_target = Eigen::Vector3d::Zero();  // m
  // Of the flat disc (in the plane z = 0) whose imaged area's centroid is what is measured; 0 for a point. The image of
  // the disc's centre lies elsewhere: nearer to its far side, by perspective and lens.
  double radius_m = 0;
};

// What was found in one picture: ids[i] at pixels[i] ((0, 0) is the centre of the first pixel).
struct Detection {
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> pixels;
  // Of the pixels, px^2, as the grey values tell them: each matrix covers as many of the next points as it has pairs of
  // rows (u, v, u, v, ...): one point, or several that were measured together, as a tag's corners are. Empty from a
  // detector that cannot say.
  std::vector<Eigen::MatrixXd> covariances_px2;
  std::string reason;  // Why nothing was found, or why not all, in plain words; may be empty.
};

// Keys of a target's mapping with values.
using TargetSettings = std::vector<std::pair<std::string, std::string>>;

class Target {
 public:
  virtual ~Target() = default;
  // The name in targets.def.
  virtual std::string_view type() const = 0;
  // All points, by increasing id.
  virtual const std::vector<TargetPoint>& points() const = 0;
  // `grey` is CV_8UC1 and not changed; it may be a part of a larger picture. Only points of this target, each at most
  // once. Called from several threads at once. A target that can be read in several orders (Symmetries) may be found in
  // any of them.
  virtual Detection Detect(const cv::Mat& grey) const = 0;
  // Made once; it lives as long as the target.
  virtual const Drawing& Draw() const = 0;
  // The rotations, as target_from_target, under which the target looks the same, the identity first. A target whose
  // points carry ids or a mark has no other.
  virtual std::vector<Rigid3d> Symmetries() const { return {Rigid3d()}; }
  // The keys to change, with their values, for a target of this type that has no symmetry but the identity. Empty if
  // this one has none.
  virtual TargetSettings WithoutSymmetry() const { return {}; }
  // Other targets of this type that `grey` may show, where people wrote this one by mistake, likelier first: each the
  // keys that would have to be changed, with the other target's values. Some of them may not make a target.
  virtual std::vector<TargetSettings> LikelyMisconfigurations(const cv::Mat& /*grey*/) const { return {}; }
  // The keys of all lengths, with the values of a target of the same proportions that is the same for every size: an
  // image shows both where it shows one of them. Empty if the type has none such.
  virtual TargetSettings UnitLengths() const { return {}; }
};

// Reads a target from its mapping, heba's or Kalibr's, all of it (the reader then holds the target as used, in heba's
// words, defaults included). InputError
// with file and line on a fault.
std::unique_ptr<Target> CreateTarget(MapReader& reader);
std::vector<std::string> TargetTypeNames();

// A length as a value of Target::UnitLengths: `unit_m` is 1 m. Rounded, so that it is the same for every size.
std::string UnitLength(double length_m, double unit_m);

// The rotations about the plane's normal, as target_from_target, that map `points` onto themselves within 1e-6 of their
// extent, the identity first.
std::vector<Rigid3d> PlaneSymmetries(const std::vector<TargetPoint>& points);

// Whether the pixels of points 0, 1, 2, ... turn in the sense of the target's front side seen by a camera: x to y
// clockwise in the image for a target whose z axis points into the sheet, counter-clockwise for one whose z points out.
bool SeenFromFront(const std::vector<Eigen::Vector2d>& points_m, const std::vector<Eigen::Vector2d>& pixels, bool y_up);

}  // namespace heba
