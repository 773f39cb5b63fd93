#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/config/yaml_reader.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using testing::HasSubstr;
using testing::StartsWith;

std::string Dumped(const YAML::Node& node) {
  std::stringstream text;
  text << node;
  return text.str();
}

TEST(MapReaderTest, ReadsEveryKind) {
  MapReader reader(
      ParseYaml("{text: hello, int: 4, number: 0.25, yes: true, length: 40 mm, angle: 90 deg, px: 0.3 px,"
                " grey: 2 grey, choice: b, path: ../x/poses.csv, list: [1 mm, 2 m, -3 cm]}",
                "dir/cell.yaml"));
  EXPECT_EQ(reader.Text("text"), "hello");
  EXPECT_EQ(reader.Int("int", {1, 4}), 4);
  EXPECT_EQ(reader.Number("number"), 0.25);
  EXPECT_TRUE(reader.Bool("yes"));
  EXPECT_NEAR(reader.Length("length"), 0.04, 1e-15);
  EXPECT_NEAR(reader.Angle("angle"), 1.5707963267948966, 1e-15);
  EXPECT_EQ(reader.Pixels("px"), 0.3);
  EXPECT_EQ(reader.QuantityOf("grey", Quantity::kGreyLevels), 2);
  EXPECT_EQ(reader.Choice("choice", {"a", "b"}), "b");
  EXPECT_EQ(reader.Get("path").AsPath(), "x/poses.csv");
  EXPECT_LT((reader.Get("list").AsVector3(Quantity::kLength) - Eigen::Vector3d(0.001, 2, -0.03)).norm(), 1e-15);
  reader.Finish();
}

TEST(MapReaderTest, UsesDefaultsAndRecordsThem) {
  MapReader reader(ParseYaml("length: 40 mm\n", "cell.yaml"));
  EXPECT_EQ(reader.Int("count", {0, 10}, 3), 3);
  EXPECT_NEAR(reader.Length("length", 1.0), 0.04, 1e-15);
  EXPECT_EQ(reader.Length("gap", 0.01), 0.01);
  EXPECT_EQ(reader.Choice("loss", {"none", "huber"}, "huber"), "huber");
  EXPECT_FALSE(reader.Bool("flag", false));
  EXPECT_FALSE(reader.Find("absent").has_value());
  reader.Finish();
  EXPECT_EQ(Dumped(reader.used()), "count: 3\nlength: 40 mm\ngap: 10 mm\nloss: huber\nflag: false");
}

TEST(MapReaderTest, UsedValuesReadBackUnchanged) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const double angle_rad = rng.Normal();
    const double number = rng.Normal() * 1e-5;
    MapReader reader(ParseYaml("{}", "a.yaml"));
    reader.Angle("angle", angle_rad);
    reader.Number("number", number);
    MapReader again(ParseYaml(Dumped(reader.used()), "b.yaml"));
    EXPECT_EQ(again.Angle("angle"), angle_rad);
    EXPECT_EQ(again.Number("number"), number);
  }
}

// Returns the message of the InputError that is thrown when `read` reads `text`.
template <class Read>
std::string ErrorOf(const std::string& text, const Read& read) {
  return InputErrorOf([&] {
    MapReader reader(ParseYaml(text, "cell.yaml"));
    read(reader);
    reader.Finish();
  });
}

TEST(MapReaderTest, SuggestsTheNearestKeyForUnknownKeys) {
  const std::string error = ErrorOf("rows: 2\ncolums: 3\n", [](MapReader& reader) {
    reader.Int("rows", {1, 9});
    reader.Int("columns", {1, 9}, 2);
  });
  EXPECT_EQ(error, "cell.yaml:2: unknown key 'colums'; did you mean 'columns'?; known here: rows, columns");
}

TEST(MapReaderTest, MissingKeysAreErrors) {
  EXPECT_THAT(ErrorOf("rows: 2\n",
                      [](MapReader& reader) {
                        reader.Int("columns", {1, 9});
                      }),
              HasSubstr("cell.yaml:1: 'columns' is missing"));
  EXPECT_THAT(ErrorOf("a:\n  rows: 2\n",
                      [](MapReader& reader) {
                        MapReader(reader.Get("a")).Int("columns", {1, 9});
                      }),
              HasSubstr("cell.yaml:2: a: 'columns' is missing"));
  EXPECT_THAT(ErrorOf("colums: 2\n",
                      [](MapReader& reader) {
                        reader.Int("columns", {1, 9});
                      }),
              HasSubstr("cell.yaml:1: 'columns' is missing; is 'colums' meant to be it?"));
}

TEST(MapReaderTest, RefusesDuplicateKeys) {
  EXPECT_THAT(ErrorOf("rows: 2\nother: 1\nrows: 3\n",
                      [](MapReader& reader) {
                        reader.Int("rows", {1, 9});
                      }),
              StartsWith("cell.yaml:3: 'rows' occurs twice"));
}

