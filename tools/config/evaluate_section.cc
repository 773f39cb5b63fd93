#include "tools/config/evaluate_section.h"

#include <utility>

#include "heba/base/text.h"

namespace heba {
namespace {

Eigen::Vector3d ReadPlace(const ConfigValue& value) {
  const std::vector<ConfigValue> items = value.AsList();
  if (items.size() != 3) value.Fail("three lengths are needed: [400 mm, 0 mm, 50 mm]");
  return {items[0].AsQuantity(Quantity::kLength), items[1].AsQuantity(Quantity::kLength),
          items[2].AsQuantity(Quantity::kLength)};
}

std::string PlaceText(const Eigen::Vector3d& place_m) {
  return "[" + Significant(1000 * place_m.x(), 4) + ", " + Significant(1000 * place_m.y(), 4) + ", " +
         Significant(1000 * place_m.z(), 4) + "] mm";
}

}  // namespace

std::vector<PlacedRequirement> ReadRequirements(MapReader& evaluate, const std::vector<std::string>& cameras) {
  std::vector<PlacedRequirement> requirements;
  const std::optional<ConfigValue> list = evaluate.Find("require");
  if (!list) return requirements;
  YAML::Node used(YAML::NodeType::Sequence);
  for (const ConfigValue& item : list->AsList()) {
    MapReader reader(item);
    PlacedRequirement requirement;
    requirement.within_m = reader.Length("within");
    if (!(requirement.within_m > 0)) reader.Get("within").Fail("must be greater than zero");
    if (const std::optional<ConfigValue> confidence = reader.Find("confidence")) {
      requirement.confidence = confidence->AsNumber();
      if (!(requirement.confidence > 0 && requirement.confidence < 1)) {
        confidence->Fail("a number between 0 and 1 is needed");
      }
      reader.Record("confidence", confidence->node());
    }
    const std::optional<ConfigValue> at = reader.Find("at");
    const std::optional<ConfigValue> box = reader.Find("box");
    if (at && box) box->Fail("a point (at) or a box is needed, not both");
    if (at) {
      requirement.places_in_base_m = {ReadPlace(*at)};
      requirement.text = PlaceText(requirement.places_in_base_m.front());
      reader.Record("at", at->node());
    }
    if (box) {
      const std::vector<ConfigValue> corners = box->AsList();
      if (corners.size() != 2) box->Fail("two corners are needed: [[x, y, z], [x, y, z]]");
      const Eigen::Vector3d low = ReadPlace(corners[0]);
      const Eigen::Vector3d high = ReadPlace(corners[1]);
      for (int corner = 0; corner < 8; ++corner) {
        requirement.places_in_base_m.emplace_back((corner & 1) == 0 ? low.x() : high.x(),
                                                  (corner & 2) == 0 ? low.y() : high.y(),
                                                  (corner & 4) == 0 ? low.z() : high.z());
      }
      requirement.text = "the corners of the box from " + PlaceText(low) + " to " + PlaceText(high);
      reader.Record("box", box->node());
    }
    if (!cameras.empty() && reader.Has("camera")) requirement.camera = reader.Choice("camera", cameras);
    reader.Finish();
    used.push_back(reader.used());
    requirements.push_back(std::move(requirement));
  }
  evaluate.Record("require", used);
  return requirements;
}

EvaluateSection ReadEvaluate(MapReader& root, const Problem& rig) {
  EvaluateSection section;
  MapReader reader = root.Section("evaluate");
  section.folds = reader.Int("folds", {0, 1000000}, 5);
  if (section.folds == 1) {
    reader.Get("folds").Fail("one fold leaves no training data; use 0 for none, or at least 2");
  }
  if (reader.Has("truth")) section.truth = reader.Path("truth");
  std::vector<std::string> cameras;
  if (!IsShort(rig)) {
    for (const ProblemCamera& camera : rig.cameras) cameras.push_back(camera.name);
  }
  section.requirements = ReadRequirements(reader, cameras);
  reader.Finish();
  root.Record("evaluate", reader.used());
  return section;
}

}  // namespace heba
