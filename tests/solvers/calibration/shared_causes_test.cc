// Tests of solvers/calibration/shared_causes.h.
#include "solvers/calibration/shared_causes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {
using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;

// A capture whose gripper is at x, y (m) in the base.
View At(size_t capture, double x_m, double y_m) {
  View view;
  view.name = std::to_string(capture);
  view.capture = capture;
  view.camera_mount_from_target_mount =
      CameraMountFromTargetMount(Setup::kEyeInHand, Rigid3d(Eigen::Quaterniond::Identity(), {x_m, y_m, 0.5}));
  return view;
}

// Captures at random places of one side of the workspace, without those of the other.
std::vector<View> OfOneSide() {
  Rng rng(1);
  std::vector<View> views;
  for (size_t i = 0; i < 20; ++i) {
    const double x_m = rng.Uniform(0, 0.5);
    views.push_back(At(2 * i, x_m, rng.Uniform(-0.5, 0.5)));
  }
  return views;
}

TEST(SharedCausesTest, CapturesInOnePartOfTheWorkspaceShareTheirCause) {
  const std::vector<View> left_out = {At(5, -0.5, 0.1), At(13, -0.52, 0.15), At(21, -0.48, 0.12), At(33, -0.5, 0.2)};
  EXPECT_THAT(SharedCauses(Setup::kEyeInHand, left_out, OfOneSide()),
              Each(AllOf(HasSubstr("so do all 4 captures whose poses lie beside it, from 5 to 33"),
                         HasSubstr("part of the workspace"))));
}

TEST(SharedCausesTest, CapturesThatFollowOneAnotherShareTheirCause) {
  std::vector<View> used = OfOneSide();
  const std::vector<View> left_out(used.begin() + 8, used.begin() + 12);
  used.erase(used.begin() + 8, used.begin() + 12);
  EXPECT_THAT(SharedCauses(Setup::kEyeInHand, left_out, used),
              Each(HasSubstr("so do all 4 captures from 16 to 22: their poses share an error")));
}

TEST(SharedCausesTest, ScatteredCapturesAreByThemselves) {
  std::vector<View> used = OfOneSide();
  std::vector<View> left_out;
  for (const size_t i : {17, 11, 3}) {
    left_out.push_back(used[i]);
    used.erase(used.begin() + static_cast<std::ptrdiff_t>(i));
  }
  EXPECT_THAT(SharedCauses(Setup::kEyeInHand, left_out, used), Each(""));
}

}  // namespace
}  // namespace heba