TEST(MapReaderTest, QuantitiesNeedUnits) {
  EXPECT_EQ(ErrorOf("\nspacing: 40\n", [](MapReader& reader) { reader.Length("spacing"); }),
            "cell.yaml:2: spacing: '40' has no unit; write a length such as '40 mm'");
  EXPECT_THAT(ErrorOf("spacing: 40 deg", [](MapReader& reader) { reader.Length("spacing"); }),
              HasSubstr("cell.yaml:1: spacing: '40 deg' has the unit 'deg'"));
  EXPECT_THAT(ErrorOf("spacing: [1 mm]", [](MapReader& reader) { reader.Length("spacing"); }),
              HasSubstr("a length such as '40 mm' is needed, not a list"));
  EXPECT_THAT(ErrorOf("spacing: 0 mm", [](MapReader& reader) { reader.PositiveLength("spacing"); }),
              HasSubstr("cell.yaml:1: spacing: must be greater than zero"));
}

TEST(MapReaderTest, WrongTypesAreErrors) {
  const auto int_error = [](const char* text) {
    return ErrorOf(text, [](MapReader& reader) { reader.Int("n", {1, 100}); });
  };
  EXPECT_THAT(int_error("n: two"), HasSubstr("n: a whole number is needed, not 'two'"));
  EXPECT_THAT(int_error("n: 2.0"), HasSubstr("a whole number is needed, not '2.0'"));
  EXPECT_THAT(int_error("n: 2 mm"), HasSubstr("a whole number is needed"));
  EXPECT_THAT(int_error("n: 99999999999999999999"), HasSubstr("a whole number is needed"));
  EXPECT_THAT(int_error("n: 101"), HasSubstr("101 is out of range; from 1 to 100 is possible"));
  EXPECT_THAT(int_error("n: {a: 1}"), HasSubstr("not a mapping"));
  EXPECT_THAT(int_error("n:"), HasSubstr("not nothing"));
  EXPECT_THAT(ErrorOf("x: nan", [](MapReader& reader) { reader.Number("x"); }), HasSubstr("not finite"));
  EXPECT_THAT(ErrorOf("x: yes", [](MapReader& reader) { reader.Bool("x"); }),
              HasSubstr("true or false is needed, not 'yes'"));
  EXPECT_THAT(ErrorOf("x: [a]", [](MapReader& reader) { reader.Text("x"); }), HasSubstr("a text is needed"));
  EXPECT_THAT(ErrorOf("x: a", [](MapReader& reader) { reader.Get("x").AsList(); }), HasSubstr("a list is needed"));
  EXPECT_THAT(ErrorOf("x: [1 m]", [](MapReader& reader) { reader.Get("x").AsVector3(Quantity::kLength); }),
              HasSubstr("three values are needed, not 1"));
  EXPECT_THAT(ErrorOf("loss: hubber",
                      [](MapReader& reader) {
                        reader.Choice("loss", {"none", "huber"});
                      }),
              HasSubstr("cell.yaml:1: loss: 'hubber' is unknown; did you mean 'huber'? One of: none, huber"));
}

TEST(YamlTest, TheRootMustBeAMapping) {
  for (const char* text : {"", "# only a comment", "[1, 2]", "word", "~"}) {
    EXPECT_THAT(ErrorOf(text, [](MapReader&) {}), HasSubstr("a mapping is needed")) << text;
  }
}

TEST(YamlTest, SyntaxErrorsNameTheLine) {
  EXPECT_THAT(ErrorOf("a: 1\nb: [1, 2\n", [](MapReader&) {}), StartsWith("cell.yaml:3: not valid YAML"));
  EXPECT_THAT(ErrorOf("a: \"x", [](MapReader&) {}), StartsWith("cell.yaml:1: not valid YAML"));
  EXPECT_THAT(ErrorOf("a: 1\n---\nb: 2\n", [](MapReader&) {}),
              StartsWith("cell.yaml:2: a second YAML document starts here"));
  // The function LoadAll of yaml-cpp itself does not terminate on these inputs.
  EXPECT_THAT(ErrorOf(", a: 1\n", [](MapReader&) {}), StartsWith("cell.yaml:1: not valid YAML"));
  EXPECT_THAT(ErrorOf("}", [](MapReader&) {}), StartsWith("cell.yaml:1: not valid YAML"));
  EXPECT_THAT(ErrorOf("? [1, 2]\n: 3\n", [](MapReader&) {}), HasSubstr("keys must be plain names"));
}

