#include "tools/config/target_shape_key.h"

#include "heba/base/error.h"
#include "tools/config/common_keys.h"
#include "tools/run/free_points.h"

namespace heba {

RunConfig WithTargetShape(RunConfig config, MapReader& refine) {
  const FreeShape shape = ReadFreeShape(refine);
  Dataset& data = config.data;
  config.options.calibration.choose_target_shape = shape.is_chosen;
  for (ProblemTarget& target : data.rig.targets) target.free_shape = shape.groups;
  const bool has_points = GroupsOfSurface(shape.groups).size() != shape.groups.size();
  if (has_points && !data.target_poses.empty()) {
    refine.Get("target_shape").Fail("points are estimated from images or corners, not from captures.target_poses");
  }
  if (!data.target_poses.empty()) return config;
  try {
    TargetsWithFreePoints(data);
  } catch (const InputError& error) {
    refine.Get("target_shape").Fail(error.what());
  }
  return config;
}

}  // namespace heba
