// The verdict in the outputs that programs read: result.json, summary.csv and the exit status.
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"

namespace heba {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

class VerdictRunTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = TestFolder("verdict_run");
    const std::string source = HEBA_SOURCE_DIR;
    ASSERT_EQ(RunHeba({"simulate", source + "/configs/sample_scene.yaml", "--set", "motion.captures=10", "--out",
                       (folder() / "data").string(), "--quiet"})
                  .status,
              0);
  }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }
  static std::string Config(const std::string& name, const std::string& text) {
    const fs::path path = folder() / "data" / (name + ".yaml");
    WriteAll(path, "base: config.yaml\n" + text);
    return path.string();
  }
  static Json Result(const std::string& name) { return Json::parse(ReadAll(folder() / name / "result.json")); }
};

Json FindingOf(const Json& result, const std::string& code) {
  for (const Json& finding : result["verdict"]["findings"]) {
    if (finding["code"] == code) return finding;
  }
  return nullptr;
}

TEST_F(VerdictRunTest, GoodResultsNameTheChosenModel) {
  const CommandResult run = RunHeba({"run", Config("good", "evaluate: {folds: 5}\n"), "--out",
                                     (folder() / "good").string(), "--fail-on", "doubtful"});
  EXPECT_EQ(run.status, 0) << run.err;
  const Json result = Result("good");
  EXPECT_EQ(result["verdict"]["grade"], "good");
  // The simplest model is taken beside the largest.
  ASSERT_EQ(result["model"]["alternatives"].size(), 2U);
  EXPECT_EQ(result["model"]["alternatives"][0]["name"], "exact robot, target as designed");
  EXPECT_EQ(result["model"]["camera"], "brown5");
  EXPECT_FALSE(FindingOf(result, "model").is_null());
  for (const Json& capture : result["captures"]) EXPECT_TRUE(capture["used"].get<bool>()) << capture["reason"];
}

// A strict run refuses an image without a pose, but not what the config leaves out.
TEST_F(VerdictRunTest, StrictRunsUseEverything) {
  const auto run = [](const std::string& name, const std::string& text) {
    return RunHeba({"run", Config(name, text), "--out", (folder() / name).string(), "--strict", "--quiet"});
  };
  EXPECT_EQ(run("all", "evaluate: {folds: 0}\n").status, 0);
  EXPECT_EQ(run("all_but_excluded", "captures: {exclude: [003.png]}\nevaluate: {folds: 0}\n").status, 0);
  std::vector<std::string> rows = Split(ReadAll(folder() / "data" / "poses.csv"), '\n');
  rows.erase(rows.begin() + 4);
  WriteAll(folder() / "data" / "without_one.csv", Join(rows, "\n"));
  const CommandResult unused = run("unused", "captures: {poses: without_one.csv}\nevaluate: {folds: 0}\n");
  EXPECT_EQ(unused.status, 1);
  EXPECT_THAT(unused.err, testing::HasSubstr("not everything that was given is used (--strict): 003.png (the robot's "
                                             "pose is not in the poses file)"));
  EXPECT_TRUE(fs::exists(folder() / "unused" / "result.json"));
}

TEST_F(VerdictRunTest, UnmetRequirementFailsTheRunButKeepsItsResults) {
  const std::string require =
      "evaluate: {folds: 0, require: [{within: 0.00001 mm, at: [400 mm, 0 mm, 50 mm], confidence: 0.9}]}\n";
  const CommandResult run =
      RunHeba({"run", Config("strict", require), "--out", (folder() / "strict").string(), "--fail-on", "bad"});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err, testing::HasSubstr("heba: error: "));
  EXPECT_THAT(run.err, testing::HasSubstr("the verdict is bad (--fail-on)"));
  const Json finding = FindingOf(Result("strict"), "required");
  ASSERT_FALSE(finding.is_null());
  EXPECT_EQ(finding["grade"], "bad");
  EXPECT_GT(finding["numbers"]["reached_mm"].get<double>(), 1e-5);
  // Without the flag the run succeeds.
  EXPECT_EQ(RunHeba({"run", Config("strict", require), "--out", (folder() / "strict").string()}).status, 0);
}

