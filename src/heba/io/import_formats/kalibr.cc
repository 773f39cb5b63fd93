// Kalibr's results of several cameras: *camchain*.yaml, or the folder that contains one. A camchain has cameras with
// their poses in each other, but no captures, and does not say what carries the cameras. A folder that also has images,
// tables or folders is a recording of the user's own.
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"
#include "heba/io/kalibr_camchain.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool IsCamchainFile(const fs::path& file) { return IsChainOfSeveral(BeginningOf(file)); }

// Returns the camchain of several cameras that a file is, or the only one of a folder; empty if there is none.
fs::path CamchainOf(const fs::path& source) {
  std::error_code error;
  if (!fs::is_directory(source, error)) return IsCamchainFile(source) ? source : fs::path();
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(source, error)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory(error) || HasImageSuffix(entry.path()) || name.ends_with(".csv")) return {};
    const bool is_named_so = name.find("camchain") != std::string::npos && name.ends_with(".yaml");
    if (is_named_so && IsCamchainFile(entry.path())) files.push_back(entry.path());
  }
  return files.size() == 1 ? files.front() : fs::path();
}

bool Matches(const fs::path& source) { return !CamchainOf(source).empty(); }

std::optional<ImportedCell> Read(const fs::path& source) {
  const fs::path found = CamchainOf(source);
  const fs::path file = found.empty() ? source : found;
  ImportedCell rig;
  rig.files = {file};
  const std::vector<ChainedCamera> chain = ReadCamchain(ReadTextFile(file), file);
  for (size_t c = 0; c < chain.size(); ++c) {
    ImportedCamera& camera = rig.cameras.emplace_back();
    camera.name = chain[c].name;
    camera.camera = chain[c].camera;
    if (!chain[c].camera_from_previous) continue;
    // In the direction of the table of `heba run`.
    const Rigid3d pose = Inverse(*chain[c].camera_from_previous);
    const Eigen::Vector3d t_mm = 1000 * pose.translation;
    const Eigen::Vector4d q = (pose.rotation.w() < 0 ? -1 : 1) * pose.rotation.coeffs();
    rig.remarks.push_back("by the camchain, camera " + chain[c].name + " in camera " + chain[c - 1].name + " is at [" +
                          Fixed(t_mm.x(), 3) + ", " + Fixed(t_mm.y(), 3) + ", " + Fixed(t_mm.z(), 3) +
                          "] mm, quaternion xyzw [" + Fixed(q[0], 6) + ", " + Fixed(q[1], 6) + ", " + Fixed(q[2], 6) +
                          ", " + Fixed(q[3], 6) + "]; to compare with the result");
  }
  return rig;
}

}  // namespace

ImportReader ImportReader_kalibr() { return {Matches, nullptr, Read}; }

}  // namespace heba
