// Replaces every number in every kind of file by extreme values. The program does its work or reports the error in
// one line; it neither ends by a signal nor hangs.
#include <algorithm>
#include <cctype>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/parallel.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

// AddressSanitizer reserves terabytes of addresses.
constexpr const char* kMemoryLimit = HEBA_SANITIZE ? "" : "ulimit -v 8000000; ";
namespace fs = std::filesystem;

const char* const kExtremes[] = {"1e300", "-1e300", "1e-308", "0", "-1", "nan", "1e9"};

// The position and length of a number in a text. Digits within names are not numbers.
struct Number {
  size_t at = 0;
  size_t size = 0;
};
std::vector<Number> NumbersOf(const std::string& text) {
  std::vector<Number> numbers;
  const auto is_part = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.'; };
  for (size_t at = 0; at < text.size(); ++at) {
    const char before = at == 0 ? ' ' : text[at - 1];
    const bool begins =
        std::isdigit(static_cast<unsigned char>(text[at])) != 0 ||
        (text[at] == '-' && at + 1 < text.size() && std::isdigit(static_cast<unsigned char>(text[at + 1])) != 0);
    if (!begins || std::isalnum(static_cast<unsigned char>(before)) != 0 || before == '_' || before == '.') continue;
    size_t end = at + 1;
    while (end < text.size() && is_part(text[end])) ++end;
    if (end + 1 < text.size() && text[end] == 'e') {
      end += 2;
      while (end < text.size() && is_part(text[end])) ++end;
    }
    numbers.push_back({at, end - at});
    at = end;
  }
  return numbers;
}

// One file of a good set, and the command that reads it.
struct Subject {
  std::string name;
  fs::path file;
  std::vector<std::string> command;  // FILE stands for the spoiled file, FOLDER for its folder.
  size_t stride = 1;                 // Every `stride`-th spoiling only, because the others are similar.
  fs::path beside = {};              // A folder whose files the command needs next to the spoiled one.
};

struct Case {
  const Subject* subject = nullptr;
  std::string text;
  std::string what;
};

class ExtremesTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    root_ = new fs::path(TestFolder("extremes"));
    WriteAll(*root_ / "scene.yaml", kScene);
    ASSERT_EQ(
        RunHeba({"simulate", (*root_ / "scene.yaml").string(), "--out", (*root_ / "good").string(), "--quiet"}).status,
        0);
    ASSERT_EQ(
        RunHeba({"run", (*root_ / "good/config.yaml").string(), "--out", (*root_ / "run").string(), "--quiet"}).status,
        0);
    // This study is as small as possible.
    WriteAll(*root_ / "study.yaml",
             "trials: 2\nseed: 1\nscenes: {a: " + (*root_ / "scene.yaml").string() +
                 "}\npixel_noise: [0.1 px]\nrobot_noise: [{translation: 0.1 mm, rotation: 0.01 deg}]\n"
                 "target_shape: [{scale_x: 1.001, bend_x: 1 mm}]\noutlier_points: [0.01]\n");
  }
  static void TearDownTestSuite() {
    fs::remove_all(*root_);
    delete root_;
  }

  // Spoils the numbers of the subject one by one.
  static void Try(const Subject& subject) {
    const std::string good = ReadAll(subject.file);
    std::vector<Case> cases;
    size_t count = 0;
    for (const Number& number : NumbersOf(good)) {
      for (const char* extreme : kExtremes) {
        if (count++ % subject.stride != 0) continue;
        std::string text = good;
        text.replace(number.at, number.size, extreme);
        const size_t line = good.rfind('\n', number.at) + 1;
        cases.push_back({&subject, std::move(text),
                         subject.name + ": " + extreme + " for " + good.substr(number.at, number.size) + " in '" +
                             good.substr(line, good.find('\n', line) - line) + "'"});
      }
    }
    EXPECT_GT(cases.size(), 5U) << subject.name;
    std::vector<CommandResult> results(cases.size());
    ParallelFor(static_cast<int>(cases.size()), NumProcessors(), [&](int i) {
      const auto index = static_cast<size_t>(i);
      results[index] = RunCase(cases[index], i);
    });
    for (size_t i = 0; i < cases.size(); ++i) {
      const CommandResult& result = results[i];
      constexpr int kTimedOut = 124;
      EXPECT_NE(result.status, kTimedOut) << cases[i].what << ": hangs";
      EXPECT_GE(result.status, 0) << cases[i].what << ": ended by a signal\n" << result.err;
      if (result.status <= 0 || result.status == kTimedOut) continue;
      EXPECT_THAT(result.err, testing::StartsWith("heba: error: ")) << cases[i].what;
      EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << cases[i].what << ": " << result.err;
      EXPECT_THAT(result.err, testing::Not(testing::HasSubstr("unexpected"))) << cases[i].what;
    }
    std::cout << subject.name << ": " << cases.size() << " spoiled files\n";
  }

  static CommandResult RunCase(const Case& spoiled, int index) {
    const Subject& subject = *spoiled.subject;
    const fs::path folder = *root_ / (subject.name + std::to_string(index));
    fs::create_directories(folder);
    if (!subject.beside.empty()) fs::copy(subject.beside, folder, fs::copy_options::recursive);
    const fs::path file = folder / subject.file.filename();
    WriteAll(file, spoiled.text);
    std::vector<std::string> words;
    for (const std::string& word : subject.command) {
      if (word == "FOLDER") {
        words.push_back(folder.string());
        continue;
      }
      const bool is_within = word.starts_with("FOLDER/");
      words.push_back(word == "FILE" ? file.string() : is_within ? (folder / word.substr(7)).string() : word);
    }
    // Time is limited to 60 s, memory to 8,000,000 KiB.
    CommandResult result = RunHeba(words, std::string(kMemoryLimit) + "HEBA_CACHE= timeout -s KILL 60");
    fs::remove_all(folder);
    return result;
  }

  static constexpr const char* kScene =
      "setup: eye_to_hand\n"
      "target: {type: chessboard, rows: 4, columns: 5, square: 30 mm}\n"
      "camera: {model: brown5, image_size: [320, 240], fx: 350, fy: 350, cx: 159.5, cy: 119.5, distortion: [-0.1, "
      "0.05, 0.001, 0.002, 0.003]}\n"
      "hand_eye: {translation: [800 mm, 10 mm, 500 mm], rpy: [-120 deg, 5 deg, 60 deg]}\n"
      "board: {translation: [1 mm, 2 mm, 100 mm], rpy: [3 deg, 5 deg, 10 deg]}\n"
      "motion: {captures: 6, distance: 400 mm, depth: 0.2, tilt: 30 deg, spin: 40 deg, spread: 0.3}\n"
      "image: {noise: 1 grey, blur: 0.5 px, uneven_light: 0.2, black: 20 grey, white: 220 grey, bits: 8}\n"
      "print: {scale_x: 1.001, scale_y: 1.002, bend_x: 1 mm, bend_y: 2 mm}\n"
      "robot_noise: {translation: 0.1 mm, rotation: 0.01 deg}\n"
      "seed: 3\n";
  static fs::path* root_;
};
fs::path* ExtremesTest::root_ = nullptr;

TEST_F(ExtremesTest, SurvivesExtremeScenes) {
  Try({"scene", *root_ / "scene.yaml", {"simulate", "FILE", "--out", "FOLDER/out", "--quiet"}});
}

TEST_F(ExtremesTest, SurvivesExtremeStudies) {
  Try({"study", *root_ / "study.yaml", {"study", "FILE", "--out", "FOLDER/out", "--quiet"}});
}

TEST_F(ExtremesTest, SurvivesExtremeTargets) {
  const char* const targets[] = {
      "type: coded_board\nrows: 4\ncolumns: 5\nspacing: 35 mm\ndot_diameter: 10 mm\nbits: 12\nfirst_id: 3\n",
      "type: apriltag_grid\nfamily: tag36h11\nrows: 3\ncolumns: 4\ntag_size: 30 mm\nborder_bits: 1\ntag_spacing: "
      "0.3\nfirst_id: 2\n",
      "type: chessboard\nrows: 5\ncolumns: 8\nsquare: 20 mm\n",
      "type: charuco\nrows: 5\ncolumns: 6\nsquare: 20 mm\nmarker: 15 mm\ndictionary: DICT_5X5_100\nfirst_marker: 2\n",
      "type: circle_grid\nrows: 5\ncolumns: 6\nspacing: 20 mm\ndot_diameter: 9 mm\nmarker_dot: true\nmarker_diameter: "
      "12 mm\n"};
  for (const char* text : targets) {
    const std::string type = std::string(text).substr(6, std::string(text).find('\n') - 6);
    WriteAll(*root_ / (type + ".yaml"), text);
    Try({type, *root_ / (type + ".yaml"), {"target", "FILE", "--out", "FOLDER/sheet.pdf"}});
    Try({type + ".png", *root_ / (type + ".yaml"), {"target", "FILE", "--out", "FOLDER/sheet.png", "--dpi", "30"}, 3});
    Try({type + ".paper",
         *root_ / (type + ".yaml"),
         {"target", "FILE", "--out", "FOLDER/sheet.pdf", "--paper", "a4"},
         3});
  }
}

