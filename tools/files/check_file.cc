#include "tools/files/check_file.h"

#include <cmath>

#include "heba/base/units.h"
#include "heba/camera/camera.h"
#include "heba/io/result_json.h"
#include "tools/text/check_text.h"

namespace heba {
namespace {

constexpr const char* kSchema = "heba/check/1";

// Returns the body that a change is one of, as files name it: camera, target, base or lens, and its name if it has one.
std::string BodyOf(const Problem& rig, const SessionChange& change) {
  if (change.part == ChangedPart::kBase) return "base " + rig.robots[change.index];
  const bool is_target = change.part == ChangedPart::kTarget || change.part == ChangedPart::kExchangedTarget;
  const std::string& name = is_target ? rig.targets[change.index].name : rig.cameras[change.index].name;
  const std::string kind = is_target ? "target" : change.part == ChangedPart::kLens ? "lens" : "camera";
  return name.empty() ? kind : kind + " " + name;
}

Json VectorOf(const Eigen::VectorXd& vector, double factor) {
  Json json = Json::array();
  for (const double value : vector) json.push_back(Finite(factor * value));
  return json;
}

Json ChangeJson(const Problem& rig, const SessionChange& change) {
  const Eigen::VectorXd sigmas = change.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  Json json{{"body", BodyOf(rig, change)}, {"side", SideOf(rig, change)}, {"p_value", Finite(change.p_value)}};
  json["exchanged"] = !IsMoved(change.part) && change.part != ChangedPart::kLens;
  if (!IsMoved(change.part)) {
    json["side"] = nullptr;
    json[change.part == ChangedPart::kExchangedTarget ? "scales" : "intrinsics"] = VectorOf(change.change, 1);
    json["sigma"] = VectorOf(sigmas, 1);
    return json;
  }
  json["translation_mm"] = VectorOf(change.change.head(3), 1000);
  json["rotation_deg"] = VectorOf(change.change.tail(3), RadToDeg(1));
  json["sigma_mm"] = VectorOf(sigmas.head(3), 1000);
  json["sigma_deg"] = VectorOf(sigmas.tail(3), RadToDeg(1));
  json["smallest_seen"] = Json{{"translation_mm", Finite(1000 * change.seen_m.value_or(0))},
                               {"rotation_deg", Finite(RadToDeg(change.seen_rad.value_or(0)))}};
  return json;
}

}  // namespace

std::string CheckToJson(const Problem& rig, const SessionCheck& check) {
  Json json{{"schema", kSchema},
            {"decision", DecisionOf(check)},
            {"p_value", Finite(check.p_value)},
            {"images", check.num_images},
            {"scatter", {{"ratio", Finite(check.scatter_ratio)}, {"p_value", Finite(check.scatter_p_value)}}}};
  json["contradicting"] = nullptr;
  if (check.contradicting) json["contradicting"] = rig.captures[*check.contradicting].name;
  json["body"] = nullptr;
  json["change"] = nullptr;
  if (DecisionOf(check) == "moved" && !check.contradicting) {
    json["body"] = BodyOf(rig, check.changes.front());
    json["change"] = ChangeJson(rig, check.changes.front());
  }
  json["changes"] = Json::array();
  for (const SessionChange& change : check.changes) json["changes"].push_back(ChangeJson(rig, change));
  return FileText(json);
}

std::string UndecidedToJson(const std::string& reason) {
  return FileText(Json{{"schema", kSchema}, {"decision", "undecided"}, {"reason", reason}});
}

}  // namespace heba
