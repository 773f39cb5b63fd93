#include "heba/config/yaml_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>

#include <yaml-cpp/eventhandler.h>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {
namespace {

// The name of settings in messages, in place of a file's.
constexpr const char* kSettings = "--set";

std::string Shown(const YAML::Node& node) {
  if (node.IsScalar()) return Quoted(node.Scalar());
  if (node.IsSequence()) return "a list";
  if (node.IsMap()) return "a mapping";
  return "nothing";
}

// The messages of yaml-cpp may contain control characters from the file.
std::string OneLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  return text;
}

// Returns what a node leaves of the `budget` of values. Throws InputError if it has more, or if it is too deep. Nodes
// of aliases are shared in yaml-cpp, so a file with nested aliases (an alias bomb) could take forever to traverse; a
// config needs few values.
int BudgetAfter(const YAML::Node& node, int depth, int budget, const std::filesystem::path& name) {
  constexpr int kMaxDepth = 32;
  if (--budget < 0) throw InputError(name.string() + ": more than 100000 values; a config needs a few dozen");
  if (depth > kMaxDepth) throw InputError(name.string() + ": nested deeper than 32 levels");
  if (node.IsMap()) {
    for (const auto& entry : node) budget = BudgetAfter(entry.second, depth + 1, budget, name);
  } else if (node.IsSequence()) {
    for (const auto& item : node) budget = BudgetAfter(item, depth + 1, budget, name);
  }
  return budget;
}

// An event handler that records the positions at which documents start.
class DocumentStarts final : public YAML::EventHandler {
 public:
  std::vector<YAML::Mark> marks;
  void OnDocumentStart(const YAML::Mark& mark) override { marks.push_back(mark); }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

// YAML::LoadAll does not terminate on text such as ", a: 1", because the parser finds a document there without moving
// on.
void CheckOneDocument(const std::string& text, const std::filesystem::path& name) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  DocumentStarts starts;
  if (!parser.HandleNextDocument(starts) || !parser.HandleNextDocument(starts)) return;
  const YAML::Mark& second = starts.marks.back();
  const bool moved_on = second.pos != starts.marks.front().pos;
  throw InputError(name.string() + ":" + std::to_string(second.line + 1) + ": " +
                   (moved_on ? "a second YAML document starts here; one is needed"
                             : "not valid YAML (a key, a value or a list is needed here)"));
}

// Throws InputError unless all keys are scalars and occur only once.
void CheckKeys(const ConfigValue& mapping) {
  std::set<std::string> seen;
  for (const auto& entry : mapping.node()) {
    if (!entry.first.IsScalar()) mapping.Fail("keys must be plain names");
    if (!seen.insert(entry.first.Scalar()).second) {
      ConfigValue(entry.first, mapping.file(), mapping.key()).Fail(Shown(entry.first) + " occurs twice");
    }
  }
}

}  // namespace

ConfigValue::ConfigValue(YAML::Node node, std::filesystem::path file, std::string key)
    : node_(node), file_(std::move(file)), key_(std::move(key)) {}

// A YAML::Node is a reference: assigning to it would change the file's own node. Values are therefore copied and
// appended, never assigned.
ConfigValue ConfigValue::Stack(const std::vector<ConfigValue>& layers) {
  CHECK(!layers.empty());
  ConfigValue all = layers.front();
  for (size_t i = 1; i < layers.size(); ++i) {
    for (const ConfigValue& layer : layers[i].Layers()) all.below_.push_back(layer);
  }
  return all;
}

std::vector<ConfigValue> ConfigValue::Layers() const {
  std::vector<ConfigValue> layers = {Top()};
  for (const ConfigValue& layer : below_) layers.push_back(layer);
  return layers;
}

