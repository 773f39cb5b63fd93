// The kinematics of an arm in result files, as far as they were estimated.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/data/shared_effects.h"
#include "heba/evaluation/evaluation.h"
#include "heba/io/result_json.h"

namespace heba {

Json ArmJson(const RobotSummary& robot);
// Throws InputError with the position in the file.
RobotSummary ReadArmJson(const JsonReader& reader);

// The errors of an arm that are part of a solution.
struct ArmEffects {
  std::shared_ptr<const SharedEffects> shared;
  Eigen::VectorXd values;      // One per effect of `shared`.
  std::vector<double> sigmas;  // The standard deviation of each of its groups.
};
// Returns the groups and the effects, the member "estimated" of ArmJson; null if there are none.
Json ArmEffectsJson(const ArmEffects& effects);
// Reads the effects `names` of an arm, whose errors were estimated, from its ArmJson with the member "estimated".
// Earlier results lack that member: the groups of their effects are not known.
ArmEffects ReadArmEffects(const JsonReader& reader, const RobotSummary& robot, const std::vector<std::string>& names);
// Likewise for all effects of the member "estimated", which must be there.
ArmEffects ReadArmEffects(const JsonReader& reader, const RobotSummary& robot);

}  // namespace heba
