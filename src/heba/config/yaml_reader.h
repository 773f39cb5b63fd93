// A strict YAML reader. Every key must be known, every quantity needs a unit, and every fault is an InputError that
// starts with "file:line: key: ". All values that are read are recorded, defaults included, so that a run can save the
// config that it used.
//
//   MapReader reader(value);                       // must be a mapping
//   options.rows = reader.Int("rows", {1, 1000});  // required
//   options.gap_m = reader.Length("gap", 0.01);    // optional, with its default
//   reader.Finish();                               // unknown keys are errors, the nearest known one is suggested
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "heba/base/units.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// A range of integers, both ends included.
struct IntRange {
  int min;
  int max;
};

// A value of a config file, with its file and line. It may be stacked over other values: keys of the upper mapping
// replace those of the lower ones, and mappings are merged key by key. A key that is empty in an upper mapping
// (`truth:` or `truth: ~`) removes the values below it.
// NOLINTNEXTLINE(bugprone-exception-escape): a YAML::Node has no move assignment, and its copy assignment may throw.
class ConfigValue {
 public:
  ConfigValue(YAML::Node node, std::filesystem::path file, std::string key);
  // Stacks the first layer over the second, the second over the third and so on. `layers` must not be empty.
  static ConfigValue Stack(const std::vector<ConfigValue>& layers);
  // Returns this value without the layers below it.
  ConfigValue Top() const;
  // Returns this value with the layers below it, down to the first layer that has one of `keys` and including it. A
  // mapping that states its own `type`, for example, replaces everything below it.
  ConfigValue DownTo(const std::vector<std::string>& keys) const;
  // Returns this value and each of the layers below it as separate values.
  std::vector<ConfigValue> Layers() const;

  const YAML::Node& node() const { return node_; }
  const std::filesystem::path& file() const { return file_; }
  const std::string& key() const { return key_; }
  // Returns the beginning of messages: "cell.yaml:12: target.rows: ".
  std::string Where() const;
  // Throws InputError(Where() + fault).
  [[noreturn]] void Fail(const std::string& fault) const;

  bool IsMap() const { return node_.IsMap(); }
  bool IsList() const { return node_.IsSequence(); }
  bool IsText() const { return node_.IsScalar(); }

  std::string AsText() const;
  int AsInt(IntRange range) const;
  double AsNumber() const;  // Finite; without a unit.
  bool AsBool() const;
  double AsQuantity(Quantity quantity) const;  // Value in BaseUnit(quantity).
  // Returns the text, which must be one of `choices`.
  std::string AsChoice(const std::vector<std::string>& choices) const;
  // Returns a path. Relative paths are relative to the file that contains them. The path need not exist.
  std::filesystem::path AsPath() const;
  // Returns such a path. Throws InputError, with the key and the name that is likely meant, if nothing exists there.
  std::filesystem::path AsInputPath() const;
  std::vector<ConfigValue> AsList() const;
  Eigen::Vector3d AsVector3(Quantity quantity) const;  // The value must be a list of three quantities.

 private:
  YAML::Node node_;
  std::filesystem::path file_;
  std::string key_;
  std::vector<ConfigValue> below_;  // The layers below, the next one first; they have no layers themselves.
};

// Reads a file that contains one YAML document. Throws InputError on a syntax error, more than 100000 values (aliases
// are expanded), more than 32 levels or a file over 1 MiB.
ConfigValue ReadYamlFile(const std::filesystem::path& path);
// Parses text; `name` is the name of the file in messages.
ConfigValue ParseYaml(const std::string& text, const std::filesystem::path& name);

// Reads a file that may name another one, `base: other.yaml`, over which it is stacked; the base may name a third one.
// The top-level keys `own` are private to each file and are not taken from a base. Throws InputError also if a file is
// its own base.
ConfigValue ReadYamlFileOverBases(const std::filesystem::path& path, const std::vector<std::string>& own);

// Returns `settings` such as "refine.loss=none" as a mapping that can be stacked over a file. Paths in it are relative
// to the working folder. Throws InputError for a setting without a key or with invalid YAML.
ConfigValue ParseSettings(const std::vector<std::string>& settings);

// NOLINTNEXTLINE(bugprone-exception-escape): see ConfigValue.
class MapReader {
 public:
  // Throws InputError if `value` is not a mapping or contains a key twice.
  explicit MapReader(const ConfigValue& value);

  const ConfigValue& value() const { return value_; }
  bool Has(const std::string& key);
  // Returns the value of a required or of an optional key. The value is not recorded: the caller must record what it
  // reads from it.
  ConfigValue Get(const std::string& key);
  std::optional<ConfigValue> Find(const std::string& key);
  // Returns the reader of a mapping within this one. A mapping that is absent, or whose keys are all comments, is
  // empty.
  MapReader Section(const std::string& key);

  std::string Text(const std::string& key, const std::optional<std::string>& fallback = std::nullopt);
  int Int(const std::string& key, IntRange range, std::optional<int> fallback = std::nullopt);
  double Number(const std::string& key, std::optional<double> fallback = std::nullopt);
  bool Bool(const std::string& key, std::optional<bool> fallback = std::nullopt);
  double Length(const std::string& key, std::optional<double> fallback_m = std::nullopt);
  double Angle(const std::string& key, std::optional<double> fallback_rad = std::nullopt);
  double Pixels(const std::string& key, std::optional<double> fallback_px = std::nullopt);
  double QuantityOf(const std::string& key, Quantity quantity, std::optional<double> fallback = std::nullopt);
  // Reads a ratio that must not be negative: "0.1 %" or 0.001.
  double Ratio(const std::string& key, std::optional<double> fallback = std::nullopt);
  // Reads a length that must be at least 0.001 mm.
  double PositiveLength(const std::string& key, std::optional<double> fallback_m = std::nullopt);
  std::string Choice(const std::string& key, const std::vector<std::string>& choices,
                     const std::optional<std::string>& fallback = std::nullopt);
  std::filesystem::path Path(const std::string& key);
  std::filesystem::path InputPath(const std::string& key);  // ConfigValue::AsInputPath.

  // Records the value that was used for `key`.
  void Record(const std::string& key, const YAML::Node& used);
  // Throws InputError for keys that were never asked for.
  void Finish() const;
  // Returns the mapping as used, in the order in which it was read.
  const YAML::Node& used() const { return used_; }

 private:
  ConfigValue value_;
  std::vector<std::string> known_;
  YAML::Node used_;
};

// Reads a pose of heba's own files: {translation: [x, y, z] with units, rotation: [x, y, z, w] quaternion or rpy: [r,
// p, y] angles with units (R = Rz(y) Ry(p) Rx(r))}. The rotation is the identity if neither is given.
Rigid3d ReadPose(const ConfigValue& value);
YAML::Node PoseNode(const Rigid3d& pose);

// Returns a node that reads back as the same value: "0.04 m".
YAML::Node QuantityNode(double value, Quantity quantity);

}  // namespace heba
