// Examinations of simulated data sets for tests of the doctor's checks. The images are never rendered: the detections
// are the projected corners of a chessboard.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "heba/detection.h"
#include "heba/io/pose_formats.h"
#include "heba/target.h"
#include "tests/support/datasets.h"
#include "tests/support/scenes.h"
#include "tools/doctor/checks.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"

namespace heba {

// Runs a check as the doctor does: the examination is corrected by it.
inline std::vector<Symptom> RunCheck(Checked (*check)(const Examination&), Examination* examination) {
  Checked checked = check(*examination);
  std::vector<Symptom> symptoms = checked.symptoms;
  *examination = Corrected(std::move(*examination), std::move(checked));
  return symptoms;
}

// A chessboard without symmetry.
inline constexpr const char* kChessboardYaml = "{type: chessboard, rows: 5, columns: 8, square: 25 mm}";

inline std::shared_ptr<const Target> TargetOfYaml(const std::string& yaml) { return ParseTarget(yaml); }

struct SimulatedSetOptions {
  int num_captures = 12;
  double noise_px = 0.1;
  double max_tilt_rad = 0.6;
  Setup setup = Setup::kEyeToHand;
  Camera camera = TestCamera();
  uint64_t seed = 1;
};

inline TestScene MakeChessboardScene(const SimulatedSetOptions& options = {}) {
  TestSceneOptions scene;
  scene.num_captures = options.num_captures;
  scene.noise_px = options.noise_px;
  scene.max_tilt_rad = options.max_tilt_rad;
  scene.points = AllPoints(*TargetOfYaml(kChessboardYaml)).points_in_target;
  scene.setup = options.setup;
  scene.camera = options.camera;
  return MakeTestScene(options.seed, scene);
}

// Examines the views once more, after the config, the detections or the camera have been changed.
inline void ExamineAgain(Examination* examination) {
  examination->views = ExamineViews(examination->config.data, examination->detections, *examination->camera);
}

// Returns an examination as the checks see it after those before have found nothing wrong. The config names the
// camera of the scene.
inline Examination ExaminationOf(const TestScene& scene, Setup setup) {
  Examination examination;
  RunConfig& config = examination.config;
  config.file = "cell.yaml";
  config.data = DatasetOf(scene, setup, TargetOfYaml(kChessboardYaml));
  config.data.camera_sources = {"camera.yaml"};
  config.data.arms = {std::nullopt};
  config.targets_used = {kChessboardYaml};
  config.has_target_keys = {false};
  config.arms = {{"captures", "poses.csv", {*FindPoseFormat("ros")}, {}}};
  config.options.calibration.adjustment.robot = BundleOptions::Robot::kExact;
  config.options.calibration.choose_target_shape = false;
  config.options.folds = 0;
  config.data_files = {"detections.json"};
  PosesFileOfArm& arm = config.arms.front();
  for (const Recording& capture : config.data.captures) {
    arm.numbers.push_back(NumbersFromPose(arm.reading.format, capture.base_from_gripper[0]));
  }
  examination.detections = config.data.given_detections;
  examination.camera = scene.camera;
  examination.verbosity = Verbosity::kQuiet;
  ExamineAgain(&examination);
  return examination;
}

inline Examination CleanExamination(const SimulatedSetOptions& options = {}) {
  return ExaminationOf(MakeChessboardScene(options), options.setup);
}

// Replaces the robot's poses, base_from_gripper, of all captures.
inline void SetPoses(const std::vector<Rigid3d>& poses, Examination* examination) {
  RunConfig& config = examination->config;
  for (size_t i = 0; i < poses.size(); ++i) {
    config.data.captures[i].base_from_gripper = {poses[i]};
    config.arms[0].numbers[i] = NumbersFromPose(config.arms[0].reading.format, poses[i]);
  }
  ExamineAgain(examination);
}

inline std::vector<Rigid3d> PosesOf(const Examination& examination) {
  std::vector<Rigid3d> poses;
  for (const Recording& capture : examination.config.data.captures) poses.push_back(capture.base_from_gripper[0]);
  return poses;
}

// Writes the numbers of all poses in one format and reads them in another, as a config does that names the wrong one.
inline void MisreadPoses(const PoseFormat& written, const PoseFormat& read, Examination* examination) {
  RunConfig& config = examination->config;
  PosesFileOfArm& arm = config.arms.front();
  arm.reading.format = read;
  for (size_t i = 0; i < config.data.captures.size(); ++i) {
    Rigid3d& pose = config.data.captures[i].base_from_gripper[0];
    arm.numbers[i] = NumbersFromPose(written, pose);
    pose = *PoseFromNumbers(read, arm.numbers[i]);
  }
  ExamineAgain(examination);
}

inline std::vector<std::string> CodesOf(const std::vector<Symptom>& symptoms) {
  std::vector<std::string> codes;
  for (const Symptom& symptom : symptoms) {
    codes.push_back((symptom.severity == Severity::kWrong ? "wrong " : "remark ") + std::string(symptom.code.name()));
  }
  return codes;
}

}  // namespace heba
