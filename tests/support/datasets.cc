#include "tests/support/datasets.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "heba/base/error.h"
#include "heba/robot/arm_postures.h"

namespace heba {
namespace {

std::string NameOfConfiguration(const Arm& arm, const Eigen::VectorXd& joints) {
  const std::optional<Configuration> configuration = ConfigurationOf(arm, joints);
  CHECK(configuration) << arm.name << " has no configurations";
  return NameOf(*configuration);
}

}  // namespace

Dataset DatasetOf(const TestScene& scene, Setup setup, std::shared_ptr<const Target> target) {
  Dataset dataset = DatasetOf(setup, std::move(target), scene.camera);
  dataset.name = "cell";
  for (const View& view : scene.views) {
    TargetDetection& given = dataset.given_detections.emplace_back();
    given.capture = dataset.captures.size();
    given.detection.width_px = scene.camera.width_px;
    given.detection.height_px = scene.camera.height_px;
    given.detection.detection.ids = view.observations.ids;
    for (Eigen::Index i = 0; i < view.observations.pixels.cols(); ++i) {
      given.detection.detection.pixels.emplace_back(view.observations.pixels.col(i));
    }
    dataset.captures.push_back({view.name, {BaseFromGripper(setup, view.camera_mount_from_target_mount)}, {view.name}});
  }
  return dataset;
}

Dataset PartOf(const Dataset& dataset, const std::vector<size_t>& captures) {
  Dataset part = dataset;
  part.captures.clear();
  part.given_detections.clear();
  part.target_poses.clear();
  for (const size_t i : captures) {
    for (const TargetDetection& given : dataset.given_detections) {
      if (given.capture == i) part.given_detections.push_back({part.captures.size(), 0, 0, given.detection});
    }
    part.captures.push_back(dataset.captures[i]);
    if (!dataset.target_poses.empty()) part.target_poses.push_back(dataset.target_poses[i]);
  }
  return part;
}

void SetArm(const ArmScene& scene, Dataset* dataset) {
  dataset->arms = {RobotArm{scene.nominal, scene.tip_from_gripper, {}}};
  for (size_t i = 0; i < scene.joints.size(); ++i) {
    dataset->captures[i].joints = {{scene.joints[i].begin(), scene.joints[i].end()}};
  }
}

RunOptions WithoutFolds() {
  RunOptions options;
  options.folds = 0;
  return options;
}

Dataset WithFixedCamera(Dataset dataset) {
  dataset.rig.cameras.front().free_intrinsics = {};
  return dataset;
}

ArmDataset ThreeConfigurations(uint64_t seed, ArmSceneOptions options, size_t num_captures, size_t in_third) {
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}");
  options.points = AllPoints(*target).points_in_target;
  options.num_captures = 150;
  options.tip_from_gripper = Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 0.05});
  const ArmScene scene = MakeArmScene(seed, options);
  Dataset all = DatasetOf(scene.scene, options.setup, target);
  SetArm(scene, &all);
  std::map<std::string, std::vector<size_t>> captures_in;
  for (size_t i = 0; i < scene.joints.size(); ++i) {
    captures_in[NameOfConfiguration(scene.nominal, scene.joints[i])].push_back(i);
  }
  std::vector<std::pair<size_t, std::string>> by_size;
  for (const auto& [name, captures] : captures_in) by_size.emplace_back(captures.size(), name);
  std::sort(by_size.rbegin(), by_size.rend());
  CHECK_GE(by_size.size(), size_t{3}) << "seed " << seed << " of " << options.arm;
  const size_t in_others = (num_captures - in_third) / 2;
  ArmDataset made;
  std::vector<size_t> taken;
  for (size_t k = 0; k < 3; ++k) {
    const std::vector<size_t>& captures = captures_in[by_size[k].second];
    const size_t num = std::min(captures.size(), k < 2 ? in_others : in_third);
    for (size_t c = 0; c < num; ++c) {
      taken.push_back(captures[c]);
      made.configuration.push_back(by_size[k].second);
      made.camera_from_target.push_back(scene.scene.pairs[captures[c]].camera_from_target);
    }
  }
  made.dataset = PartOf(all, taken);
  return made;
}

Dataset OnStream(Dataset dataset, double offset_s) {
  constexpr double kBetweenCapturesS = 2;
  PoseStream passed;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    const double time_s = kBetweenCapturesS * static_cast<double>(i);
    passed.times_s.push_back(time_s);
    passed.base_from_gripper.push_back(dataset.captures[i].base_from_gripper.front());
    dataset.captures[i].time_s = time_s - offset_s;
  }
  PoseStream stream;
  constexpr int kRowsBetween = 400;
  const int num_rows = kRowsBetween * static_cast<int>(passed.times_s.size() - 1);
  for (int row = 0; row <= num_rows; ++row) {
    stream.times_s.push_back(kBetweenCapturesS * row / kRowsBetween);
    stream.base_from_gripper.push_back(PoseAt(passed, stream.times_s.back()));
  }
  for (Recording& capture : dataset.captures) capture.base_from_gripper = {PoseAt(stream, *capture.time_s)};
  dataset.stream = std::move(stream);
  return dataset;
}

std::vector<std::string> LeftOutOf(const RunResult& result) {
  std::vector<std::string> names;
  for (const ImageResult& image : result.images) {
    if (!image.used) names.push_back(image.image);
  }
  return names;
}

}  // namespace heba
