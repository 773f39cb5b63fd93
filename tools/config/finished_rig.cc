#include "tools/config/finished_rig.h"

#include "heba/config/yaml_reader.h"
#include "heba/io/result_file.h"
#include "tools/config/capture_section.h"
#include "tools/config/common_keys.h"
#include "tools/config/finished_run.h"
#include "tools/config/robot_section.h"

namespace heba {

FinishedRig ReadFinishedRig(const std::filesystem::path& path) {
  const std::filesystem::path folder = RunFolderOf(path);
  FinishedRig rig;
  rig.result = ReadRigResult(folder / "result.json");
  MapReader config(ReadYamlFile(folder / "config.yaml"));
  MapReader targets(config.Get("targets"));
  for (RigTarget& target : rig.result.rig.targets) {
    MapReader reader(targets.Get(target.name));
    rig.targets.push_back(ReadTarget(reader, "target"));
    target.symmetries = rig.targets.back()->Symmetries();
  }
  for (const std::string& robot : rig.result.rig.robots) {
    MapReader section(config.Get(config.Has("robots") ? "robots" : "captures"));
    MapReader reader(config.Has("robots") ? section.Get(robot) : section.value());
    rig.pose_readings.push_back(ReadPoseReading(reader));
    rig.joints_are_deg.push_back(ReadJointsAreDeg(reader));
  }
  return rig;
}

}  // namespace heba
