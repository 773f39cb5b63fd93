// A camera of Kalibr's camchain: camera_model pinhole with distortion_model none, radtan (k1 k2 p1 p2) or equidistant,
// and the other models of kalibr_camchain.h.
#include "heba/io/camera_format.h"
#include "heba/io/kalibr_camchain.h"

namespace heba {
namespace {

Camera Read(const std::string& text, const std::filesystem::path& name) { return ReadCamchainCamera(text, name, ""); }

}  // namespace

CameraReader CameraReader_kalibr() { return {IsCamchain, Read, ReadCamchainCamera}; }

}  // namespace heba
