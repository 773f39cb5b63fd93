#include "solvers/residuals/repeated_poses.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace heba {

namespace {

bool IsSamePosture(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return false;
  for (size_t j = 0; j < a.size(); ++j) {
    if (std::abs(a[j] - b[j]) > kSameJoint) return false;
  }
  return true;
}

bool AreSame(const ReachedPoses& a, const ReachedPoses& b) {
  for (size_t r = 0; r < a.size(); ++r) {
    if (DistanceM(a[r].base_from_gripper, b[r].base_from_gripper) > kSamePoseM ||
        AngleRad(a[r].base_from_gripper, b[r].base_from_gripper) > kSamePoseRad ||
        !IsSamePosture(a[r].joints, b[r].joints)) {
      return false;
    }
  }
  return true;
}

// `recorded` are views or pairs.
template <class Recorded>
PoseGroups GroupRecorded(Setup setup, const std::vector<Recorded>& recorded) {
  std::vector<ReachedPoses> captures;
  for (const Recorded& capture : recorded) {
    captures.push_back({{BaseFromGripper(setup, capture.camera_mount_from_target_mount), capture.joints}});
  }
  return GroupPoses(captures);
}

}  // namespace

PoseGroups GroupPoses(const std::vector<ReachedPoses>& captures) {
  // Sorted by the x of the first arm: only captures that are close in this order can be the same.
  const auto x_of = [&](size_t i) {
    return captures[i].empty() ? 0 : captures[i][0].base_from_gripper.translation.x();
  };
  std::vector<size_t> order(captures.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const double x_a = x_of(a);
    const double x_b = x_of(b);
    return x_a != x_b ? x_a < x_b : a < b;
  });
  std::vector<size_t> place(captures.size());
  for (size_t k = 0; k < order.size(); ++k) place[order[k]] = k;
  std::vector<bool> has_group(captures.size(), false);
  PoseGroups groups;
  for (size_t i = 0; i < captures.size(); ++i) {
    if (has_group[i]) continue;
    std::vector<size_t> group;
    const auto visit = [&](size_t k) {
      const size_t j = order[k];
      if (std::abs(x_of(j) - x_of(i)) > kSamePoseM) return false;
      if (!has_group[j] && AreSame(captures[j], captures[i])) {
        has_group[j] = true;
        group.push_back(j);
      }
      return true;
    };
    for (size_t k = place[i]; k < order.size() && visit(k); ++k) {
    }
    for (size_t k = place[i]; k > 0 && visit(k - 1); --k) {
    }
    std::sort(group.begin(), group.end());
    groups.push_back(std::move(group));
  }
  return groups;
}

PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views) { return GroupRecorded(setup, views); }

PoseGroups GroupByRobotPose(Setup setup, const std::vector<PosePair>& pairs) { return GroupRecorded(setup, pairs); }

}  // namespace heba
