// Tests of heba/io/result_file.h.
#include "heba/io/result_file.h"

#include <memory>
#include <regex>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/data/capture_role.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

// A result with a closed form, a refinement that failed, and one capture of each role.
RunResult SmallResult() {
  RunResult result;
  result.name = "cell";
  result.target_type = "chessboard";
  for (const std::string_view name : kCaptureRoleNames) {
    CaptureResult capture;
    capture.image = "image_" + std::string(name);
    capture.role = *FindCaptureRole(name);
    result.captures.push_back(capture);
  }
  Estimate closed;
  closed.method = "park";
  closed.reason = "too few captures";
  Estimate refined;
  refined.method = kBundleMethod;
  refined.kind = EstimateKind::kRefined;
  refined.reason = "not run";
  result.estimates = {closed, refined};
  return result;
}

// A result whose refinement has estimated the errors of an arm.
RunResult ResultWithEstimatedArm() {
  RunResult result = SmallResult();
  result.robot.emplace();
  RobotSummary& robot = *result.robot;
  robot.nominal = *FindArm("ur5e");
  robot.configuration = "shoulder +, elbow -, wrist +";
  robot.is_estimated = true;
  robot.errors = Eigen::VectorXd::Zero(robot.nominal.num_params());
  robot.error_sigmas.resize(static_cast<size_t>(robot.nominal.num_params()));
  Estimate& refined = result.estimates.back();
  refined.ok = true;
  refined.camera = {"pinhole", 64, 48, {60, 60, 32, 24}};
  Solution& solution = refined.solution.emplace();
  const auto shared = std::make_shared<const SharedEffects>(ArmErrors(robot.nominal, ArmErrorModel::kGeometry));
  robot.errors_name = shared->name;
  solution.shared_effects = shared;
  solution.effects = Eigen::VectorXd::LinSpaced(shared->size(), 1e-4, 2e-3);
  for (size_t i = 0; i < shared->groups.size(); ++i)
    solution.effect_sigmas.push_back(1e-3 * static_cast<double>(i + 1));
  robot.errors = AllEffects(*shared, solution.effects);
  for (const SharedEffect& effect : shared->effects) robot.error_sigmas[static_cast<size_t>(effect.index)] = 1e-4;
  solution.covariance.layout = HandEyeUnknowns(refined.camera.Model(), {{false, false, false, false}, shared});
  const Eigen::Index size = solution.covariance.layout.size();
  const Eigen::MatrixXd root = Eigen::MatrixXd::Identity(size, size) + Eigen::MatrixXd::Constant(size, size, 0.25);
  solution.covariance.matrix = 1e-8 * root * root.transpose();
  return result;
}

class ResultFileTest : public testing::Test {
 protected:
  RunResult Read(const std::string& text) const {
    WriteFileAtomically(folder_ / "result.json", text);
    return ReadResult(folder_ / "result.json");
  }
  // Returns the error of a result in which the first `from` is replaced.
  std::string ErrorOf(const std::string& from, const std::string& to) const {
    std::string text = ResultToJson(SmallResult());
    const size_t at = text.find(from);
    if (at == std::string::npos) return "the result has no " + from;
    text.replace(at, from.size(), to);
    return InputErrorOf([&] { Read(text); });
  }

 private:
  TempFolder folder_;
};

TEST_F(ResultFileTest, RolesAndKindsAreReadAsTheyWereWritten) {
  const RunResult written = SmallResult();
  const RunResult read = Read(ResultToJson(written));
  ASSERT_EQ(read.captures.size(), written.captures.size());
  for (size_t i = 0; i < written.captures.size(); ++i) EXPECT_EQ(read.captures[i].role, written.captures[i].role);
  ASSERT_EQ(read.estimates.size(), 2u);
  EXPECT_EQ(read.estimates[0].kind, EstimateKind::kClosedForm);
  EXPECT_EQ(read.estimates[1].kind, EstimateKind::kRefined);
}

TEST_F(ResultFileTest, RefusesUnknownRolesAndKinds) {
  EXPECT_THAT(ErrorOf("\"translate_x\"", "\"translate_z\""),
              HasSubstr("the role is unknown; one of: home, translate_x"));
  EXPECT_THAT(ErrorOf("\"closed_form\"", "\"open_form\""),
              HasSubstr("the kind is unknown; one of: closed_form, refined"));
}

void ExpectSameArm(const Solution& read, const Solution& written) {
  ASSERT_NE(read.shared_effects, nullptr);
  EXPECT_EQ(read.shared_effects->num_all, written.shared_effects->num_all);
  EXPECT_EQ(read.shared_effects->Names(), written.shared_effects->Names());
  ASSERT_EQ(read.effects.size(), written.effects.size());
  // Values are written as sums with the nominal parameters, of up to 1 m.
  EXPECT_LT((read.effects - written.effects).cwiseAbs().maxCoeff(), 1e-15);
  for (size_t i = 0; i < written.shared_effects->effects.size(); ++i) {
    EXPECT_EQ(read.shared_effects->effects[i].index, written.shared_effects->effects[i].index);
  }
  EXPECT_EQ(read.covariance.layout.Names(), written.covariance.layout.Names());
  EXPECT_EQ(read.covariance.matrix, written.covariance.matrix);
}

