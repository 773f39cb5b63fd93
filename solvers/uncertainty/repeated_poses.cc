#include "solvers/uncertainty/repeated_poses.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace heba {

namespace {

// A robot pose, and the posture in which it was reached.
struct Reached {
  Rigid3d pose;
  const std::vector<double>& joints;  // Empty if they are not known.
};

bool IsSamePosture(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return false;
  for (size_t j = 0; j < a.size(); ++j) {
    if (std::abs(a[j] - b[j]) > kSameJoint) return false;
  }
  return true;
}

// Returns the groups of poses that are the same.
PoseGroups GroupPoses(const std::vector<Reached>& poses) {
  // Sorted by x: only poses that are close in this order can be the same.
  std::vector<size_t> order(poses.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const double x_a = poses[a].pose.translation.x();
    const double x_b = poses[b].pose.translation.x();
    return x_a != x_b ? x_a < x_b : a < b;
  });
  std::vector<size_t> place(poses.size());
  for (size_t k = 0; k < order.size(); ++k) place[order[k]] = k;
  constexpr size_t kNone = static_cast<size_t>(-1);
  std::vector<size_t> group_of(poses.size(), kNone);
  PoseGroups groups;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (group_of[i] != kNone) continue;
    std::vector<size_t> group;
    const auto visit = [&](size_t k) {
      const size_t j = order[k];
      if (std::abs(poses[j].pose.translation.x() - poses[i].pose.translation.x()) > kSamePoseM) return false;
      const bool is_same = group_of[j] == kNone && DistanceM(poses[i].pose, poses[j].pose) <= kSamePoseM &&
                           AngleRad(poses[i].pose, poses[j].pose) <= kSamePoseRad &&
                           IsSamePosture(poses[i].joints, poses[j].joints);
      if (is_same) {
        group_of[j] = groups.size();
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

// `recorded` are views or pairs.
template <class Recorded>
std::vector<Reached> PosesOf(Setup setup, const std::vector<Recorded>& recorded) {
  std::vector<Reached> poses;
  for (const Recorded& capture : recorded) {
    poses.push_back({BaseFromGripper(setup, capture.camera_mount_from_target_mount), capture.joints});
  }
  return poses;
}

}  // namespace

PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views) { return GroupPoses(PosesOf(setup, views)); }

PoseGroups GroupByRobotPose(Setup setup, const std::vector<PosePair>& pairs) {
  return GroupPoses(PosesOf(setup, pairs));
}

}  // namespace heba