TEST(YamlTest, AliasBombsAreRefused) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    const std::string alias = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + alias;
    for (int k = 0; k < 9; ++k) bomb += ", " + alias;
    bomb += "]\n";
  }
  EXPECT_THAT(ErrorOf(bomb, [](MapReader&) {}), HasSubstr("more than 100000 values"));
  EXPECT_THAT(ErrorOf("a: &a [*a, *a]", [](MapReader&) {}), HasSubstr("nested deeper than 32 levels"));
  EXPECT_THAT(ErrorOf("a: &a {b: *a}", [](MapReader&) {}), HasSubstr("nested deeper than 32 levels"));
}

TEST(YamlTest, DeepNestingIsRefused) {
  EXPECT_THAT(ErrorOf("a: " + std::string(40, '[') + std::string(40, ']'), [](MapReader&) {}),
              HasSubstr("nested deeper than 32 levels"));
  EXPECT_THAT(ErrorOf("a: " + std::string(100000, '['), [](MapReader&) {}), StartsWith("cell.yaml:"));
  EXPECT_THAT(ErrorOf("a: " + std::string(100000, '{'), [](MapReader&) {}), StartsWith("cell.yaml:"));
  EXPECT_THAT(ErrorOf(std::string(1000, '-') + "x", [](MapReader&) {}), StartsWith("cell.yaml"));
}

TEST(YamlTest, FilesAreReadWithinALimit) {
  const TempFolder folder;
  std::ofstream(folder / "large.yaml") << std::string((1 << 20) + 1, ' ');
  EXPECT_THAT(InputErrorOf([&] { ReadYamlFile(folder / "large.yaml"); }), HasSubstr("larger than 1 MiB"));
  std::ofstream(folder / "ok.yaml") << "\xEF\xBB\xBFpath: a.csv\r\nother: 1\r\n";
  MapReader reader(ReadYamlFile(folder / "ok.yaml"));
  EXPECT_EQ(reader.Get("path").AsPath(), folder / "a.csv");
  EXPECT_EQ(reader.Int("other", {0, 1}), 1);
}

// Any sequence of bytes gives either a value or an InputError whose message is one line.
TEST(YamlTest, AnyTextGivesAValueOrAnInputError) {
  const std::string valid = "a: [1 mm, {b: 2, 'c': \"d\"}]\nkey: &x |\n  text\nlist:\n  - *x\n  - !!tag y\n? z\n: 1\n";
  Rng rng(3);
  int num_valid = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string text = valid;
    for (int k = 0; k <= rng.Index(4); ++k) {
      const size_t at = static_cast<size_t>(rng.Index(static_cast<int>(text.size())));
      const char c = rng.Uniform() < 0.7 ? ":{}[]'\",#&*!-\n ?|>%"[rng.Index(19)] : static_cast<char>(rng.Index(256));
      if (rng.Uniform() < 0.5) {
        text[at] = c;
      } else {
        text.insert(at, 1, c);
      }
    }
    const std::string error = ErrorOf(text, [](MapReader& reader) {
      for (const char* key : {"a", "key", "list", "z"}) reader.Has(key);
    });
    if (error == "no error") {
      ++num_valid;
      continue;
    }
    EXPECT_THAT(error, StartsWith("cell.yaml:"));
    EXPECT_THAT(error, testing::Not(HasSubstr("\n"))) << text;
  }
  EXPECT_GT(num_valid, 100);
  EXPECT_LT(num_valid, 19000);
}

TEST(PoseYaml, RoundTrips) {
  Rng rng(2);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d rotation_vector = rng.NormalVector3();
    const Rigid3d pose(ExpRotation(rotation_vector), rng.NormalVector3());
    const Rigid3d read = ReadPose(ParseYaml(Dumped(PoseNode(pose)), "a.yaml"));
    EXPECT_EQ(DistanceM(read, pose), 0);
    // rad; the tolerance allows for the second normalisation of the quaternion.
    EXPECT_NEAR(AngleRad(read, pose), 0, 1e-15);
  }
}

TEST(PoseYaml, ReadsRollPitchYaw) {
  const Rigid3d pose = ReadPose(ParseYaml("{translation: [1 mm, 0 m, 0 m], rpy: [90 deg, 0 deg, 90 deg]}", "a.yaml"));
  // R = Rz(90) Rx(90) rotates z first to -y, then to x.
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_THAT(
      InputErrorOf([] { ReadPose(ParseYaml("{translation: [0 m, 0 m, 0 m], rotation: [1, 1, 0, 0]}", "a.yaml")); }),
      HasSubstr("a.yaml:1: rotation: the quaternion's length is not 1"));
}