ConfigValue ConfigValue::DownTo(const std::vector<std::string>& keys) const {
  ConfigValue some = Top();
  const auto has_key = [&](const ConfigValue& layer) {
    return !layer.IsMap() ||
           std::any_of(keys.begin(), keys.end(), [&](const std::string& key) { return layer.node()[key].IsDefined(); });
  };
  for (size_t i = 0; i < below_.size(); ++i) {
    if (has_key(i == 0 ? *this : below_[i - 1])) break;
    some.below_.push_back(below_[i]);
  }
  return some;
}

ConfigValue ConfigValue::Top() const { return {node_, file_, key_}; }

std::string ConfigValue::Where() const {
  std::string where = file_.string();
  const YAML::Mark mark = node_.Mark();
  if (mark.line >= 0) where += ":" + std::to_string(mark.line + 1);
  return where + ": " + (key_.empty() ? "" : key_ + ": ");
}

void ConfigValue::Fail(const std::string& fault) const { throw InputError(Where() + fault); }

std::string ConfigValue::AsText() const {
  if (!IsText() || node_.Scalar().empty()) Fail("a text is needed, not " + Shown(node_));
  return node_.Scalar();
}

int ConfigValue::AsInt(IntRange range) const {
  const std::string text = IsText() ? node_.Scalar() : "";
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) {
    Fail("a whole number is needed, not " + Shown(node_));
  }
  if (value < range.min || value > range.max) {
    Fail(std::to_string(value) + " is out of range; from " + std::to_string(range.min) + " to " +
         std::to_string(range.max) + " is possible");
  }
  return value;
}

double ConfigValue::AsNumber() const {
  double value = 0;
  if (!IsText() || !ParseDouble(node_.Scalar(), &value)) Fail("a number is needed, not " + Shown(node_));
  if (!std::isfinite(value)) Fail(Shown(node_) + " is not finite");
  return value;
}

bool ConfigValue::AsBool() const {
  if (IsText() && node_.Scalar() == "true") return true;
  if (IsText() && node_.Scalar() == "false") return false;
  Fail("true or false is needed, not " + Shown(node_));
}

double ConfigValue::AsQuantity(Quantity quantity) const {
  if (!IsText()) Fail(std::string(Example(quantity)) + " is needed, not " + Shown(node_));
  const ParsedQuantity parsed = ParseQuantity(node_.Scalar(), quantity);
  if (!parsed.fault.empty()) Fail(parsed.fault);
  return parsed.value;
}

std::string ConfigValue::AsChoice(const std::vector<std::string>& choices) const {
  if (IsText() && std::find(choices.begin(), choices.end(), node_.Scalar()) != choices.end()) return node_.Scalar();
  if (IsText()) Fail(UnknownName(node_.Scalar(), choices));
  Fail(Shown(node_) + " is unknown; one of: " + Join(choices, ", "));
}

std::filesystem::path ConfigValue::AsPath() const {
  return (file_.parent_path() / std::filesystem::path(AsText())).lexically_normal();
}

std::filesystem::path ConfigValue::AsInputPath() const {
  const std::filesystem::path path = AsPath();
  std::error_code error;
  if (!std::filesystem::exists(path, error)) Fail(path.string() + ": there is no such file" + FileMeant(path));
  return path;
}

std::vector<ConfigValue> ConfigValue::AsList() const {
  if (!IsList()) Fail("a list is needed, not " + Shown(node_));
  std::vector<ConfigValue> items;
  for (size_t i = 0; i < node_.size(); ++i) items.emplace_back(node_[i], file_, key_ + "[" + std::to_string(i) + "]");
  return items;
}

Eigen::Vector3d ConfigValue::AsVector3(Quantity quantity) const {
  const std::vector<ConfigValue> items = AsList();
  if (items.size() != 3) Fail("three values are needed, not " + std::to_string(items.size()));
  return {items[0].AsQuantity(quantity), items[1].AsQuantity(quantity), items[2].AsQuantity(quantity)};
}

