#include "heba/target.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "targets/kalibr_target.h"
#include "targets/table_choice.h"

namespace heba {

#define HEBA_TARGET(type, description) std::unique_ptr<Target> CreateTarget_##type(MapReader& reader);
#include "targets/targets.def"
#undef HEBA_TARGET

namespace {

struct TargetType {
  const char* name;
  std::unique_ptr<Target> (*create)(MapReader& reader);
};
const TargetType kTargetTypes[] = {
#define HEBA_TARGET(type, description) {#type, &CreateTarget_##type},
#include "targets/targets.def"
#undef HEBA_TARGET
};

}  // namespace

std::vector<std::string> TargetTypeNames() { return NamesOf(kTargetTypes); }

std::unique_ptr<Target> CreateTarget(MapReader& reader) {
  if (IsKalibrTarget(reader)) reader = MapReader(FromKalibrTarget(reader));
  std::unique_ptr<Target> target = ReadChoice(reader, "type", kTargetTypes)->create(reader);
  if (reader.Has("scale_sigma")) target->set_scale_sigma(reader.Ratio("scale_sigma"));
  reader.Finish();
  return target;
}

std::unique_ptr<Target> ParseTarget(const std::string& yaml) {
  MapReader reader(ParseYaml(yaml, "target"));
  return CreateTarget(reader);
}

std::string UnitLength(double length_m, double unit_m) {
  constexpr int kDigits = 12;
  return Significant(length_m / unit_m, kDigits) + " m";
}

std::vector<Rigid3d> PlaneSymmetries(const std::vector<TargetPoint>& points) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const TargetPoint& point : points) centre += point.in_target;
  centre /= static_cast<double>(points.size());
  double extent = 0;
  for (const TargetPoint& point : points) extent = std::max(extent, (point.in_target - centre).norm());
  std::vector<Rigid3d> symmetries;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const Eigen::Quaterniond rotation = ExpRotation(Eigen::Vector3d(0, 0, quarter * kPi / 2));
    const Rigid3d candidate(rotation, centre - rotation * centre);
    const bool maps_to_itself = std::all_of(points.begin(), points.end(), [&](const TargetPoint& point) {
      const Eigen::Vector3d moved = candidate * point.in_target;
      return std::any_of(points.begin(), points.end(),
                         [&](const TargetPoint& other) { return (moved - other.in_target).norm() < 1e-6 * extent; });
    });
    if (maps_to_itself) symmetries.push_back(candidate);
  }
  return symmetries;
}

bool SeenFromFront(const std::vector<Eigen::Vector2d>& points_m, const std::vector<Eigen::Vector2d>& pixels,
                   bool y_up) {
  // The result follows from the sign of the determinant of the least-squares affine map from the target's plane to
  // the image.
  CHECK_EQ(points_m.size(), pixels.size());
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < pixels.size(); ++i) {
    mean_m += points_m[i];
    mean_px += pixels[i];
  }
  mean_m /= static_cast<double>(pixels.size());
  mean_px /= static_cast<double>(pixels.size());
  Eigen::Matrix2d cross = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  for (size_t i = 0; i < pixels.size(); ++i) {
    cross += (pixels[i] - mean_px) * (points_m[i] - mean_m).transpose();
    square += (points_m[i] - mean_m) * (points_m[i] - mean_m).transpose();
  }
  const double determinant = cross.determinant() * square.determinant();
  return y_up ? determinant < 0 : determinant > 0;
}

}  // namespace heba