TEST(LayersTest, UpperLayersOverrideKeysAndMergeMappings) {
  const ConfigValue upper = ParseYaml("{refine: {loss: none}, name: upper}", "a/upper.yaml");
  const ConfigValue lower = ParseYaml("{refine: {loss: huber, folds: 3}, poses: poses.csv}", "b/lower.yaml");
  MapReader reader(ConfigValue::Stack({upper, lower}));
  MapReader refine(reader.Get("refine"));
  EXPECT_EQ(refine.Text("loss"), "none");
  EXPECT_EQ(refine.Int("folds", {0, 9}), 3);
  refine.Finish();
  EXPECT_EQ(reader.Text("name"), "upper");
  // The path is relative to the folder of the file that contains it.
  EXPECT_EQ(reader.Get("poses").AsPath(), "b/poses.csv");
  reader.Finish();
}

TEST(LayersTest, EmptyKeysRemoveLowerValues) {
  const ConfigValue upper = ParseYaml("{truth: ~, refine: ~}", "upper.yaml");
  const ConfigValue lower = ParseYaml("{truth: truth.json, refine: {loss: huber}}", "lower.yaml");
  MapReader reader(ConfigValue::Stack({upper, lower}));
  EXPECT_FALSE(reader.Has("truth"));
  EXPECT_FALSE(reader.Has("refine"));
}

// The upper file replaces a chessboard by a ChArUco target and --set changes one of its keys: no key of the
// chessboard remains.
TEST(LayersTest, AMappingWithATypeReplacesLowerLayers) {
  const ConfigValue set = ParseYaml("{target: {square: 21 mm}}", "--set");
  const ConfigValue upper = ParseYaml("{target: {type: charuco, rows: 5}}", "upper.yaml");
  const ConfigValue lower = ParseYaml("{target: {type: chessboard, square: 20 mm, columns: 9}}", "lower.yaml");
  MapReader reader(ConfigValue::Stack({set, upper, lower}));
  MapReader target(reader.Get("target").DownTo({"type"}));
  EXPECT_EQ(target.Text("type"), "charuco");
  EXPECT_NEAR(target.Length("square"), 0.021, 1e-12);
  EXPECT_EQ(target.Int("rows", {1, 9}), 5);
  EXPECT_FALSE(target.Has("columns"));
}

TEST(LayersTest, FaultsNameTheirFile) {
  const ConfigValue upper = ParseYaml("{a: 1}", "upper.yaml");
  const ConfigValue lower = ParseYaml("{a: 2,\n b: x,\n c: 3}", "lower.yaml");
  MapReader reader(ConfigValue::Stack({upper, lower}));
  reader.Int("a", {0, 9});
  EXPECT_THAT(InputErrorOf([&] { reader.Int("b", {0, 9}); }), StartsWith("lower.yaml:2: b: "));
  EXPECT_THAT(InputErrorOf([&] { reader.Finish(); }), StartsWith("lower.yaml:3: unknown key 'c'"));
}

TEST(LayersTest, WhatIsMissingIsMissingInTheFile) {
  const ConfigValue file = ParseYaml("name: cell", "cell.yaml");
  EXPECT_THAT(InputErrorOf([&] {
                MapReader(ConfigValue::Stack({ParseSettings({"seed=1"}), file})).Get("captures");
              }),
              HasSubstr("cell.yaml:1: 'captures' is missing"));
  EXPECT_THAT(InputErrorOf([&] { MapReader(ParseSettings({"seed=1"})).Get("captures"); }),
              HasSubstr("--set: 'captures' is missing"));
}

TEST(LayersTest, ReadsBasesWithoutTheirOwnKeys) {
  const TempFolder folder;
  std::ofstream(folder / "one.yaml") << "{base: two.yaml, a: 1}";
  std::ofstream(folder / "two.yaml") << "{base: three.yaml, a: 2, b: 2, name: two}";
  std::ofstream(folder / "three.yaml") << "{b: 3, c: 3}";
  std::ofstream(folder / "loop.yaml") << "{base: loop.yaml}";
  MapReader reader(ReadYamlFileOverBases(folder / "one.yaml", {"name"}));
  EXPECT_EQ(reader.Int("a", {0, 9}), 1);
  EXPECT_EQ(reader.Int("b", {0, 9}), 2);
  EXPECT_EQ(reader.Int("c", {0, 9}), 3);
  EXPECT_FALSE(reader.Has("name"));
  reader.Finish();
  EXPECT_THAT(InputErrorOf([&] { ReadYamlFileOverBases(folder / "loop.yaml", {}); }),
              HasSubstr("cannot be its own base"));
}

TEST(LayersTest, SettingsAreMappings) {
  MapReader reader(ParseSettings({"refine.loss=none", "refine.free=[a, b]", "folds=4"}));
  MapReader refine(reader.Get("refine"));
  EXPECT_EQ(refine.Text("loss"), "none");
  EXPECT_EQ(refine.Get("free").AsList().size(), 2U);
  EXPECT_EQ(reader.Int("folds", {0, 9}), 4);
  EXPECT_THAT(InputErrorOf([] { ParseSettings({"=1"}); }), HasSubstr("needs KEY=VALUE"));
}

}  // namespace
}  // namespace heba