TEST_F(ExtremesTest, SurvivesRunsOfSpoiledDataSets) {
  const fs::path good = *root_ / "good";
  const std::vector<std::string> run = {"run", "FOLDER/config.yaml", "--out", "FOLDER/out", "--quiet"};
  Try({"camera", good / "camera.yaml", run, 1, good});
  Try({"poses", good / "poses.csv", run, 7, good});
  Try({"truth", good / "truth.json", run, 3, good});
  WriteAll(*root_ / "given.yaml", "base: " + (good / "config.yaml").string() +
                                      "\nrefine:\n  robot_noise: {rotation: 0.02 deg, translation: 0.1 mm}\n"
                                      "  pixel_noise: 0.2 px\nevaluate:\n  folds: 3\n");
  Try({"config", *root_ / "given.yaml", {"run", "FILE", "--out", "FOLDER/out", "--quiet"}});
}

TEST_F(ExtremesTest, SurvivesExtremeResults) {
  Try({"result", *root_ / "run/result.json", {"export", "FOLDER", "--to", "ros2"}, 23});
  Try({"compared",
       *root_ / "run/result.json",
       {"compare", "FOLDER", (*root_ / "run").string(), "--out", "FOLDER/out"},
       13});
  Try({"located",
       *root_ / "run/result.json",
       {"locate", "FOLDER", (*root_ / "good/images/000.png").string()},
       37,
       *root_ / "run"});
}

// All commands that read results refuse results that no calibration can have.
TEST_F(ExtremesTest, RefusesMeaninglessResults) {
  using Json = nlohmann::ordered_json;
  struct Spoiling {
    const char* what;
    std::function<void(Json& bundle)> spoil;
  };
  const std::vector<Spoiling> spoilings = {
      {"negative variance", [](Json& bundle) { bundle["covariance"]["matrix"][0][0] = -1; }},
      {"huge variance", [](Json& bundle) { bundle["covariance"]["matrix"][1][1] = 1e308; }},
      {"not symmetric", [](Json& bundle) { bundle["covariance"]["matrix"][0][1] = 1; }},
      {"correlation above 1",
       [](Json& bundle) {
         bundle["covariance"]["matrix"][0][1] = 1;
         bundle["covariance"]["matrix"][1][0] = 1;
       }},
      {"not square", [](Json& bundle) { bundle["covariance"]["matrix"].erase(0); }},
      {"other names", [](Json& bundle) { bundle["covariance"]["order"][0] = "hand_eye.x"; }},
      {"a name twice",
       [](Json& bundle) {
         auto& order = bundle["covariance"]["order"];
         order[order.size() - 1] = order[order.size() - 2];
       }},
      {"negative degrees of freedom", [](Json& bundle) { bundle["solve"]["covariance_dof"] = -3; }},
      {"no degrees of freedom", [](Json& bundle) { bundle["solve"]["covariance_dof"] = 1e-300; }},
      {"negative pixel noise", [](Json& bundle) { bundle["solve"]["pixel_sigma"] = -0.1; }},
      {"negative rms", [](Json& bundle) { bundle["errors"]["reprojection_rms_px"] = -1; }},
      {"no camera", [](Json& bundle) { bundle["camera"] = nullptr; }},
  };
  const fs::path folder = *root_ / "meaningless";
  for (const Spoiling& spoiling : spoilings) {
    fs::remove_all(folder);
    fs::copy(*root_ / "run", folder, fs::copy_options::recursive);
    Json result = Json::parse(ReadAll(folder / "result.json"));
    for (Json& estimate : result["estimates"]) {
      if (estimate["method"] == "bundle") spoiling.spoil(estimate);
    }
    WriteAll(folder / "result.json", result.dump());
    const std::vector<std::vector<std::string>> commands = {
        {"export", folder.string(), "--to", "ros2"},
        {"locate", folder.string(), (*root_ / "good/images/000.png").string()},
        {"compare", folder.string(), (*root_ / "run").string(), "--out", (*root_ / "compared").string()}};
    for (const std::vector<std::string>& command : commands) {
      const CommandResult said = RunHeba(command);
      EXPECT_EQ(said.status, 2) << spoiling.what << ": " << command[0];
      EXPECT_THAT(said.err, testing::HasSubstr("result.json")) << spoiling.what << ": " << command[0];
      EXPECT_EQ(std::count(said.err.begin(), said.err.end(), '\n'), 1) << spoiling.what << ": " << said.err;
    }
  }
}

}  // namespace
}  // namespace heba
