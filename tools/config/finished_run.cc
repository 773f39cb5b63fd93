#include "tools/config/finished_run.h"

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/detection.h"
#include "heba/displaced_target.h"
#include "tools/config/capture_section.h"
#include "tools/config/common_keys.h"
#include "tools/config/run_folder.h"

namespace heba {
FinishedRun ReadFinishedRun(const std::filesystem::path& path) {
  const std::filesystem::path folder = RunFolderOf(path);
  FinishedRun run;
  run.result = ReadRefinedResult(folder);
  MapReader config(ReadYamlFile(folder / "config.yaml"));
  for (size_t t = 0; t < run.result.rig.targets.size(); ++t) {
    ProblemTarget& target = run.result.rig.targets[t];
    if (target.name.empty()) {
      run.targets.push_back(ReadTarget(config, "target"));
    } else {
      MapReader targets(config.Get("targets"));
      MapReader reader(targets.Get(target.name));
      run.targets.push_back(ReadTarget(reader, "target"));
    }
    if (t < run.result.point_offsets.size()) {
      run.targets.back() = Displaced(run.targets.back(), run.result.point_offsets[t]);
    }
    target.symmetries = run.targets.back()->Symmetries();
    // A file has the deviations of a shape, which its extent gives a meaning.
    TargetShape shape = DesignedShape(AllPoints(*run.targets.back()).points_in_target);
    shape.params = run.result.solution.shapes[t].params;
    run.result.solution.shapes[t] = shape;
    target.shape = shape;
  }
  for (const std::string& robot : run.result.rig.robots) {
    MapReader section(config.Get(config.Has("robots") ? "robots" : "captures"));
    MapReader reader(config.Has("robots") ? section.Get(robot) : section.value());
    run.pose_readings.push_back(ReadPoseReading(reader));
    run.joints_are_deg.push_back(ReadJointsAreDeg(reader));
  }
  run.wobble = ReadWobble(config);
  return run;
}

Detection DetectFor(const Camera& camera, const Target& target, const std::filesystem::path& image) {
  CaptureDetection seen = DetectCapture(target, image);
  CheckImageSize(camera, {seen.width_px, seen.height_px}, image.string());
  return std::move(seen.detection);
}

void CheckImageSize(const Camera& camera, const ImageSize& size, const std::string& image) {
  if (size.width_px == camera.width_px && size.height_px == camera.height_px) return;
  throw InputError(image + ": is " + ImageSizeText(size.width_px, size.height_px) + ", but the calibration is for " +
                   ImageSizeText(camera.width_px, camera.height_px));
}

}  // namespace heba
