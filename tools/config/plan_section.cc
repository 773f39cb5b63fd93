#include "tools/config/plan_section.h"

#include <vector>

#include "tools/config/common_keys.h"
#include "tools/config/robot_noise_config.h"

namespace heba {
namespace {

PlanBox ReadBox(const ConfigValue& value) {
  const std::vector<ConfigValue> corners = value.AsList();
  if (corners.size() != 2) value.Fail("two corners are needed: [[x, y, z], [x, y, z]]");
  const Eigen::Vector3d a = corners[0].AsVector3(Quantity::kLength);
  const Eigen::Vector3d b = corners[1].AsVector3(Quantity::kLength);
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

PlanLens ReadLens(const ConfigValue& value) {
  MapReader reader(value);
  PlanLens lens;
  const double focal_length_m = reader.PositiveLength("focal_length");
  const double pixel_m = reader.PositiveLength("pixel");
  const ConfigValue size = reader.Get("image_size");
  const std::vector<ConfigValue> sides = size.AsList();
  constexpr IntRange kSides = {16, 65536};
  if (sides.size() != 2) size.Fail("a width and a height are needed: [1920, 1200]");
  lens.camera.width_px = sides[0].AsInt(kSides);
  lens.camera.height_px = sides[1].AsInt(kSides);
  reader.Record("image_size", size.node());
  const double focal_px = focal_length_m / pixel_m;
  lens.camera.model = "brown5";
  lens.camera.params = {
      focal_px, focal_px, 0.5 * (lens.camera.width_px - 1), 0.5 * (lens.camera.height_px - 1), 0, 0, 0, 0, 0};
  const std::string faults = CheckCamera(lens.camera);
  if (!faults.empty()) value.Fail(faults);
  if (const std::optional<ConfigValue> depth = reader.Find("depth_of_field")) {
    const std::vector<ConfigValue> range = depth->AsList();
    if (range.size() != 2) depth->Fail("two depths are needed: [nearest, farthest]");
    lens.nearest_m = range[0].AsQuantity(Quantity::kLength);
    lens.farthest_m = range[1].AsQuantity(Quantity::kLength);
    if (!(lens.nearest_m >= 0 && lens.nearest_m < lens.farthest_m)) {
      depth->Fail("the nearest depth must be less than the farthest");
    }
    reader.Record("depth_of_field", depth->node());
  }
  reader.Finish();
  return lens;
}

}  // namespace

PlanSection ReadPlan(MapReader& root) {
  PlanSection plan;
  if (!root.Has("plan")) return plan;
  MapReader reader = root.Section("plan");
  if (reader.Has("hand_eye") || reader.Has("board")) {
    plan.hand_eye = HandEye{ReadPoseKey(reader, "hand_eye"), ReadPoseKey(reader, "board")};
  }
  MapReader uncertainty = reader.Section("uncertainty");
  plan.cell.uncertainty_m = uncertainty.PositiveLength("translation", plan.cell.uncertainty_m);
  plan.cell.uncertainty_rad = uncertainty.Angle("rotation", plan.cell.uncertainty_rad);
  constexpr double kMostRad = DegToRad(45);
  if (!(plan.cell.uncertainty_rad > 0 && plan.cell.uncertainty_rad <= kMostRad)) {
    uncertainty.Get("rotation").Fail("must be greater than zero, and at most 45 deg");
  }
  uncertainty.Finish();
  reader.Record("uncertainty", uncertainty.used());
  if (const std::optional<ConfigValue> workspace = reader.Find("workspace")) {
    MapReader box(*workspace);
    plan.cell.workspace = ReadBox(box.Get("box"));
    box.Record("box", box.Get("box").node());
    box.Finish();
    reader.Record("workspace", box.used());
  }
  if (const std::optional<ConfigValue> noise = reader.Find("robot_noise")) {
    MapReader of_noise(*noise);
    plan.cell.robot_noise = ReadRobotNoise(of_noise);
    plan.has_noise = true;
    reader.Record("robot_noise", of_noise.used());
  }
  if (const std::optional<ConfigValue> boxes = reader.Find("keep_out")) {
    for (const ConfigValue& item : boxes->AsList()) {
      MapReader box(item);
      plan.cell.keep_out.push_back(ReadBox(box.Get("box")));
      box.Record("box", box.Get("box").node());
      box.Finish();
    }
    reader.Record("keep_out", boxes->node());
  }
  plan.cell.max_tilt_rad = reader.Angle("tilt", plan.cell.max_tilt_rad);
  constexpr double kMostTiltRad = DegToRad(80);
  if (!(plan.cell.max_tilt_rad > 0 && plan.cell.max_tilt_rad <= kMostTiltRad)) {
    reader.Get("tilt").Fail("must be greater than zero, and at most 80 deg");
  }
  plan.num_revisits = reader.Int("revisits", {0, 100}, plan.num_revisits);
  if (const std::optional<ConfigValue> lens = reader.Find("lens")) {
    plan.lens = ReadLens(*lens);
    reader.Record("lens", lens->node());
  }
  reader.Finish();
  root.Record("plan", reader.used());
  return plan;
}

}  // namespace heba
