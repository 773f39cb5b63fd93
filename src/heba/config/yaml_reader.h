// Strict YAML. Every key must be known, every quantity has its unit, and every fault is an InputError that starts with
// "file:line: key: ". What is read, defaults included, is recorded, so that a run can write its config as used.
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

// A value at a place in a file, perhaps laid over others: of two mappings the upper one's keys count, and of keys that
// both have again the upper one's value, mappings key by key. A key that is empty (`truth:` or `truth: ~`) in an upper
// mapping takes away what lies below.
// NOLINTNEXTLINE(bugprone-exception-escape): a YAML::Node has no move assignment, and its copy assignment may throw.
class ConfigValue {
 public:
  ConfigValue(YAML::Node node, std::filesystem::path file, std::string key);
  // The first one laid over the second, that over the third ... `layers` must not be empty.
  static ConfigValue Stack(const std::vector<ConfigValue>& layers);
  // Without what lies below.
  ConfigValue Top() const;
  // Without what lies below the first mapping that has one of `keys`: what says what it is replaces all below.
  ConfigValue DownTo(const std::vector<std::string>& keys) const;
  // This one and what lies below, each alone.
  std::vector<ConfigValue> Layers() const;

  const YAML::Node& node() const { return node_; }
  const std::filesystem::path& file() const { return file_; }
  const std::string& key() const { return key_; }
  // "cell.yaml:12: target.rows: "
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
  double AsQuantity(Quantity quantity) const;  // In BaseUnit(quantity).
  // One of `choices`.
  std::string AsChoice(const std::vector<std::string>& choices) const;
  // Relative paths are relative to the file that names them. Whether it exists is not looked at.
  std::filesystem::path AsPath() const;
  std::vector<ConfigValue> AsList() const;
  Eigen::Vector3d AsVector3(Quantity quantity) const;  // A list of three quantities.

 private:
  YAML::Node node_;
  std::filesystem::path file_;
  std::string key_;
  std::vector<ConfigValue> below_;  // The next one first; they have nothing below themselves.
};

// Reads a file of one YAML document. InputError on a syntax error, an alias bomb or a file over 1 MiB.
ConfigValue ReadYamlFile(const std::filesystem::path& path);
// The same from text; `name` is what messages call it.
ConfigValue ParseYaml(const std::string& text, const std::filesystem::path& name);

// Reads a file that may name another one, `base: other.yaml`, which it is laid over, and that one a third. What is
// `own` to each file (keys at the top) is not taken from a base. InputError also if a file is its own base.
ConfigValue ReadYamlFileOverBases(const std::filesystem::path& path, const std::vector<std::string>& own);

// What `settings` such as "refine.loss=none" say, as a mapping to be laid over a file. Paths in it are relative to the
// working folder. InputError for one without a key or that is not YAML.
ConfigValue ParseSettings(const std::vector<std::string>& settings);

// NOLINTNEXTLINE(bugprone-exception-escape): as of ConfigValue.
class MapReader {
 public:
  // InputError if `value` is not a mapping or has a key twice.
  explicit MapReader(const ConfigValue& value);

  const ConfigValue& value() const { return value_; }
  bool Has(const std::string& key);
  // The value of a required or of an optional key, not recorded: what is read of it must be recorded by the caller.
  ConfigValue Get(const std::string& key);
  std::optional<ConfigValue> Find(const std::string& key);

  std::string Text(const std::string& key, const std::optional<std::string>& fallback = std::nullopt);
  int Int(const std::string& key, IntRange range, std::optional<int> fallback = std::nullopt);
  double Number(const std::string& key, std::optional<double> fallback = std::nullopt);
  bool Bool(const std::string& key, std::optional<bool> fallback = std::nullopt);
  double Length(const std::string& key, std::optional<double> fallback_m = std::nullopt);
  double Angle(const std::string& key, std::optional<double> fallback_rad = std::nullopt);
  double Pixels(const std::string& key, std::optional<double> fallback_px = std::nullopt);
  double QuantityOf(const std::string& key, Quantity quantity, std::optional<double> fallback = std::nullopt);
  // Reads a length that must be at least a thousandth of a millimetre.
  double PositiveLength(const std::string& key, std::optional<double> fallback_m = std::nullopt);
  std::string Choice(const std::string& key, const std::vector<std::string>& choices,
                     const std::optional<std::string>& fallback = std::nullopt);
  std::filesystem::path Path(const std::string& key);

  // Records what was used for `key`.
  void Record(const std::string& key, const YAML::Node& used);
  // InputError for keys that were never asked for.
  void Finish() const;
  // The mapping as used, in the order in which it was read.
  const YAML::Node& used() const { return used_; }

 private:
  ConfigValue value_;
  std::vector<std::string> known_;
  YAML::Node used_;
};

// A pose in heba's own files: {translation: [x, y, z] with units, rotation: [x, y, z, w] quaternion or rpy: [r, p, y]
// angles with units (R = Rz(y) Ry(p) Rx(r))}.
Rigid3d ReadPose(const ConfigValue& value);
YAML::Node PoseNode(const Rigid3d& pose);

// "40 mm" -> a node that reads back as the same value: "0.04 m".
YAML::Node QuantityNode(double value, Quantity quantity);

}  // namespace heba
