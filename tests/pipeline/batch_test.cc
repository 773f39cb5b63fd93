// Batches of runs: in parallel, resumed, in shards, killed.
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/pipeline/cli.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;

constexpr const char* kScene =
    "setup: eye_to_hand\n"
    "target: {type: chessboard, rows: 5, columns: 7, square: 20 mm}\n"
    "camera: {model: brown5, image_size: [640, 480], fx: 700, fy: 700, cx: 320, cy: 240, distortion: [0, 0, 0, 0, 0]}\n"
    "hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}\n"
    "board: {translation: [-70 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}\n"
    "motion: {captures: 8, distance: 420 mm, tilt: 35 deg, spin: 60 deg, spread: 0.3}\n"
    "image: {noise: 2 grey}\n";

// A data set and four good configs that share the config of the data set as their base.
struct Cell {
  fs::path folder;
  std::vector<std::string> configs;
};

Cell MakeCell(const std::string& name) {
  Cell cell{TestFolder(name), {}};
  WriteAll(cell.folder / "scene.yaml", kScene);
  const CommandResult simulated =
      RunHeba({"simulate", (cell.folder / "scene.yaml").string(), "--out", (cell.folder / "data").string(), "--quiet"});
  EXPECT_EQ(simulated.status, 0) << simulated.err;
  const std::string base = "base: data/config.yaml\n";
  const std::vector<std::pair<std::string, std::string>> variants = {
      {"plain", "{}"}, {"held", "{intrinsics: []}"}, {"focal", "{intrinsics: [focal]}"}, {"cauchy", "{loss: cauchy}"}};
  for (const auto& [variant, refine] : variants) {
    const fs::path path = cell.folder / (variant + ".yaml");
    WriteAll(path, base + "refine: " + refine + "\nevaluate: {folds: 2}\n");
    cell.configs.push_back(path.string());
  }
  return cell;
}

// The tests share one cache because they use the same images.
CommandResult RunCached(const std::vector<std::string>& arguments) {
  static const fs::path cache = TestFolder("batch_detections");
  return RunHeba(arguments, "HEBA_CACHE=" + cache.string());
}

std::vector<std::string> RunArguments(const Cell& cell, const fs::path& out, const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"run"};
  arguments.insert(arguments.end(), cell.configs.begin(), cell.configs.end());
  arguments.insert(arguments.end(), {"--out", out.string(), "--jobs", "2"});
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

// Returns the result without timings, which differ from run to run.
std::string WithoutTimes(const fs::path& result_file) {
  Json json = Json::parse(ReadAll(result_file));
  json.erase("timing_s");
  for (Json& estimate : json["estimates"]) {
    if (!estimate["solve"].is_null()) estimate["solve"].erase("seconds");
  }
  return json.dump();
}

TEST(BatchTest, AFailedRunDoesNotAffectOthers) {
  Cell cell = MakeCell("batch_fails");
  WriteAll(cell.folder / "wrong.yaml", "base: data/config.yaml\nrefine: {los: none}\n");
  WriteAll(cell.folder / "blind.yaml",
           "base: data/config.yaml\ntarget: {type: apriltag_grid, family: tag36h11, rows: 2, columns: 2, tag_size: 30 "
           "mm, tag_spacing: 0.3}\n");
  cell.configs.insert(cell.configs.begin() + 1,
                      {(cell.folder / "wrong.yaml").string(), (cell.folder / "blind.yaml").string()});
  const CommandResult run = RunCached(RunArguments(cell, cell.folder / "out", {}));
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err, HasSubstr("heba: error: " + (cell.folder / "wrong.yaml").string() + ":2: refine: unknown key"));
  EXPECT_THAT(run.err, HasSubstr("the images show another target than the config names"));
  EXPECT_THAT(run.err, HasSubstr("[6/6]"));
  for (const char* name : {"plain", "held", "focal", "cauchy"}) {
    EXPECT_TRUE(fs::exists(cell.folder / "out" / name / "result.json")) << name;
  }
  EXPECT_FALSE(fs::exists(cell.folder / "out" / "blind"));
  const std::string csv = ReadAll(cell.folder / "out" / "summary.csv");
  EXPECT_THAT(csv, HasSubstr("\nplain,true,"));
  EXPECT_THAT(csv, HasSubstr("\nblind,false,"));
  const std::string page = ReadAll(cell.folder / "out" / "summary.html");
  EXPECT_THAT(page, HasSubstr("6 runs, 2 of them failed"));
  // Each run links to its report; failed runs are listed separately with their reasons.
  EXPECT_THAT(page, HasSubstr("<a href=\"plain/report.html\">plain</a>"));
  EXPECT_THAT(page, testing::ContainsRegex("Runs that failed.*blind"));
  fs::remove_all(cell.folder);
}

