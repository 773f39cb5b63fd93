#include "solvers/calibration/shared_causes.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

namespace heba {
namespace {

constexpr size_t kLeastShared = 3;

std::string NumAndNames(const std::vector<const View*>& views, const char* between) {
  return "so do all " + std::to_string(views.size()) + " captures " + between + views.front()->name + " to " +
         views.back()->name;
}

// Returns the views that follow one another in time without a used one between them.
std::vector<std::vector<const View*>> Runs(const std::vector<View>& left_out, const std::vector<View>& used) {
  std::map<size_t, const View*> in_order;  // Null for a capture that is used.
  for (const View& view : used) in_order[view.capture] = nullptr;
  for (const View& view : left_out) in_order[view.capture] = &view;
  std::vector<std::vector<const View*>> runs(1);
  for (const auto& [capture, view] : in_order) {
    if (view != nullptr) {
      runs.back().push_back(view);
    } else if (!runs.back().empty()) {
      runs.emplace_back();
    }
  }
  return runs;
}

// Returns the views that lie beside each other: groups that the nearest poses join.
std::vector<std::vector<const View*>> Regions(Setup setup, const std::vector<View>& left_out,
                                              const std::vector<View>& used) {
  constexpr double kLeverM = 0.5;
  constexpr size_t kNumNearest = 2;
  std::vector<Rigid3d> poses;
  for (const std::vector<View>* const views : {&left_out, &used}) {
    for (const View& view : *views) poses.push_back(BaseFromGripper(setup, view.camera_mount_from_target_mount));
  }
  std::vector<size_t> region(left_out.size());
  std::iota(region.begin(), region.end(), size_t{0});
  std::vector<bool> is_inside(left_out.size(), false);
  for (size_t i = 0; i < left_out.size(); ++i) {
    std::vector<std::pair<double, size_t>> others;
    for (size_t j = 0; j < poses.size(); ++j) {
      const double distance_m = DistanceM(poses[i], poses[j]) + kLeverM * AngleRad(poses[i], poses[j]);
      if (j != i) others.emplace_back(distance_m, j);
    }
    if (others.size() < kNumNearest) continue;
    std::partial_sort(others.begin(), others.begin() + kNumNearest, others.end());
    is_inside[i] = std::all_of(others.begin(), others.begin() + kNumNearest,
                               [&](const auto& other) { return other.second < left_out.size(); });
    if (!is_inside[i]) continue;
    for (size_t k = 0; k < kNumNearest; ++k) {
      std::replace(region.begin(), region.end(), region[others[k].second], region[i]);
    }
  }
  std::map<size_t, std::vector<const View*>> members;
  for (size_t i = 0; i < left_out.size(); ++i) {
    if (is_inside[i]) members[region[i]].push_back(&left_out[i]);
  }
  std::vector<std::vector<const View*>> regions;
  for (const auto& [name, views] : members) regions.push_back(views);
  return regions;
}

}  // namespace

std::vector<std::string> SharedCauses(Setup setup, const std::vector<View>& left_out, const std::vector<View>& used) {
  std::map<size_t, std::string> text_of;
  for (const std::vector<const View*>& region : Regions(setup, left_out, used)) {
    if (region.size() < kLeastShared) continue;
    for (const View* const view : region) {
      text_of[view->capture] = NumAndNames(region, "whose poses lie beside it, from ") +
                               ": they share an error, as in a part of the workspace or in a configuration of the arm "
                               "that the others do not show";
    }
  }
  for (const std::vector<const View*>& run : Runs(left_out, used)) {
    if (run.size() < kLeastShared) continue;
    for (const View* const view : run) {
      text_of[view->capture] = NumAndNames(run, "from ") +
                               ": their poses share an error, as after a motion of camera or target, in another frame "
                               "or in a configuration of the arm that the others do not show";
    }
  }
  std::vector<std::string> texts;
  for (const View& view : left_out) texts.push_back(text_of[view.capture]);
  return texts;
}

}  // namespace heba
