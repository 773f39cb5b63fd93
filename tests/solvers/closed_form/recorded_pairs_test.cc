// Tests of the closed forms on pose pairs that others recorded, against figures that were computed independently of
// heba.
#include <cmath>

#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/setup.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "tests/support/data_sets.h"

namespace heba {
namespace {

// Reads pose pairs from a file with the columns i, then base_from_gripper and camera_from_target as x, y, z, qx, qy,
// qz, qw.
std::vector<PosePair> ReadPairs(const std::filesystem::path& path, Setup setup) {
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  std::vector<PosePair> pairs;
  while (std::getline(stream, line)) {
    std::vector<double> v;
    for (const std::string& field : Split(Trim(line), ',')) v.push_back(std::stod(field));
    const auto pose = [&](size_t at) {
      return Rigid3d(Eigen::Quaterniond(v[at + 6], v[at + 3], v[at + 4], v[at + 5]),
                     Eigen::Vector3d(v[at], v[at + 1], v[at + 2]));
    };
    pairs.push_back({CameraMountFromTargetMount(setup, pose(1)), pose(8)});
  }
  return pairs;
}

// Returns the methods that accept any motion, as recorded captures have.
std::vector<std::string> MethodsOfAnyMotion() {
  std::vector<std::string> names;
  for (const HandEyeMethod& method : HandEyeMethods()) {
    if (method.motion == MethodMotion::kAny) names.emplace_back(method.name);
  }
  return names;
}

struct Scatter {
  double mm;
  double deg;
};

Scatter ClosureOf(const std::string& method, const std::vector<PosePair>& pairs) {
  const Outcome<HandEye> found = FindHandEyeMethod(method)->solve(pairs);
  EXPECT_TRUE(found.ok()) << method << ": " << found.reason();
  // The closure error of the chain is computed with the method's own board pose.
  double mm2 = 0;
  double rad2 = 0;
  for (const PosePair& pair : pairs) {
    const Rigid3d predicted = CameraFromTarget(*found, pair.camera_mount_from_target_mount);
    mm2 += std::pow(1000 * DistanceM(predicted, pair.camera_from_target), 2);
    rad2 += std::pow(AngleRad(predicted, pair.camera_from_target), 2);
  }
  const double n = static_cast<double>(pairs.size());
  return {std::sqrt(mm2 / n), RadToDeg(std::sqrt(rad2 / n))};
}

// Independent figures (numpy and OpenCV on the same file): 1.55 to 1.9 mm and 0.42 deg for the accurate methods, and
// 1.47 mm after a refinement of the poses. In OpenCV, Tsai differs from the others by 2.2 deg and Daniilidis by 0.87
// deg.
TEST(RecordedPairsTest, AreConsistentOnTheDoosanEyeInHandSet) {
  const std::filesystem::path path = DataDir() / "doosan_charuco_pose_pairs" / "pairs.csv";
  HEBA_SKIP_WITHOUT(path);
  const std::vector<PosePair> pairs = ReadPairs(path, heba::Setup::kEyeInHand);
  ASSERT_EQ(pairs.size(), 31U);
  for (const char* method : {"park", "horaud", "andreff", "shah"}) {
    const Scatter scatter = ClosureOf(method, pairs);
    EXPECT_LT(scatter.mm, 4.0) << method;
    EXPECT_LT(scatter.deg, 0.6) << method;
    RecordProperty(method, Fixed(scatter.mm, 3) + " mm " + Fixed(scatter.deg, 3) + " deg");
  }
  for (const std::string& method : MethodsOfAnyMotion()) {
    const Scatter scatter = ClosureOf(method, pairs);
    EXPECT_LT(scatter.mm, 30.0) << method;
    EXPECT_LT(scatter.deg, 3.0) << method;
  }
}

// The errors of tsai, horaud and daniilidis in OpenCV 4.6 are 97 to 101 deg on this set; the accurate methods have
// 4.6 mm and 0.09 deg. All methods of heba must be accurate.
TEST(RecordedPairsTest, AreAccurateOnTheMoveitEyeToHandSet) {
  const std::filesystem::path path = DataDir() / "moveit_pose_pairs" / "pairs.csv";
  HEBA_SKIP_WITHOUT(path);
  const std::vector<PosePair> pairs = ReadPairs(path, heba::Setup::kEyeToHand);
  ASSERT_EQ(pairs.size(), 50U);
  for (const std::string& method : MethodsOfAnyMotion()) {
    const Scatter scatter = ClosureOf(method, pairs);
    EXPECT_LT(scatter.mm, 8.0) << method;
    EXPECT_LT(scatter.deg, 0.2) << method;
    const Outcome<HandEye> found = FindHandEyeMethod(method)->solve(pairs);
    // The publisher's own result is (0.659, -0.249, 0.830) m. The tolerance is 10 mm.
    EXPECT_NEAR(found->camera_mount_from_camera.translation.x(), 0.659, 0.01) << method;
    EXPECT_NEAR(found->camera_mount_from_camera.translation.y(), -0.249, 0.01) << method;
    EXPECT_NEAR(found->camera_mount_from_camera.translation.z(), 0.830, 0.01) << method;
  }
}

}  // namespace
}  // namespace heba