TEST(BatchTest, ResumeRunsOnlyWhatChanged) {
  const Cell cell = MakeCell("batch_resume");
  const fs::path out = cell.folder / "out";
  ASSERT_EQ(RunCached(RunArguments(cell, out, {})).status, 0);
  const std::string csv = ReadAll(out / "summary.csv");
  const auto time_of = [&](const char* name) { return fs::last_write_time(out / name / "result.json"); };
  const auto plain = time_of("plain");
  const auto held = time_of("held");
  // Modification times do not count.
  fs::last_write_time(cell.configs[0], fs::file_time_type::clock::now());
  CommandResult again = RunCached(RunArguments(cell, out, {"--resume"}));
  EXPECT_EQ(again.status, 0);
  EXPECT_THAT(again.err, HasSubstr("plain: unchanged"));
  EXPECT_EQ(time_of("plain"), plain);
  EXPECT_EQ(ReadAll(out / "summary.csv"), csv);
  // The content of a config changes.
  WriteAll(cell.configs[0], "base: data/config.yaml\nrefine: {loss: none}\nevaluate: {folds: 2}\n");
  again = RunCached(RunArguments(cell, out, {"--resume"}));
  EXPECT_NE(time_of("plain"), plain);
  EXPECT_EQ(time_of("held"), held);
  // An image changes.
  fs::copy_file(cell.folder / "data" / "images" / "001.png", cell.folder / "data" / "images" / "000.png",
                fs::copy_options::overwrite_existing);
  again = RunCached(RunArguments(cell, out, {"--resume"}));
  EXPECT_NE(time_of("held"), held);
  EXPECT_THAT(again.err, testing::Not(HasSubstr("unchanged")));
  fs::remove_all(cell.folder);
}

TEST(BatchTest, ShardsTogetherGiveTheSameBytes) {
  const Cell cell = MakeCell("batch_shards");
  ASSERT_EQ(RunCached(RunArguments(cell, cell.folder / "whole", {})).status, 0);
  for (const char* shard : {"0/3", "2/3", "1/3"}) {
    EXPECT_EQ(RunCached(RunArguments(cell, cell.folder / "parts", {"--shard", shard})).status, 0) << shard;
    EXPECT_FALSE(fs::exists(cell.folder / "parts" / "summary.csv"));
  }
  const CommandResult merged = RunCached(RunArguments(cell, cell.folder / "parts", {"--resume"}));
  EXPECT_EQ(merged.status, 0);
  EXPECT_THAT(merged.err, HasSubstr("[4/4]"));
  EXPECT_THAT(merged.err, testing::Not(HasSubstr(" s;")));
  EXPECT_EQ(ReadAll(cell.folder / "parts" / "summary.csv"), ReadAll(cell.folder / "whole" / "summary.csv"));
  EXPECT_EQ(RunCached(RunArguments(cell, cell.folder / "parts", {"--shard", "3/3"})).status, 2);
  fs::remove_all(cell.folder);
}

// Returns the complete runs in the folder of a batch, with a stamp that distinguishes two versions of the same run.
std::map<std::string, std::string> FinishedRuns(const fs::path& out) {
  std::map<std::string, std::string> runs;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(out, error)) {
    if (entry.path().filename().string()[0] == '.') continue;
    struct stat status = {};
    if (stat((entry.path() / "result.json").c_str(), &status) != 0) continue;
    runs[entry.path().filename().string()] =
        std::to_string(status.st_ino) + " " + std::to_string(status.st_mtim.tv_nsec);
  }
  return runs;
}

