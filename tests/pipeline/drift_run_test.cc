// Runs of cells whose camera creeps, or is knocked, during the captures.
#include <algorithm>
#include <cmath>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

namespace fs = std::filesystem;

using Json = nlohmann::json;

constexpr const char* kMotion = "{translation: [0.7 mm, -0.7 mm, 0 mm], rpy: [0 deg, 0.1 deg, 0 deg]}";

class DriftRunTest : public testing::Test {
 protected:
  // Returns the result of a run on 20 captures of a simulated cell.
  static Json RunWith(const std::string& name, const std::vector<std::string>& of_scene,
                      const std::vector<std::string>& of_run = {}) {
    const fs::path folder = TestFolder("drift_" + name);
    std::vector<std::string> simulate = {"simulate", std::string(HEBA_SOURCE_DIR) + "/configs/manual/cell.yaml",
                                         "--set", "motion.captures=20"};
    simulate.insert(simulate.end(), of_scene.begin(), of_scene.end());
    simulate.insert(simulate.end(), {"--out", (folder / "cell").string(), "--quiet"});
    EXPECT_EQ(RunHeba(simulate).status, 0);
    std::vector<std::string> run = {"run", (folder / "cell/config.yaml").string(), "--out", (folder / "run").string(),
                                    "--quiet"};
    run.insert(run.end(), of_run.begin(), of_run.end());
    EXPECT_EQ(RunHeba(run).status, 0);
    return Json::parse(ReadAll(folder / "run/result.json"));
  }
  static Json FindingOf(const Json& result, const std::string& code) {
    for (const Json& finding : result["verdict"]["findings"]) {
      if (finding["code"] == code) return finding;
    }
    return nullptr;
  }
  // Returns how far the camera is from its true pose, mm.
  static double ErrorMm(const Json& result) {
    for (const Json& estimate : result["estimates"]) {
      if (estimate["method"] == "bundle") return estimate["errors"]["truth"]["hand_eye_mm"];
    }
    return -1;
  }
};

TEST_F(DriftRunTest, EstimatesACreep) {
  const Json result = RunWith("creep", {"--set", std::string("creep=") + kMotion});
  const Json drift = FindingOf(result, "drift");
  ASSERT_FALSE(drift.is_null());
  EXPECT_EQ(drift["names"]["body"], "camera");
  EXPECT_EQ(drift["names"]["side"], "world");
  EXPECT_EQ(drift["names"]["form"], "linear");
  EXPECT_NEAR(drift["numbers"]["change_mm"].get<double>(), 0.99, 0.25);
  EXPECT_NEAR(drift["numbers"]["change_deg"].get<double>(), 0.1, 0.03);
  EXPECT_EQ(result["verdict"]["grade"], "doubtful");
  EXPECT_LT(ErrorMm(result), 0.2);
  // Without it, the camera is in the middle between where it was and where it is.
  const Json ignored =
      RunWith("creep_ignored", {"--set", std::string("creep=") + kMotion}, {"--set", "refine.drift=none"});
  EXPECT_TRUE(FindingOf(ignored, "drift").is_null());
  EXPECT_GT(ErrorMm(ignored), 0.3);
  const Json wanted =
      RunWith("creep_wanted", {"--set", std::string("creep=") + kMotion}, {"--set", "refine.drift=[world]"});
  EXPECT_EQ(FindingOf(wanted, "drift")["names"]["evidence"], "wanted");
  EXPECT_EQ(FindingOf(wanted, "drift")["grade"], "doubtful");
  EXPECT_LT(ErrorMm(wanted), 0.2);
}

using DriftRunNightly = DriftRunTest;

