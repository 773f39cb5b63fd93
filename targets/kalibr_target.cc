#include "targets/kalibr_target.h"

#include <cmath>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {
namespace {

constexpr IntRange kCounts = {1, 1000};

YAML::Node Metres(MapReader& reader, const std::string& key) {
  const ConfigValue value = reader.Get(key);
  const double length_m = value.AsNumber();
  if (!(length_m > 0)) value.Fail("must be greater than zero");
  return QuantityNode(length_m, Quantity::kLength);
}

YAML::Node FromAprilgrid(MapReader& reader) {
  YAML::Node target;
  target["type"] = "apriltag_grid";
  target["family"] = "tag36h11";
  target["rows"] = reader.Get("tagRows").AsInt(kCounts);
  target["columns"] = reader.Get("tagCols").AsInt(kCounts);
  target["tag_size"] = Metres(reader, "tagSize");
  target["tag_spacing"] = RoundTrip(reader.Get("tagSpacing").AsNumber());
  target["border_bits"] = 2;
  target["corner_squares"] = true;
  return target;
}

YAML::Node FromCheckerboard(MapReader& reader) {
  YAML::Node target;
  target["type"] = "chessboard";
  target["rows"] = reader.Get("targetRows").AsInt(kCounts);
  target["columns"] = reader.Get("targetCols").AsInt(kCounts);
  const ConfigValue rows = reader.Get("rowSpacingMeters");
  if (rows.AsNumber() != reader.Get("colSpacingMeters").AsNumber()) {
    rows.Fail("differs from colSpacingMeters; the squares of a chessboard must be square");
  }
  target["square"] = Metres(reader, "rowSpacingMeters");
  return target;
}

YAML::Node FromCirclegrid(MapReader& reader) {
  YAML::Node target;
  target["type"] = "circle_grid";
  target["rows"] = reader.Get("targetRows").AsInt(kCounts);
  target["columns"] = reader.Get("targetCols").AsInt(kCounts);
  target["spacing"] = Metres(reader, "spacingMeters");
  const std::optional<ConfigValue> asymmetric = reader.Find("asymmetricGrid");
  // Python writes booleans as True and False.
  if (asymmetric) target["asymmetric"] = asymmetric->AsChoice({"true", "false", "True", "False"}).find("rue") == 1;
  return target;
}

struct KalibrType {
  const char* name;
  YAML::Node (*convert)(MapReader& reader);
};
constexpr KalibrType kTypes[] = {
    {"aprilgrid", &FromAprilgrid}, {"checkerboard", &FromCheckerboard}, {"circlegrid", &FromCirclegrid}};

}  // namespace

bool IsKalibrTarget(MapReader& reader) { return reader.Has("target_type"); }

ConfigValue FromKalibrTarget(MapReader& reader) {
  const std::string name = reader.Get("target_type").AsChoice(NamesOf(kTypes));
  const YAML::Node target = FindEntry(kTypes, name)->convert(reader);
  reader.Finish();
  return {target, reader.value().file(), reader.value().key()};
}

}  // namespace heba