// The batch is killed as soon as another run is finished or at odd moments after that, and resumed each time: no run
// is lost or repeated, and no partial output remains.
TEST(BatchTest, KillingLosesNoFinishedRun) {
  const Cell cell = MakeCell("batch_kill");
  const fs::path out = cell.folder / "out";
  ASSERT_EQ(RunCached(RunArguments(cell, cell.folder / "whole", {})).status, 0);
  const fs::path cache = cell.folder / "cache";
  size_t num_kept = 0;
  for (const int milliseconds : {0, 7, 23}) {
    const std::map<std::string, std::string> before = FinishedRuns(out);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::vector<std::string> words = RunArguments(cell, out, {"--resume", "--quiet"});
      words.insert(words.begin(), HEBA_PROGRAM);
      words[words.size() - 3] = "1";  // --jobs
      std::vector<char*> argv;
      for (std::string& word : words) argv.push_back(word.data());
      argv.push_back(nullptr);
      setenv("HEBA_CACHE", cache.c_str(), 1);
      execv(HEBA_PROGRAM, argv.data());
      _exit(127);
    }
    while (FinishedRuns(out).size() == before.size()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    const std::map<std::string, std::string> after = FinishedRuns(out);
    for (const auto& [name, stamp] : before) EXPECT_EQ(after.count(name) > 0 ? after.at(name) : "", stamp) << name;
    num_kept += before.size();
    for (const auto& entry : fs::directory_iterator(out)) {
      const std::string name = entry.path().filename().string();
      if (!fs::is_directory(entry.path()) || name[0] == '.') continue;
      EXPECT_FALSE(Json::parse(ReadAll(entry.path() / "result.json"), nullptr, false).is_discarded()) << name;
    }
  }
  EXPECT_GE(num_kept, 3U);
  // A damaged result is not a result.
  WriteAll(out / FinishedRuns(out).begin()->first / "result.json", "");
  ASSERT_EQ(RunCached(RunArguments(cell, out, {"--resume"})).status, 0);
  EXPECT_EQ(ReadAll(out / "summary.csv"), ReadAll(cell.folder / "whole" / "summary.csv"));
  for (const char* name : {"plain", "held", "focal", "cauchy"}) {
    EXPECT_EQ(WithoutTimes(out / name / "result.json"), WithoutTimes(cell.folder / "whole" / name / "result.json"));
  }
  for (const auto& entry : fs::directory_iterator(out)) {
    EXPECT_THAT(entry.path().filename().string(), testing::Not(HasSubstr(".part")));
  }
  fs::remove_all(cell.folder);
}

TEST(BatchTest, RefusesASecondProcessInTheFolder) {
  const Cell cell = MakeCell("batch_lock");
  const fs::path out = cell.folder / "out";
  fs::create_directories(out);
  const int descriptor = open((out / ".heba.lock").c_str(), O_RDWR | O_CREAT, 0666);
  ASSERT_GE(descriptor, 0);
  ASSERT_EQ(flock(descriptor, LOCK_EX), 0);
  const CommandResult run = RunCached(RunArguments(cell, out, {}));
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.err, HasSubstr("another heba process is using this folder"));
  close(descriptor);
  fs::remove_all(cell.folder);
}

TEST(BatchTest, RefusesDuplicateNamesBeforeAnyWork) {
  Cell cell = MakeCell("batch_names");
  cell.configs.push_back(cell.configs.front());
  const CommandResult run = RunCached(RunArguments(cell, cell.folder / "out", {}));
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.err, HasSubstr("give one of them another name"));
  EXPECT_FALSE(fs::exists(cell.folder / "out"));
  fs::remove_all(cell.folder);
}

TEST(BatchTest, CachedDetectionsGiveTheSameResult) {
  const Cell cell = MakeCell("batch_cache");
  const std::string cache = "HEBA_CACHE=" + (cell.folder / "cache").string();
  for (const char* out : {"cold", "warm"}) {
    EXPECT_EQ(RunHeba(RunArguments(cell, cell.folder / out, {}), cache).status, 0);
  }
  ASSERT_EQ(RunHeba(RunArguments(cell, cell.folder / "none", {})).status, 0);
  // A target of another size looks the same in images.
  WriteAll(cell.folder / "larger.yaml",
           "base: data/config.yaml\ntarget: {type: chessboard, rows: 5, columns: 7, square: 20.7 mm}\n");
  const std::string larger = (cell.folder / "larger.yaml").string();
  EXPECT_EQ(RunHeba({"detect", larger, "--out", (cell.folder / "larger").string()}, cache).status, 0);
  int num_kept = 0;
  for (const auto& entry : fs::recursive_directory_iterator(cell.folder / "cache")) {
    num_kept += entry.is_regular_file() ? 1 : 0;
  }
  EXPECT_EQ(num_kept, 8);  // One entry for each image, for all runs and sizes.
  for (const char* out : {"warm", "none"}) {
    EXPECT_EQ(WithoutTimes(cell.folder / out / "plain" / "result.json"),
              WithoutTimes(cell.folder / "cold" / "plain" / "result.json"));
    EXPECT_EQ(ReadAll(cell.folder / out / "plain" / "detections.json"),
              ReadAll(cell.folder / "cold" / "plain" / "detections.json"));
  }

  // Entries with a changed digit and entries that are not regular files are ignored.
  std::vector<fs::path> entries;
  for (const auto& entry : fs::recursive_directory_iterator(cell.folder / "cache")) {
    if (entry.is_regular_file()) entries.push_back(entry.path());
  }
  for (const fs::path& entry : entries) {
    std::string text = ReadAll(entry);
    const size_t digit = text.find_first_of("123456789", text.find("\"pixels\""));
    ASSERT_NE(digit, std::string::npos);
    text[digit] = text[digit] == '9' ? '8' : '9';
    WriteAll(entry, text);
  }
  fs::remove(entries.front());
  ASSERT_EQ(mkfifo(entries.front().c_str(), 0600), 0);
  ASSERT_EQ(RunHeba(RunArguments(cell, cell.folder / "spoiled", {}), cache + " timeout 60").status, 0);
  EXPECT_EQ(WithoutTimes(cell.folder / "spoiled" / "plain" / "result.json"),
            WithoutTimes(cell.folder / "cold" / "plain" / "result.json"));
  fs::remove_all(cell.folder);
}