// Two rows that change places are left out, so that the rest is good: the run says what is wrong with them.
TEST_F(VerdictRunTest, RunNamesTheCauseOfCapturesThatItLeavesOut) {
  std::vector<PoseRow> rows = ReadPoseFile(folder() / "data" / "poses.csv", *FindPoseFormat("ros"));
  std::swap(rows[4].pose, rows[7].pose);
  WriteAll(folder() / "data" / "swapped.csv", PoseFileText(rows, *FindPoseFormat("ros")));
  const CommandResult run = RunHeba({"run", Config("swapped", "captures: {poses: swapped.csv}\nevaluate: {folds: 0}\n"),
                                     "--out", (folder() / "swapped").string()});
  EXPECT_EQ(run.status, 0) << run.err;
  const Json result = Result("swapped");
  int num_left_out = 0;
  for (const Json& capture : result["captures"]) num_left_out += capture["used"].get<bool>() ? 0 : 1;
  EXPECT_EQ(num_left_out, 2);
  const Json finding = FindingOf(result, "swapped");
  ASSERT_FALSE(finding.is_null());
  EXPECT_EQ(finding["grade"], result["verdict"]["grade"]);
  EXPECT_THAT(finding["text"].get<std::string>(), testing::HasSubstr("are swapped: each fits the other's pose"));
}

TEST_F(VerdictRunTest, RunAndDoctorReportAWrongTargetSize) {
  // The target of the sample scene, declared 10 % larger than it was rendered.
  std::string target = ReadAll(folder() / "data" / "target.yaml");
  const std::regex length(R"((spacing|dot_diameter): *([0-9.]+))");
  std::string larger;
  for (std::smatch match; std::regex_search(target, match, length); target = match.suffix()) {
    larger += match.prefix().str() + match[1].str() + ": " + std::to_string(1.1 * std::stod(match[2]));
  }
  WriteAll(folder() / "data" / "larger.yaml", larger + target);
  const std::string config = Config("large", "target: larger.yaml\nevaluate: {folds: 5}\n");
  const CommandResult run = RunHeba({"run", config, "--out", (folder() / "large").string()});
  ASSERT_EQ(run.status, 0) << run.err;
  const Json result = Result("large");
  EXPECT_EQ(result["verdict"]["grade"], "bad");
  const CommandResult doctor = RunHeba({"doctor", config});
  EXPECT_THAT(doctor.out, testing::HasSubstr("1. wrong ["));
  // One cause gives one finding.
  int num_bad = 0;
  for (const Json& finding : result["verdict"]["findings"]) num_bad += finding["grade"] == "bad" ? 1 : 0;
  EXPECT_EQ(num_bad, 1) << result["verdict"].dump(1);
}

TEST_F(VerdictRunTest, SummaryContainsTheVerdict) {
  const CommandResult run =
      RunHeba({"run", Config("one", ""), Config("two", ""), "--out", (folder() / "batch").string(), "--quiet"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(ReadAll(folder() / "batch" / "summary.csv"), testing::HasSubstr(",method_ok,verdict,"));
  EXPECT_THAT(ReadAll(folder() / "batch" / "summary.html"), testing::HasSubstr("verdict"));
}

TEST_F(VerdictRunTest, WrongSettingsAreNamed) {
  EXPECT_THAT(RunHeba({"run", Config("bad_flag", ""), "--fail-on", "good"}).err,
              testing::HasSubstr("--fail-on: 'good' is unknown; one of: bad, doubtful"));
  const CommandResult require = RunHeba({"run", Config("bad_require", "evaluate: {require: [{within: 5}]}\n")});
  EXPECT_EQ(require.status, 2);
  EXPECT_THAT(require.err, testing::HasSubstr("within"));
}

}  // namespace
}  // namespace heba