TEST_F(DriftRunNightly, EstimatesAKnock) {
  const Json result = RunWith("knock", {"--set", std::string("moved={from: 10, by: ") + kMotion + "}"});
  const Json drift = FindingOf(result, "drift");
  ASSERT_FALSE(drift.is_null());
  EXPECT_EQ(drift["names"]["form"], "step");
  EXPECT_EQ(drift["names"]["capture"], "010.png");
  EXPECT_EQ(drift["names"]["body"], "camera");
  // The truth is the pose before.
  EXPECT_NEAR(ErrorMm(result), 0.99, 0.2);
}

// The captures follow a path, so that their order alone tells nothing; the first three poses at the end tell that the
// camera was knocked half-way, although the calibration leaves these captures out as outliers.
TEST_F(DriftRunNightly, RevisitsShowAKnockAlongAPath) {
  const fs::path folder = TestFolder("drift_revisits");
  const std::string scene = std::string(HEBA_SOURCE_DIR) + "/configs/manual/cell.yaml";
  for (const std::string kind : {"before", "after"}) {
    std::vector<std::string> simulate = {
        "simulate", scene, "--set", "motion.captures=20", "--out", (folder / kind).string(), "--quiet"};
    if (kind == "after")
      simulate.insert(simulate.end(), {"--set", std::string("moved={from: 0, by: ") + kMotion + "}"});
    ASSERT_EQ(RunHeba(simulate).status, 0);
  }
  std::vector<std::string> rows = Split(ReadAll(folder / "before/poses.csv"), '\n');
  const std::string head = rows.front();
  rows.erase(rows.begin());
  std::erase(rows, "");
  std::sort(rows.begin(), rows.end(), [](const std::string& a, const std::string& b) {
    return std::stod(Split(a, ',')[1]) < std::stod(Split(b, ',')[1]);
  });
  const size_t num_poses = rows.size();
  for (size_t k = 0; k < 3; ++k) rows.push_back(rows[k]);
  fs::create_directories(folder / "session/images");
  std::string poses = head + "\n";
  for (size_t i = 0; i < rows.size(); ++i) {
    const std::string image = rows[i].substr(0, rows[i].find(','));
    const std::string name = std::to_string(100 + i) + ".png";
    fs::copy_file(folder / (i < num_poses / 2 ? "before" : "after") / "images" / image,
                  folder / "session/images" / name);
    poses += name + rows[i].substr(rows[i].find(',')) + "\n";
  }
  WriteAll(folder / "session/poses.csv", poses);
  for (const std::string name : {"config.yaml", "camera.yaml", "target.yaml", "truth.json"}) {
    fs::copy_file(folder / "before" / name, folder / "session" / name);
  }
  ASSERT_EQ(
      RunHeba({"run", (folder / "session/config.yaml").string(), "--out", (folder / "run").string(), "--quiet"}).status,
      0);
  const Json result = Json::parse(ReadAll(folder / "run/result.json"));
  const Json drift = FindingOf(result, "drift");
  ASSERT_FALSE(drift.is_null());
  EXPECT_EQ(drift["names"]["evidence"], "revisits");
  EXPECT_EQ(drift["names"]["form"], "step");
  EXPECT_EQ(drift["names"]["capture"], "110.png");
  EXPECT_EQ(drift["names"]["body"], "camera");
  EXPECT_NEAR(drift["numbers"]["change_mm"].get<double>(), 0.99, 0.1);
  // The truth is that before.
  EXPECT_NEAR(ErrorMm(result), 0.99, 0.15);
}

TEST_F(DriftRunTest, FindsNoneWhereThereIsNone) {
  const Json result = RunWith("none", {});
  EXPECT_TRUE(FindingOf(result, "drift").is_null());
  EXPECT_EQ(result["verdict"]["grade"], "good");
  // One that was asked for is estimated, but it is no reason for doubt.
  const Json wanted = RunWith("none_wanted", {}, {"--set", "refine.drift=[hand, world]"});
  EXPECT_EQ(FindingOf(wanted, "drift")["grade"], "good");
  EXPECT_EQ(wanted["verdict"]["grade"], "good");
}

}  // namespace
}  // namespace heba
