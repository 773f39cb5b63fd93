#include "tests/support/datasets.h"

#include <utility>

namespace heba {

Dataset DatasetOf(const TestScene& scene, Setup setup, std::shared_ptr<const Target> target) {
  Dataset dataset;
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

}  // namespace heba