ConfigValue ParseYaml(const std::string& text, const std::filesystem::path& name) {
  if (text.find('\0') != std::string::npos) {
    throw InputError(name.string() + ": contains NUL characters (UTF-16?); save it as UTF-8");
  }
  try {
    CheckOneDocument(text, name);
    const YAML::Node root = YAML::Load(text);
    BudgetAfter(root, 0, 100000, name);
    return {root, name, ""};
  } catch (const YAML::Exception& error) {
    throw InputError(name.string() + ":" + std::to_string(error.mark.line + 1) + ": not valid YAML (" +
                     OneLine(error.msg) + ")");
  }
}

ConfigValue ReadYamlFile(const std::filesystem::path& path) { return ParseYaml(ReadTextFile(path, 1 << 20), path); }

ConfigValue ReadYamlFileOverBases(const std::filesystem::path& path, const std::vector<std::string>& own) {
  std::vector<ConfigValue> files;
  std::set<std::filesystem::path> seen;
  std::filesystem::path next = path;
  while (true) {
    const ConfigValue value = ReadYamlFile(next);
    std::error_code error;
    seen.insert(std::filesystem::weakly_canonical(next, error));
    YAML::Node node = value.node();
    if (!node.IsMap()) value.Fail("a mapping is needed, not " + Shown(node));
    const YAML::Node base = std::as_const(node)["base"];
    const bool has_base = base.IsDefined();
    const ConfigValue base_value(has_base ? base : YAML::Node(), next, "base");
    if (has_base) next = base_value.AsPath();
    node.remove("base");
    if (!files.empty()) {
      for (const std::string& key : own) node.remove(key);
    }
    files.push_back(value);
    if (!has_base) break;
    if (seen.count(std::filesystem::weakly_canonical(next, error)) > 0)
      base_value.Fail("a file cannot be its own base");
  }
  return ConfigValue::Stack(files);
}

ConfigValue ParseSettings(const std::vector<std::string>& settings) {
  YAML::Node root(YAML::NodeType::Map);
  for (const std::string& setting : settings) {
    const size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw InputError("--set needs KEY=VALUE, such as refine.loss=none, not " + Quoted(setting));
    }
    const YAML::Node parsed = ParseYaml(setting.substr(equals + 1), "--set " + setting.substr(0, equals)).node();
    YAML::Node place;
    place.reset(root);
    const std::vector<std::string> keys = Split(setting.substr(0, equals), '.');
    for (size_t i = 0; i + 1 < keys.size(); ++i) {
      YAML::Node inner = place[keys[i]];
      if (!inner.IsMap()) inner = YAML::Node(YAML::NodeType::Map);
      place.reset(inner);
    }
    // A scalar is recreated, so that it has no line number: the setting does not come from a file.
    place[keys.back()] = parsed.IsScalar() ? YAML::Node(parsed.Scalar()) : parsed;
  }
  return {root, kSettings, ""};
}

MapReader::MapReader(const ConfigValue& value) : value_(value), used_(YAML::NodeType::Map) {
  if (!value.IsMap()) value.Fail("a mapping is needed, not " + Shown(value.node()));
  for (const ConfigValue& layer : value.Layers()) CheckKeys(layer);
}

bool MapReader::Has(const std::string& key) { return Find(key).has_value(); }

namespace {

// Returns the question whether a key of a mapping that is not among the known ones is the one that is missing; an empty
// string if none is similar.
std::string WhetherMisspelt(const std::string& missing, const ConfigValue& mapping,
                            const std::vector<std::string>& known) {
  for (const ConfigValue& layer : mapping.Layers()) {
    for (const auto& entry : layer.node()) {
      const std::string& key = entry.first.Scalar();
      const bool is_known = std::find(known.begin(), known.end(), key) != known.end();
      if (!is_known && !DidYouMean(key, {missing}).empty()) return "; is " + Quoted(key) + " meant to be it?";
    }
  }
  return "";
}

}  // namespace