// --set takes precedence over the file, and the config.yaml of the run contains the setting.
TEST(BatchTest, UsedConfigContainsSettingsAndBases) {
  const Cell cell = MakeCell("batch_set");
  ASSERT_EQ(
      RunCached(RunArguments(cell, cell.folder / "out", {"--set", "refine.loss=huber", "--set", "evaluate.folds=0"}))
          .status,
      0);
  const std::string used = ReadAll(cell.folder / "out" / "cauchy" / "config.yaml");
  EXPECT_THAT(used, HasSubstr("loss: huber"));
  EXPECT_THAT(used, HasSubstr("folds: 0"));
  EXPECT_THAT(used, testing::Not(HasSubstr("base:")));
  fs::remove_all(cell.folder);
}

// The shards of a study together give the same file as the whole study; finished cells are not repeated.
TEST(StudyTest, ShardsTogetherGiveTheSameBytes) {
  const fs::path folder = TestFolder("study_shards");
  const std::string scene = (fs::path(HEBA_SOURCE_DIR) / "configs" / "scenes" / "ring4_eye_to_hand.yaml").string();
  WriteAll(folder / "study.yaml",
           "trials: 3\nscenes: {four: " + scene + "}\npixel_noise: [0.1 px, 0.5 px, 1 px]\nmethods: [shah]\n");
  const auto study = [&](const char* out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"study", (folder / "study.yaml").string(), "--out", (folder / out).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunHeba(arguments);
  };
  EXPECT_EQ(study("whole", {}).status, 0);
  EXPECT_EQ(study("parts", {"--shard", "1/2"}).status, 0);
  EXPECT_FALSE(fs::exists(folder / "parts" / "study.csv"));
  const CommandResult merged = study("parts", {"--resume"});
  EXPECT_EQ(merged.status, 0);
  EXPECT_THAT(merged.err, HasSubstr("1 of 3 cells were already complete"));
  EXPECT_EQ(ReadAll(folder / "parts" / "study.csv"), ReadAll(folder / "whole" / "study.csv"));
  // A different seed makes it another study.
  WriteAll(folder / "study.yaml", ReadAll(folder / "study.yaml") + "seed: 2\n");
  EXPECT_THAT(study("parts", {"--resume"}).err, testing::Not(HasSubstr("were there")));
  fs::remove_all(folder);
}

