// Kalibr's camchain: the cameras cam0, cam1, ... of a device, each with its intrinsics and its pose in the one before.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/geometry/rigid3.h"

namespace heba {

struct ChainedCamera {
  std::string name;  // cam0, cam1, ...
  Camera camera;
  std::optional<Rigid3d> camera_from_previous;  // T_cn_cnm1 (m); the first camera has none.
};

// Returns whether a text appears to be a camchain; it may still be faulty.
bool IsCamchain(const std::string& text);

// Returns whether it appears to have several cameras.
bool IsChainOfSeveral(const std::string& text);

// Returns the camera called `camera` (cam0, cam1, ...). If that is empty, the file must have one camera only, whose
// entry may also stand alone, without its name. `file` is the name of the file in messages. The models are those that
// state their names in Kalibr's terms (CameraModelFacts::kalibr), and pinhole. The values are not yet checked
// (CheckCamera). Throws InputError on a fault, and if several cameras are in question or none has the name.
Camera ReadCamchainCamera(const std::string& text, const std::filesystem::path& file, const std::string& camera);

// Returns all cameras, in the order of their numbers. Throws InputError on a fault, if a number is missing, and if the
// entry of a camera stands alone.
std::vector<ChainedCamera> ReadCamchain(const std::string& text, const std::filesystem::path& file);

}  // namespace heba
