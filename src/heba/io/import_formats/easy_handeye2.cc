// easy_handeye2's .samples: `parameters` with calibration_type, and `samples` of transforms robot and tracking. The
// transform tracking is camera_from_target; robot is base_from_effector for eye_in_hand, and its inverse for
// eye_on_base.
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) {
  const std::string text = BeginningOf(source);
  return text.find("samples:") != std::string::npos && text.find("robot:") != std::string::npos &&
         text.find("tracking:") != std::string::npos;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  MapReader root(ReadYamlFile(source));
  MapReader parameters(root.Get("parameters"));
  const std::string type = parameters.Choice("calibration_type", {"eye_in_hand", "eye_on_base"});
  const bool is_carried = type == "eye_in_hand";
  set.setup = is_carried ? Setup::kEyeInHand : Setup::kEyeToHand;
  for (const ConfigValue& entry : root.Get("samples").AsList()) {
    MapReader reader(entry);
    const Rigid3d robot = PoseOfTransform(reader.Get("robot"));
    ImportedCapture capture;
    capture.name = "sample_" + std::to_string(set.captures.size());
    capture.base_from_gripper = is_carried ? robot : Inverse(robot);
    capture.camera_from_target = PoseOfTransform(reader.Get("tracking"));
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_easy_handeye2() { return {Matches, Read}; }

}  // namespace heba
