// Checks the invariants of every data set that an importer accepts.
#pragma once

#include "heba/io/import.h"
#include "tests/fuzz/target.h"

namespace heba {

inline void CheckImported(const ImportedSet& set) {
  for (const ImportedCapture& capture : set.captures) {
    for (const std::optional<Rigid3d>& pose : {capture.base_from_gripper, capture.camera_from_target}) {
      Require(!pose || pose->Matrix().allFinite(), "a pose is finite");
    }
    for (const Eigen::Vector2d& pixel : capture.pixels) Require(pixel.allFinite(), "a pixel is finite");
    Require(capture.ids.size() == capture.pixels.size(), "one id for each pixel");
  }
}

inline void CheckImported(const std::optional<ImportedCell>& rig) {
  if (!rig) return;
  Require(!rig->cameras.empty(), "a rig has cameras");
  for (const ImportedCamera& camera : rig->cameras) {
    Require(!camera.mount_from_camera || camera.mount_from_camera->Matrix().allFinite(), "a pose is finite");
  }
  for (const ImportedCellCapture& capture : rig->captures) {
    Require(capture.base_from_gripper.Matrix().allFinite(), "a pose is finite");
    Require(capture.images.size() == rig->cameras.size(), "one entry for each camera");
  }
}

}  // namespace heba
