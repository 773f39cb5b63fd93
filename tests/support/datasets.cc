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

PairDataset DatasetOf(const TestScene& scene, Setup setup, std::shared_ptr<const Target> target) {
  PairDataset dataset;
  dataset.name = "cell";
  dataset.setup = setup;
  dataset.target = std::move(target);
  dataset.camera = scene.camera;
  for (const View& view : scene.views) {
    dataset.captures.push_back(
        {view.name, "", CaptureRole::kNone, BaseFromGripper(setup, view.camera_mount_from_target_mount)});
    CaptureDetection capture;
    capture.width_px = scene.camera.width_px;
    capture.height_px = scene.camera.height_px;
    capture.detection.ids = view.observations.ids;
    for (Eigen::Index i = 0; i < view.observations.pixels.cols(); ++i) {
      capture.detection.pixels.emplace_back(view.observations.pixels.col(i));
    }
    dataset.given_detections.push_back(std::move(capture));
  }
  return dataset;
}

ArmDataset ThreeConfigurations(uint64_t seed, ArmSceneOptions options, size_t num_captures, size_t in_third) {
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}");
  options.points = AllPoints(*target).points_in_target;
  options.num_captures = 150;
  options.tip_from_gripper = Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 0.05});
  const ArmScene scene = MakeArmScene(seed, options);
  PairDataset all = DatasetOf(scene.scene, options.setup, target);
  std::map<std::string, std::vector<size_t>> captures_in;
  for (size_t i = 0; i < scene.joints.size(); ++i) {
    all.captures[i].joints = {scene.joints[i].begin(), scene.joints[i].end()};
    captures_in[NameOfConfiguration(scene.nominal, scene.joints[i])].push_back(i);
  }
  std::vector<std::pair<size_t, std::string>> by_size;
  for (const auto& [name, captures] : captures_in) by_size.emplace_back(captures.size(), name);
  std::sort(by_size.rbegin(), by_size.rend());
  CHECK_GE(by_size.size(), size_t{3}) << "seed " << seed << " of " << options.arm;
  const size_t in_others = (num_captures - in_third) / 2;
  ArmDataset made;
  made.dataset = all;
  made.dataset.robot = RobotArm{scene.nominal, scene.tip_from_gripper, {}};
  made.dataset.captures.clear();
  made.dataset.given_detections.clear();
  for (size_t k = 0; k < 3; ++k) {
    const std::vector<size_t>& captures = captures_in[by_size[k].second];
    const size_t num = std::min(captures.size(), k < 2 ? in_others : in_third);
    for (size_t c = 0; c < num; ++c) {
      made.dataset.captures.push_back(all.captures[captures[c]]);
      made.dataset.given_detections.push_back(all.given_detections[captures[c]]);
      made.configuration.push_back(by_size[k].second);
      made.camera_from_target.push_back(scene.scene.pairs[captures[c]].camera_from_target);
    }
  }
  return made;
}

std::vector<std::string> LeftOutOf(const RunResult& result) {
  std::vector<std::string> names;
  for (const ImageResult& image : result.images) {
    if (!image.used) names.push_back(image.image);
  }
  return names;
}

}  // namespace heba