// The same for a rig, of which every pose has its rows.
TEST(StudyTest, ShardsOfARigTogetherGiveTheSameBytes) {
  const fs::path folder = TestFolder("rig_study_shards");
  const std::string scene = (fs::path(HEBA_SOURCE_DIR) / "configs" / "rig" / "scene.yaml").string();
  WriteAll(folder / "study.yaml", "trials: 2\nscenes: {cell: " + scene +
                                      "}\ncaptures: [8, 10]\npixel_noise: [0.1 px, 0.2 px]\n"
                                      "robot_noise: {translation: 0.1 mm, rotation: 0.02 deg}\n");
  const auto study = [&](const char* out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"study", (folder / "study.yaml").string(), "--out", (folder / out).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunHeba(arguments);
  };
  EXPECT_EQ(study("whole", {"--jobs", "2"}).status, 0);
  EXPECT_EQ(study("parts", {"--shard", "1/2", "--jobs", "1"}).status, 0);
  EXPECT_FALSE(fs::exists(folder / "parts" / "study.csv"));
  const CommandResult merged = study("parts", {"--resume", "--jobs", "1"});
  EXPECT_EQ(merged.status, 0);
  EXPECT_THAT(merged.err, HasSubstr("2 of 4 cells were already complete"));
  for (const char* file : {"study.csv", "study.txt"}) {
    EXPECT_EQ(ReadAll(folder / "parts" / file), ReadAll(folder / "whole" / file)) << file;
  }
  const std::string csv = ReadAll(folder / "whole" / "study.csv");
  // A header, and for each of four cells the rows of four poses and two estimators.
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 4 * 4 * 2);
  EXPECT_THAT(csv, HasSubstr("camera right in camera left"));
  const std::string page = ReadAll(folder / "whole" / "study.html");
  for (const char* part : {"Error against pixel noise, px", "Coverage against captures", "camera wrist in gripper"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
  fs::remove_all(folder);
}

// Compares four runs: the table, the findings and the files.
TEST(CompareTest, ReportsTheGainOfRefinementAndTheAgreementOfPoses) {
  const Cell cell = MakeCell("compare");
  ASSERT_EQ(RunCached(RunArguments(cell, cell.folder / "out", {})).status, 0);
  const CommandResult compared =
      RunHeba({"compare", (cell.folder / "out").string(), "--out", (cell.folder / "compared").string()});
  EXPECT_EQ(compared.status, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("hold-out error in px: the refinement is better than"));
  EXPECT_THAT(compared.out, HasSubstr("hand-eye poses from targets of one type agree within their uncertainties"));
  const std::string pairs = ReadAll(cell.folder / "compared" / "pairs.csv");
  EXPECT_EQ(std::count(pairs.begin(), pairs.end(), '\n'), 1 + 6);
  EXPECT_THAT(ReadAll(cell.folder / "compared" / "compare.html"), HasSubstr("Comparison of 4 runs"));
  const CommandResult nothing = RunHeba({"compare", cell.folder.string()});
  EXPECT_EQ(nothing.status, 2);
  EXPECT_THAT(nothing.err, HasSubstr("contains no run"));
  fs::remove_all(cell.folder);
}

// Exports hold the result of the run, and files of the user are kept.
TEST(ExportTest, WritesTheResultOfTheRun) {
  const Cell cell = MakeCell("export");
  const fs::path run = cell.folder / "run";
  ASSERT_EQ(RunCached({"run", cell.configs[0], "--out", run.string(), "--quiet"}).status, 0);
  const CommandResult printed = RunHeba({"export", run.string(), "--to", "ur"});
  EXPECT_EQ(printed.status, 0) << printed.err;
  const CommandResult written = RunHeba({"export", run.string(), "--to", "ur", "--out", cell.folder.string()});
  EXPECT_EQ(written.status, 0) << written.err;
  EXPECT_EQ(ReadAll(cell.folder / "camera_ur.csv"), printed.out);
  // The pose of a closed form is different.
  const CommandResult park = RunHeba({"export", run.string(), "--to", "ur", "--method", "park"});
  EXPECT_EQ(park.status, 0) << park.err;
  EXPECT_NE(park.out, printed.out);
  const CommandResult named = RunHeba({"export", run.string(), "--to", "urdf", "--parent", "world", "--child", "eye"});
  EXPECT_THAT(named.out, HasSubstr("<joint name=\"world_to_eye\""));
  // A frame that is by its name a body frame is not published as the optical one without a warning.
  const std::vector<std::string> as_link = {"export", run.string(), "--to", "ros2", "--child", "camera_link"};
  const CommandResult link = RunHeba(as_link);
  EXPECT_EQ(link.status, 0) << link.err;
  EXPECT_THAT(link.err, HasSubstr("heba: warning: camera_link is by its name the body frame of a camera"));
  for (const char* is : {"body", "optical"}) {
    std::vector<std::string> stated = as_link;
    stated.insert(stated.end(), {"--child-is", is});
    EXPECT_THAT(RunHeba(stated).err, testing::Not(HasSubstr("body frame"))) << is;
  }
  // Every format is exported at once; formats that cannot hold this result are reported.
  const fs::path all = cell.folder / "exports";
  const CommandResult everything = RunHeba({"export", run.string(), "--to", "all", "--out", all.string()});
  EXPECT_EQ(everything.status, 0) << everything.err;
  EXPECT_EQ(ReadAll(all / "camera_ur.csv"), printed.out);
  EXPECT_THAT(ReadAll(all / "camera_pose.yaml"), HasSubstr("covariance: ["));
  EXPECT_GT(std::distance(fs::directory_iterator(all), {}), 15);
  const CommandResult inverse = RunHeba({"export", run.string(), "--to", "all", "--inverse", "--out", all.string()});
  EXPECT_THAT(inverse.out, HasSubstr("not opencv: this format holds the pose of the camera's optical frame"));
  // Files of an earlier export are removed; a file of the user is kept.
  EXPECT_FALSE(fs::exists(all / "camera.opencv.yaml"));
  WriteAll(all / "camera_info.yaml", "mine");
  const CommandResult over = RunHeba({"export", run.string(), "--to", "all", "--out", all.string()});
  EXPECT_EQ(over.status, 2);
  EXPECT_THAT(over.err, HasSubstr("camera_info.yaml: was not exported by heba"));
  const CommandResult one = RunHeba({"export", run.string(), "--to", "camera_info", "--out", all.string()});
  EXPECT_EQ(one.status, 2);
  EXPECT_EQ(ReadAll(all / "camera_info.yaml"), "mine");
  EXPECT_THAT(RunHeba({"locate", run.string(), "none.png", "--robot", "ur5f"}).err, HasSubstr("did you mean 'ur5'?"));
  EXPECT_THAT(RunHeba({"locate", run.string(), "none.png", "--pixels", "1,1", "--plane", "taget"}).err,
              HasSubstr("did you mean 'target'?"));
  // Poses of a UR pendant are relative to the frame `base`, which is not base_link.
  WriteAll(run / "config.yaml", "captures: {pose_format: ur}\n");
  EXPECT_THAT(RunHeba({"export", run.string(), "--to", "ros2"}).out, HasSubstr("'--frame-id', \"base\""));
  EXPECT_THAT(RunHeba({"export", run.string(), "--to", "ros2", "--parent", "base_link"}).err, HasSubstr("180 deg"));
  for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--method", "parc"},
                                                {"--parent", "a b"},
                                                {"--units", "mm"},
                                                {"--units", "inch"},
                                                {"--child-is", "sideways"},
                                                {"--child-is", "1,2,3"}}) {
    std::vector<std::string> arguments = {"export", run.string(), "--to", "urdf"};
    arguments.insert(arguments.end(), wrong.begin(), wrong.end());
    const CommandResult refused = RunHeba(arguments);
    EXPECT_EQ(refused.status, 2) << wrong[1];
    EXPECT_EQ(refused.out, "");
    EXPECT_THAT(refused.err, HasSubstr(wrong[0] + ":"));
  }
  const std::vector<std::vector<std::string>> misspelt = {
      {"--method", "parc", "park"}, {"--units", "nm", "m"}, {"--child-is", "bodi", "body"}};
  for (const std::vector<std::string>& word : misspelt) {
    const CommandResult refused = RunHeba({"export", run.string(), "--to", "matrix", word[0], word[1]});
    EXPECT_THAT(refused.err, HasSubstr("did you mean '" + word[2] + "'?"));
  }
}

// The name of a run never becomes markup.
TEST(SummaryPageTest, EscapesNames) {
  const Cell cell = MakeCell("summary_names");
  const std::string hostile = "<img src=x onerror=alert(1)>";
  WriteAll(cell.folder / "hostile.yaml", "base: data/config.yaml\nname: \"" + hostile + "\"\n");
  WriteAll(cell.folder / "formula.yaml", "base: data/config.yaml\nname: \"=1+1\"\n");
  EXPECT_EQ(RunCached({"run", cell.configs[0], (cell.folder / "hostile.yaml").string(),
                       (cell.folder / "formula.yaml").string(), "--out", (cell.folder / "out").string()})
                .status,
            0);
  // Spreadsheets do not evaluate the name as a formula.
  EXPECT_THAT(ReadAll(cell.folder / "out" / "summary.csv"), HasSubstr("\n'=1+1,"));
  const std::string page = ReadAll(cell.folder / "out" / "summary.html");
  EXPECT_THAT(page, HasSubstr("&lt;img src=x onerror=alert(1)&gt;"));
  EXPECT_THAT(page, testing::Not(HasSubstr("<img")));
  fs::remove_all(cell.folder);
}

}  // namespace
}  // namespace heba
