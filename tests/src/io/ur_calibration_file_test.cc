#include "heba/io/ur_calibration_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/base/units.h"
#include "heba/io/arm_file.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/arm_captures.h"
#include "tests/support/arm_joints.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

using testing::HasSubstr;

// A factory calibration that a user published (Universal Robots' forum, "Calibrated kinamatics info", 2021).
constexpr const char* kFactory = R"([mounting]
delta_theta = [ -8.20642406610186392e-05, -0.103609197138685979, 0.673631891251821102, -0.57016974724960845, -4.59636351675856217e-05, 9.74999561134540574e-07]
delta_a = [ -0.000161187342296687116, 0.00304003843792177708, 0.0916468555721788314, -9.62964975953143595e-05, -2.97595340762196176e-05, 0]
delta_d = [ 0.000505390894843998906, 11.1984514757821039, -92.5270326908668181, 81.3282683520703529, -0.000212852818740727479, -0.000126145560998547346]
delta_alpha = [ -0.00032142399895862539, -0.00565024518540147101, -0.00378922621833689211, -0.00106533274011644252, 0.000999586303470856308, 0]
joint_checksum = [ 0x6e0f7bf, 0xa32a713f, 0xf636a50, 0x9ec2338a, 0xa1afded8, 0xb29b2979]
calibration_status = 2 # 0 == notInitialized / 1 == notLinearised / 2 == Linearised
)";

// Returns the six numbers of a line of a calibration.
std::vector<double> NumbersOf(const std::string& key, const std::string& text = kFactory) {
  const size_t begin = text.find('[', text.find(key)) + 1;
  std::vector<double> numbers;
  for (size_t at = begin; numbers.size() < 6; ++at) {
    numbers.push_back(std::stod(text.substr(at)));
    at = text.find_first_of(",]", at);
  }
  return numbers;
}

// Returns the largest difference (m, rad) between the poses of two arms in random postures.
double LargestDifference(const Arm& a, const Arm& b) {
  Rng rng(2);
  double largest = 0;
  for (int i = 0; i < 50; ++i) {
    const Eigen::VectorXd joints = RandomJoints(a, rng);
    largest = std::max(largest, LocalCoordinates(BaseFromTip(a, joints), BaseFromTip(b, joints)).norm());
  }
  return largest;
}

// The maker's parameters plus the deviations, as matrices of Denavit and Hartenberg.
TEST(UrCalibrationFileTest, DeviationsAddToTheMakersParameters) {
  const Arm& nominal = *FindArm("ur10e");
  const Arm read = ParseUrCalibration(kFactory, "calibration.conf", "ur10e");
  const std::vector<double> theta = NumbersOf("delta_theta");
  const std::vector<double> a = NumbersOf("delta_a");
  const std::vector<double> d = NumbersOf("delta_d");
  const std::vector<double> alpha = NumbersOf("delta_alpha");
  Rng rng(3);
  for (int i = 0; i < 20; ++i) {
    const Eigen::VectorXd joints = RandomJoints(nominal, rng);
    Eigen::Isometry3d textbook = Eigen::Isometry3d::Identity();
    for (size_t j = 0; j < 6; ++j) {
      const ArmJoint& at = nominal.joints[j];
      textbook = textbook *
                 Eigen::AngleAxisd(joints[static_cast<Eigen::Index>(j)] + theta[j], Eigen::Vector3d::UnitZ()) *
                 Eigen::Translation3d(at.a_m + a[j], 0, at.d_m + d[j]);
      // The translation along x is in the turned frame, as is the rotation about x.
      textbook = textbook * Eigen::AngleAxisd(at.alpha_rad + alpha[j], Eigen::Vector3d::UnitX());
    }
    const Rigid3d found = BaseFromTip(read, joints);
    // 1e-9 m leaves room for the rounding errors of terms of 100 m.
    EXPECT_LT((found.translation - textbook.translation()).norm(), 1e-9);
    EXPECT_LT((found.RotationMatrix() - textbook.linear()).norm(), 1e-9);
  }
}

TEST(UrCalibrationFileTest, HugeDeviationsOfParallelAxesCancel) {
  const Arm read = ParseUrCalibration(kFactory, "calibration.conf", "ur10e");
  // A factory calibration moves the flange by millimetres. 20 mm would be another arm.
  EXPECT_LT(LargestDifference(read, *FindArm("ur10e")), 0.02);
  for (const ArmJoint& joint : read.joints) {
    EXPECT_LT(std::abs(joint.d_m), 0.5);
    EXPECT_LT(std::abs(joint.beta_rad), 0.01);
  }
}

class EveryUrTest : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EveryUrTest, testing::Values("ur3", "ur5", "ur10", "ur5e", "ur16e", "ur30"),
                         [](const auto& test) { return std::string(test.param); });