TEST_F(ResultFileTest, ErrorsOfAnArmAreReadAsTheyWereWritten) {
  const RunResult written = ResultWithEstimatedArm();
  const RunResult read = Read(ResultToJson(written));
  const Solution& solution = *read.estimates.back().solution;
  const Solution& expected = *written.estimates.back().solution;
  ExpectSameArm(solution, expected);
  EXPECT_EQ(read.robot->errors_name, written.robot->errors_name);
  EXPECT_EQ(solution.effect_sigmas, expected.effect_sigmas);
  for (size_t i = 0; i < expected.shared_effects->effects.size(); ++i) {
    EXPECT_EQ(solution.shared_effects->effects[i].group, expected.shared_effects->effects[i].group);
  }
}

TEST_F(ResultFileTest, ErrorsOfAnArmAreReadFromResultsWithoutTheirGroups) {
  const RunResult written = ResultWithEstimatedArm();
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(ResultToJson(written));
  ASSERT_EQ(json["estimates"].back()["robot"].erase("estimated"), 1U);
  const RunResult read = Read(json.dump());
  ExpectSameArm(*read.estimates.back().solution, *written.estimates.back().solution);
}

// A result of the arm with its masses and the compliances that were estimated.
RunResult ResultWithArm() {
  RunResult result = SmallResult();
  RobotSummary robot;
  robot.nominal = *FindArm("ur5e");
  robot.is_estimated = true;
  robot.errors = Eigen::VectorXd::Zero(robot.nominal.num_params());
  robot.error_sigmas.resize(static_cast<size_t>(robot.nominal.num_params()));
  const int place = ArmParamPlace(1, ArmParam::kCompliance);
  robot.errors[place] = 1.5e-5;
  robot.error_sigmas[static_cast<size_t>(place)] = 1e-6;
  result.robot = robot;
  return result;
}

TEST_F(ResultFileTest, CompliancesAndMassesOfAnArmAreReadAsTheyWereWritten) {
  const RunResult written = ResultWithArm();
  const std::string text = ResultToJson(written);
  EXPECT_THAT(text, HasSubstr("\"joint2.compliance\""));
  EXPECT_THAT(text, HasSubstr("\"rad/(N m)\""));
  EXPECT_THAT(text, testing::Not(HasSubstr("joint3.compliance")));
  const RunResult read = Read(text);
  ASSERT_TRUE(read.robot.has_value());
  EXPECT_EQ(read.robot->errors, written.robot->errors);
  EXPECT_EQ(read.robot->error_sigmas, written.robot->error_sigmas);
  const Eigen::VectorXd joints = Eigen::VectorXd::LinSpaced(6, -1, 1);
  EXPECT_EQ(GravityTorques(read.robot->nominal, joints), GravityTorques(written.robot->nominal, joints));
}

TEST_F(ResultFileTest, ResultsWithoutMassesAreRead) {
  RunResult written = ResultWithArm();
  written.robot->nominal.load = nullptr;
  const RunResult read = Read(ResultToJson(written));
  ASSERT_TRUE(read.robot.has_value());
  EXPECT_EQ(read.robot->nominal.load, nullptr);
  std::string text = ResultToJson(ResultWithArm());
  const std::string mass = "\"mass_kg\"";
  text.replace(text.find(mass), mass.size(), "\"mass\"");
  EXPECT_THAT(InputErrorOf([&] { Read(text); }), HasSubstr("some joints have no mass_kg"));
}

// Files of versions before the compliances have five parameters per joint.
TEST(TruthFileTest, EarlierFilesHaveNoCompliances) {
  const TempFolder folder;
  Truth truth;
  truth.arm_errors = Eigen::VectorXd::LinSpaced(2 * kNumArmParams, 1, 12);
  const std::string text = TruthToJson(truth, Setup::kEyeToHand);
  WriteFileAtomically(folder.path() / "new.json", text);
  EXPECT_EQ(ReadTruth(folder.path() / "new.json", Setup::kEyeToHand).arm_errors, truth.arm_errors);
  WriteFileAtomically(folder.path() / "old.json",
                      std::regex_replace(text, std::regex(",?\\s*\"joint[12].compliance\": [0-9.]+"), ""));
  Eigen::VectorXd without = truth.arm_errors;
  without[5] = without[11] = 0;
  EXPECT_EQ(ReadTruth(folder.path() / "old.json", Setup::kEyeToHand).arm_errors, without);
}

TEST(CaptureRoleTest, NamesAndRolesAreInverse) {
  for (const std::string_view name : kCaptureRoleNames) EXPECT_EQ(RoleName(*FindCaptureRole(name)), name);
  EXPECT_EQ(RoleName(CaptureRole::kTranslateY), "translate_y");
  EXPECT_EQ(RoleName(CaptureRole::kNone), "");
  EXPECT_FALSE(FindCaptureRole("hoem").has_value());
}

}  // namespace
}  // namespace heba