ConfigValue MapReader::Get(const std::string& key) {
  const std::optional<ConfigValue> found = Find(key);
  if (found) return *found;
  // A key that no layer has is missing in the file, not in the settings above it.
  const std::vector<ConfigValue> layers = value_.Layers();
  const auto file =
      std::find_if(layers.begin(), layers.end(), [](const ConfigValue& layer) { return layer.file() != kSettings; });
  (file == layers.end() ? value_ : *file).Fail("'" + key + "' is missing" + WhetherMisspelt(key, value_, known_));
}

std::optional<ConfigValue> MapReader::Find(const std::string& key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  const std::string full_key = value_.key().empty() ? key : value_.key() + "." + key;
  std::vector<ConfigValue> found;
  const std::vector<ConfigValue> layers = value_.Layers();
  for (const ConfigValue& layer : layers) {
    const YAML::Node node = layer.node()[key];
    if (!node.IsDefined()) continue;
    if (node.IsNull() && layers.size() > 1) break;
    found.emplace_back(node, layer.file(), full_key);
    // Only mappings are merged with the layers below.
    if (!node.IsMap()) {
      if (found.size() > 1) found.pop_back();
      break;
    }
  }
  if (found.empty()) return std::nullopt;
  return ConfigValue::Stack(found);
}

MapReader MapReader::Section(const std::string& key) {
  const std::optional<ConfigValue> found = Find(key);
  if (found && !found->node().IsNull()) return MapReader(*found);
  const std::string full_key = value_.key().empty() ? key : value_.key() + "." + key;
  return MapReader(ConfigValue(YAML::Node(YAML::NodeType::Map), value_.file(), full_key));
}

std::string MapReader::Text(const std::string& key, const std::optional<std::string>& fallback) {
  const std::optional<ConfigValue> found = fallback ? Find(key) : std::optional<ConfigValue>(Get(key));
  const std::string text = found ? found->AsText() : *fallback;
  Record(key, YAML::Node(text));
  return text;
}

int MapReader::Int(const std::string& key, IntRange range, std::optional<int> fallback) {
  const std::optional<ConfigValue> found = fallback ? Find(key) : std::optional<ConfigValue>(Get(key));
  const int number = found ? found->AsInt(range) : *fallback;
  Record(key, YAML::Node(number));
  return number;
}

double MapReader::Number(const std::string& key, std::optional<double> fallback) {
  const std::optional<ConfigValue> found = fallback ? Find(key) : std::optional<ConfigValue>(Get(key));
  const double number = found ? found->AsNumber() : *fallback;
  Record(key, YAML::Node(RoundTrip(number)));
  return number;
}

bool MapReader::Bool(const std::string& key, std::optional<bool> fallback) {
  const std::optional<ConfigValue> found = fallback ? Find(key) : std::optional<ConfigValue>(Get(key));
  const bool value = found ? found->AsBool() : *fallback;
  Record(key, YAML::Node(value));
  return value;
}

double MapReader::QuantityOf(const std::string& key, Quantity quantity, std::optional<double> fallback) {
  const std::optional<ConfigValue> found = fallback ? Find(key) : std::optional<ConfigValue>(Get(key));
  const double value = found ? found->AsQuantity(quantity) : *fallback;
  Record(key, QuantityNode(value, quantity));
  return value;
}

double MapReader::Length(const std::string& key, std::optional<double> fallback_m) {
  return QuantityOf(key, Quantity::kLength, fallback_m);
}
double MapReader::Angle(const std::string& key, std::optional<double> fallback_rad) {
  return QuantityOf(key, Quantity::kAngle, fallback_rad);
}
double MapReader::Pixels(const std::string& key, std::optional<double> fallback_px) {
  return QuantityOf(key, Quantity::kPixels, fallback_px);
}

double MapReader::Ratio(const std::string& key, std::optional<double> fallback) {
  const double ratio = QuantityOf(key, Quantity::kRatio, fallback);
  if (ratio < 0) Get(key).Fail("must not be negative");
  return ratio;
}