TEST_P(EveryUrTest, ReadsWhatItWrites) {
  Rng rng(5);
  const Arm& nominal = *FindArm(GetParam());
  for (const double angle_deg : {0.0, 0.005, 0.05, 0.3}) {
    const Arm arm = WithChanges(nominal, DrawArmErrors(nominal, {DegToRad(0.2), 1e-3, DegToRad(angle_deg)}, rng));
    const Outcome<std::string> text = UrCalibrationText(arm);
    ASSERT_TRUE(text.ok()) << text.reason();
    const Arm read = ParseUrCalibration(*text, "calibration.conf", GetParam());
    EXPECT_LT(LargestDifference(arm, read), 1e-9) << angle_deg;
    // A second round starts from the parameters of the axes.
    const Outcome<std::string> again = UrCalibrationText(read);
    ASSERT_TRUE(again.ok()) << again.reason();
    EXPECT_LT(LargestDifference(arm, ParseUrCalibration(*again, "calibration.conf", GetParam())), 1e-9) << angle_deg;
  }
}

TEST_P(EveryUrTest, MakersArmHasNoDeviations) {
  const Outcome<std::string> text = UrCalibrationText(*FindArm(GetParam()));
  ASSERT_TRUE(text.ok()) << text.reason();
  EXPECT_LT(LargestDifference(*FindArm(GetParam()), ParseUrCalibration(*text, "calibration.conf", GetParam())), 1e-14);
  // Deviations that are no rounding error would have digits above 1e-9.
  for (const char* key : {"delta_theta", "delta_a", "delta_d", "delta_alpha"}) {
    for (const double number : NumbersOf(key, *text)) EXPECT_LT(std::abs(number), 1e-9) << *text;
  }
}

TEST(UrCalibrationFileTest, ReaderIsChosenByTheContent) {
  const TempFolder folder;
  const Arm& nominal = *FindArm("ur10e");
  WriteFileAtomically(folder.path() / "backup.txt", kFactory);
  EXPECT_LT(LargestDifference(ReadArmFile(folder.path() / "backup.txt", nominal),
                              ParseUrCalibration(kFactory, "calibration.conf", "ur10e")),
            1e-15);
}

TEST(UrCalibrationFileTest, WindowsLineEndsAndOtherSectionsAreAccepted) {
  std::string text = "[other]\nnonsense\n" + std::string(kFactory) + "\n[later]\ndelta_a = 7\n";
  for (size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2) text.insert(at, "\r");
  EXPECT_LT(
      LargestDifference(ParseUrCalibration(text, "c.conf", "ur10e"), ParseUrCalibration(kFactory, "c.conf", "ur10e")),
      1e-15);
}

TEST(UrCalibrationFileTest, FaultsAreNamedWithTheirLine) {
  const auto fault_with = [](const std::string& what, const std::string& replacement) {
    std::string text = kFactory;
    text.replace(text.find(what), what.size(), replacement);
    return InputErrorOf([&] { ParseUrCalibration(text, "c.conf", "ur10e"); });
  };
  EXPECT_THAT(fault_with("[mounting]", "[mountings]"), HasSubstr("c.conf: the section [mounting] has no key"));
  EXPECT_THAT(fault_with("[mounting]", "[mounting"), HasSubstr("c.conf:1: '[mounting' is not a section"));
  EXPECT_THAT(fault_with("delta_d =", "delta_e ="), HasSubstr("has no key 'delta_d'"));
  EXPECT_THAT(fault_with("delta_d =", "delta_a ="), HasSubstr("c.conf:4: 'delta_a' already occurs in line 3"));
  EXPECT_THAT(fault_with("delta_d = [ 0.0005", "delta_d = [ x"), HasSubstr("c.conf:4: delta_d: 'x"));
  EXPECT_THAT(fault_with("11.1984514757821039, ", ""), HasSubstr("six numbers are needed, one per joint, not 5"));
  EXPECT_THAT(fault_with("11.1984514757821039", "nan"), HasSubstr("is not possible"));
  EXPECT_THAT(fault_with("11.1984514757821039", "1e300"), HasSubstr("c.conf:4: delta_d: '1e300' is not possible"));
  EXPECT_THAT(fault_with("delta_a = [", "delta_a = "), HasSubstr("c.conf:3: delta_a: "));
  EXPECT_THAT(fault_with("delta_a = [", "delta_a ["), HasSubstr("c.conf:3: "));
  EXPECT_THAT(fault_with("status = 2", "status = 0"), HasSubstr("has not been calibrated"));
  EXPECT_THAT(InputErrorOf([] { ParseUrCalibration(kFactory, "c.conf", "franka_fr3"); }),
              HasSubstr("the arm is called 'franka_fr3'"));
}

TEST(UrCalibrationFileTest, OtherArmsAreRefused) {
  EXPECT_THAT(UrCalibrationText(*FindArm("kuka_kr6_r900")).reason(), HasSubstr("an arm of Universal Robots"));
  Arm arm = *FindArm("ur5e");
  arm.last_from_tip = Rigid3d(Eigen::Quaterniond::Identity(), {0.01, 0, 0});
  EXPECT_THAT(UrCalibrationText(arm).reason(), HasSubstr("not on the axis of its last joint"));
  arm = *FindArm("ur5e");
  arm.base_from_first = Rigid3d(Eigen::Quaterniond::Identity(), {0.01, 0, 0});
  EXPECT_THAT(UrCalibrationText(arm).reason(), HasSubstr("z axis of its base"));
}

}  // namespace
}  // namespace heba
