#include "tools/run/free_points.h"

#include <algorithm>
#include <string>
#include <utility>

#include "heba/base/error.h"
#include "heba/displaced_target.h"

namespace heba {

std::vector<size_t> TargetsWithFreePoints(const Dataset& dataset) {
  std::vector<size_t> targets;
  for (size_t t = 0; t < dataset.rig.targets.size(); ++t) {
    const ProblemTarget& target = dataset.rig.targets[t];
    const std::vector<TargetShapeGroup>& groups = target.free_shape;
    if (std::find(groups.begin(), groups.end(), TargetShapeGroup::kPoints) == groups.end()) continue;
    if (dataset.targets[t]->Symmetries().size() > 1) {
      throw InputError("the target" + (target.name.empty() ? "" : " " + target.name) +
                       " looks the same in several orientations, so that the positions of its points cannot be "
                       "estimated");
    }
    targets.push_back(t);
  }
  return targets;
}

std::vector<TargetShapeGroup> GroupsOfSurface(std::vector<TargetShapeGroup> groups) {
  std::erase(groups, TargetShapeGroup::kPoints);
  return groups;
}

std::vector<std::shared_ptr<const Target>> DisplacedTargets(const std::vector<std::shared_ptr<const Target>>& designed,
                                                            const std::vector<PointOffsets>& offsets) {
  std::vector<std::shared_ptr<const Target>> displaced;
  for (size_t t = 0; t < designed.size(); ++t) displaced.push_back(Displaced(designed[t], offsets[t]));
  return displaced;
}

std::vector<Finding> DescribePoints(const Problem& problem, const std::vector<size_t>& targets,
                                    const EstimatedPoints& points) {
  std::vector<Finding> findings;
  for (const size_t t : targets) {
    if (points.offsets[t].empty()) continue;
    const auto largest =
        std::max_element(points.offsets[t].begin(), points.offsets[t].end(),
                         [](const auto& a, const auto& b) { return a.second.norm() < b.second.norm(); });
    Finding& finding = findings.emplace_back();
    finding.code = FindingCode("points_estimated");
    finding.numbers = {{"sigma_mm", 1000 * points.sigma_m},
                       {"largest_mm", 1000 * largest->second.norm()},
                       {"largest_id", largest->first},
                       {"p", points.p_value}};
    const std::string& name = problem.targets[t].name;
    if (!name.empty()) finding.names = {{"of_target", name}};
  }
  return findings;
}

}  // namespace heba
