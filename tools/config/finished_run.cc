#include "tools/config/finished_run.h"
#include "tools/config/common_keys.h"

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/result_file.h"
#include "tools/config/capture_section.h"
#include "tools/config/robot_section.h"

namespace heba {

const RobotSummary* FinishedRun::FindArm() const {
  const bool is_estimated = result.robot && result.robot->is_estimated && solution().shared_effects != nullptr;
  return is_estimated ? &*result.robot : nullptr;
}

std::filesystem::path RunFolderOf(const std::filesystem::path& run) {
  std::error_code error;
  const bool is_result = run.filename() == "result.json" && std::filesystem::is_regular_file(run, error);
  if (!is_result) return run;
  return run.has_parent_path() ? run.parent_path() : std::filesystem::path(".");
}

FinishedRun ReadFinishedRun(const std::filesystem::path& path) {
  const std::filesystem::path folder = RunFolderOf(path);
  FinishedRun run;
  run.result = ReadResult(folder / "result.json");
  if (FindRefined(run.result) == nullptr) {
    throw InputError(folder.string() +
                     ": contains no refined estimate; a calibration from images or corners is needed");
  }
  MapReader config(ReadYamlFile(folder / "config.yaml"));
  run.target = ReadTarget(config, "target");
  MapReader captures(config.Get("captures"));
  run.pose_reading = ReadPoseReading(captures);
  run.joints_are_deg = ReadJointsAreDeg(captures);
  return run;
}

void CheckImageSize(const FinishedRun& run, const CaptureDetection& seen, const std::string& image) {
  const Camera& camera = FindRefined(run.result)->camera;
  if (seen.width_px == camera.width_px && seen.height_px == camera.height_px) return;
  throw InputError(image + ": is " + ImageSizeText(seen.width_px, seen.height_px) + ", but the calibration is for " +
                   ImageSizeText(camera.width_px, camera.height_px));
}

}  // namespace heba