double MapReader::PositiveLength(const std::string& key, std::optional<double> fallback_m) {
  const double length_m = Length(key, fallback_m);
  if (!(length_m > 0)) Get(key).Fail("must be greater than zero");
  constexpr double kLeastM = 1e-6;
  if (length_m < kLeastM) Get(key).Fail("must be at least 0.001 mm");
  return length_m;
}

std::string MapReader::Choice(const std::string& key, const std::vector<std::string>& choices,
                              const std::optional<std::string>& fallback) {
  const std::optional<ConfigValue> found = fallback ? Find(key) : std::optional<ConfigValue>(Get(key));
  const std::string choice = found ? found->AsChoice(choices) : *fallback;
  Record(key, YAML::Node(choice));
  return choice;
}

std::filesystem::path MapReader::Path(const std::string& key) {
  const std::filesystem::path path = Get(key).AsPath();
  Record(key, YAML::Node(std::filesystem::absolute(path).lexically_normal().string()));
  return path;
}

std::filesystem::path MapReader::InputPath(const std::string& key) {
  Get(key).AsInputPath();
  return Path(key);
}

void MapReader::Record(const std::string& key, const YAML::Node& used) { used_[key] = used; }

void MapReader::Finish() const {
  for (const ConfigValue& layer : value_.Layers()) {
    for (const auto& entry : layer.node()) {
      const std::string& key = entry.first.Scalar();
      if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
      ConfigValue(entry.first, layer.file(), layer.key())
          .Fail("unknown key " + Quoted(key) + DidYouMean(key, known_) + "; known here: " + Join(known_, ", "));
    }
  }
}

Rigid3d ReadPose(const ConfigValue& value) {
  MapReader reader(value);
  const Eigen::Vector3d translation = reader.Get("translation").AsVector3(Quantity::kLength);
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  if (const std::optional<ConfigValue> quaternion = reader.Find("rotation")) {
    const std::vector<ConfigValue> items = quaternion->AsList();
    if (items.size() != 4) quaternion->Fail("a quaternion has four numbers, x, y, z, w");
    rotation = Eigen::Quaterniond(items[3].AsNumber(), items[0].AsNumber(), items[1].AsNumber(), items[2].AsNumber());
    if (std::abs(rotation.norm() - 1.0) > 1e-3) quaternion->Fail("the quaternion's length is not 1");
  } else if (const std::optional<ConfigValue> rpy = reader.Find("rpy")) {
    const Eigen::Vector3d angles = rpy->AsVector3(Quantity::kAngle);
    rotation = Eigen::AngleAxisd(angles.z(), Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
               Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX());
  }
  reader.Finish();
  return {rotation, translation};
}

YAML::Node PoseNode(const Rigid3d& pose) {
  YAML::Node node(YAML::NodeType::Map);
  for (int i = 0; i < 3; ++i) node["translation"].push_back(QuantityNode(pose.translation[i], Quantity::kLength));
  for (const double q : {pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.rotation.w()}) {
    node["rotation"].push_back(RoundTrip(q));
  }
  return node;
}

YAML::Node QuantityNode(double value, Quantity quantity) {
  std::string text = Trim(RoundTrip(value) + " " + std::string(BaseUnit(quantity)));
  // 0.018000000000000002 m is what 18 mm is read as.
  constexpr double kPerM = 1e12;
  constexpr double kPerMm = 1e9;
  if (quantity == Quantity::kLength) {
    const std::string in_mm = RoundTrip(std::round(kPerM * value) / kPerMm) + " mm";
    const ParsedQuantity parsed = ParseQuantity(in_mm, quantity);
    if (parsed.fault.empty() && parsed.value == value && in_mm.size() < text.size()) text = in_mm;
  }
  return YAML::Node(text);
}

}  // namespace heba
