// Tests of heba/io/result_file.h.
#include "heba/io/result_file.h"

#include <memory>
#include <regex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/data/capture_role.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

// A result with a closed form, a refinement that failed, and one capture of each role.
RunResult SmallResult() {
  RunResult result = ShortResult(Setup::kEyeToHand, "chessboard", 48);
  result.name = "cell";
  for (const std::string_view name : kCaptureRoleNames) {
    ImageResult& image = result.images.emplace_back();
    image.capture = "image_" + std::string(name);
    image.image = image.capture;
    image.role = *FindCaptureRole(name);
  }
  Estimate closed;
  closed.method = "park";
  closed.reason = Failure("too few captures");
  Estimate refined;
  refined.method = kBundleMethod;
  refined.kind = EstimateKind::kRefined;
  refined.reason = Failure("not run");
  result.estimates = {closed, refined};
  return result;
}

// A result whose refinement has estimated the errors of an arm.
RunResult ResultWithEstimatedArm() {
  RunResult result = SmallResult();
  RobotSummary& robot = result.arms[0].emplace();
  robot.nominal = *FindArm("ur5e");
  robot.configuration = "shoulder +, elbow -, wrist +";
  robot.is_estimated = true;
  robot.errors = Eigen::VectorXd::Zero(robot.nominal.num_params());
  robot.error_sigmas.resize(static_cast<size_t>(robot.nominal.num_params()));
  Estimate& refined = result.estimates.back();
  refined.ok = true;
  refined.camera = {"pinhole", 64, 48, {60, 60, 32, 24}};
  PairSolution& solution = refined.solution.emplace();
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
    return ReadRunResult(folder_ / "result.json");
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
  ASSERT_EQ(read.images.size(), written.images.size());
  for (size_t i = 0; i < written.images.size(); ++i) EXPECT_EQ(read.images[i].role, written.images[i].role);
  ASSERT_EQ(read.estimates.size(), 2u);
  EXPECT_EQ(read.estimates[0].kind, EstimateKind::kClosedForm);
  EXPECT_EQ(read.estimates[1].kind, EstimateKind::kRefined);
}

TEST_F(ResultFileTest, OffsetsOfPointsAreReadAsTheyWereWritten) {
  RunResult written = SmallResult();
  EXPECT_TRUE(Read(ResultToJson(written)).point_offsets.at(0).empty());
  written.point_offsets = {{{3, {1e-4 / 3, -2e-4, 0}}, {17, {0, 0, 5e-4 / 7}}}};
  EXPECT_EQ(Read(ResultToJson(written)).point_offsets, written.point_offsets);
}

TEST_F(ResultFileTest, RefusesUnknownRolesAndKinds) {
  EXPECT_THAT(ErrorOf("\"translate_x\"", "\"translate_z\""),
              HasSubstr("the role is unknown; one of: home, translate_x"));
  EXPECT_THAT(ErrorOf("\"closed_form\"", "\"open_form\""),
              HasSubstr("the kind is unknown; one of: closed_form, refined"));
}

void ExpectSameArm(const PairSolution& read, const PairSolution& written) {
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
  const PairSolution& solution = *read.estimates.back().solution;
  const PairSolution& expected = *written.estimates.back().solution;
  ExpectSameArm(solution, expected);
  EXPECT_EQ(read.arms[0]->errors_name, written.arms[0]->errors_name);
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
  result.arms = {robot};
  return result;
}

TEST_F(ResultFileTest, CompliancesAndMassesOfAnArmAreReadAsTheyWereWritten) {
  const RunResult written = ResultWithArm();
  const std::string text = ResultToJson(written);
  EXPECT_THAT(text, HasSubstr("\"joint2.compliance\""));
  EXPECT_THAT(text, HasSubstr("\"rad/(N m)\""));
  EXPECT_THAT(text, testing::Not(HasSubstr("joint3.compliance")));
  const RunResult read = Read(text);
  ASSERT_TRUE(read.arms[0].has_value());
  EXPECT_EQ(read.arms[0]->errors, written.arms[0]->errors);
  EXPECT_EQ(read.arms[0]->error_sigmas, written.arms[0]->error_sigmas);
  const Eigen::VectorXd joints = Eigen::VectorXd::LinSpaced(6, -1, 1);
  EXPECT_EQ(GravityTorques(read.arms[0]->nominal, joints), GravityTorques(written.arms[0]->nominal, joints));
}

TEST_F(ResultFileTest, ResultsWithoutMassesAreRead) {
  RunResult written = ResultWithArm();
  written.arms[0]->nominal.load = nullptr;
  const RunResult read = Read(ResultToJson(written));
  ASSERT_TRUE(read.arms[0].has_value());
  EXPECT_EQ(read.arms[0]->nominal.load, nullptr);
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

Rigid3d Shifted(double x_m) { return {ExpRotation({0.1, 0.2, x_m}), {x_m, 0, 0}}; }

// A rig with a camera and a target on these mounts.
Problem CellOf(const std::vector<std::string>& arms, const std::string& camera, const std::string& target) {
  Problem rig;
  rig.robots = arms;
  rig.cameras.push_back({"top", *FindMount(arms, camera), {}});
  rig.cameras.back().mount_name = camera;
  rig.targets.push_back({"plate", *FindMount(arms, target), {}});
  rig.targets.back().mount_name = target;
  return rig;
}

class CellTruthTest : public testing::Test {
 protected:
  // Writes the truth of a rig, and reads it for another one.
  CellTruth ReadFor(const Problem& rig, const Problem& written) {
    WriteFileAtomically(folder_ / "truth.json", TruthToJson(written, TruthOf(written)));
    return ReadCellTruth(folder_ / "truth.json", rig);
  }
  static CellTruth TruthOf(const Problem& rig) {
    CellTruth truth{{Shifted(1)}, {Shifted(2)}, {Rigid3d()}, {std::nullopt}};
    for (size_t r = 1; r < rig.robots.size(); ++r) truth.world_from_base.emplace_back(Shifted(3));
    return truth;
  }
  const TempFolder folder_;
};

TEST_F(CellTruthTest, AMountMayHaveAnyOfItsNames) {
  const CellTruth one = ReadFor(CellOf({"arm"}, "base", "gripper"), CellOf({"arm"}, "world", "arm.gripper"));
  EXPECT_THAT(one.mount_from_camera[0], IsNearPose(Shifted(1), 1e-12, 1e-12));
  EXPECT_THAT(*one.mount_from_target[0], IsNearPose(Shifted(2), 1e-12, 1e-12));
  const CellTruth two =
      ReadFor(CellOf({"left", "right"}, "left.base", "world"), CellOf({"left", "right"}, "world", "left.base"));
  EXPECT_THAT(two.mount_from_camera[0], IsNearPose(Shifted(1), 1e-12, 1e-12));
  EXPECT_THAT(*two.world_from_base[1], IsNearPose(Shifted(3), 1e-12, 1e-12));
}

TEST_F(CellTruthTest, AnotherMountIsRefused) {
  EXPECT_THAT(InputErrorOf([&] { ReadFor(CellOf({"arm"}, "gripper", "world"), CellOf({"arm"}, "world", "world")); }),
              HasSubstr("cameras: top: pose: is the pose of 'top' in 'world'; that of 'top' in 'gripper' is needed"));
  EXPECT_THAT(InputErrorOf([&] {
                ReadFor(CellOf({"left", "right"}, "right.base", "world"), CellOf({"left", "right"}, "world", "world"));
              }),
              HasSubstr("that of 'top' in 'right.base' is needed"));
}

// An unknown pose is read as unknown, and not as the identity.
TEST_F(CellTruthTest, PosesOfTargetsAndBasesMayBeUnknown) {
  const Problem rig = CellOf({"left", "right"}, "world", "world");
  CellTruth truth = TruthOf(rig);
  truth.mount_from_target[0].reset();
  truth.world_from_base[1].reset();
  WriteFileAtomically(folder_ / "truth.json", TruthToJson(rig, truth));
  const CellTruth read = ReadCellTruth(folder_ / "truth.json", rig);
  EXPECT_FALSE(read.mount_from_target[0].has_value());
  EXPECT_FALSE(read.world_from_base[1].has_value());
  EXPECT_TRUE(read.world_from_base[0].has_value());
}

// A rig with two arms, of which the errors of the second were estimated, and those of the first declined.
RunResult ResultWithArms() {
  RunResult result;
  result.name = "cell";
  result.rig = CellOf({"left", "right"}, "world", "right.gripper");
  Solution& solution = result.solution;
  solution.poses = {{Shifted(1)}, {Shifted(2)}, {Rigid3d(), Shifted(3)}};
  solution.cameras = {{"pinhole", 64, 48, {60, 60, 32, 24}}};
  result.rig.cameras[0].camera = solution.cameras[0];
  solution.shapes.resize(1);
  solution.pixel_sigmas_px = {0.1};
  solution.image_sigmas_px = {0};
  solution.robot_noise = {RobotNoise{1e-4, 1e-3, 0}, RobotNoise{2e-5, 1e-4, 0}};
  solution.robot_noise_stddev.resize(2);
  result.target_types = {"chessboard"};
  result.errors.resize(1);
  const Arm nominal = *FindArm("ur10e");
  for (const bool is_estimated : {false, true}) {
    RobotSummary& robot = result.arms.emplace_back(RobotSummary()).value();
    robot.nominal = nominal;
    robot.tip_from_gripper = Shifted(0.1);
    robot.has_recorded_joints = is_estimated;
    robot.configuration = is_estimated ? "" : "shoulder +, elbow -, wrist +";
    robot.is_estimated = is_estimated;
    robot.reason = Failure(is_estimated ? "" : "they are not significantly better");
    robot.errors = Eigen::VectorXd::Zero(nominal.num_params());
    robot.error_sigmas.resize(static_cast<size_t>(nominal.num_params()));
    robot.undetermined = {{"joint1.offset", "the poses of what is fixed in the base"}};
    robot.noise_before = RobotNoise{1e-4, 1e-3, 0};
    robot.noise_after = RobotNoise{2e-5, 1e-4, 0};
  }
  const auto shared = std::make_shared<const SharedEffects>(ArmErrors(nominal, ArmErrorModel::kGeometry));
  result.rig.effects = {nullptr, shared};
  // Lengths of which the sums with those of the arm lose digits.
  solution.effects = {Eigen::VectorXd(), 1e-3 * Eigen::VectorXd::LinSpaced(shared->size(), -1.0 / 3, 1.0 / 7)};
  solution.effect_sigmas = {{}, std::vector<double>(shared->groups.size(), 2e-4)};
  RobotSummary& estimated = *result.arms[1];
  estimated.errors_name = shared->name;
  estimated.errors = AllEffects(*shared, solution.effects[1]);
  for (const SharedEffect& effect : shared->effects) estimated.error_sigmas[static_cast<size_t>(effect.index)] = 1e-4;
  solution.covariance.layout = UnknownsOf(result.rig);
  const Eigen::Index size = solution.covariance.layout.size();
  const Eigen::MatrixXd root = Eigen::MatrixXd::Identity(size, size) + Eigen::MatrixXd::Constant(size, size, 0.25);
  solution.covariance.matrix = 1e-8 * root * root.transpose();
  return result;
}

TEST(CellResultFileTest, ErrorsOfArmsAreReadAsTheyWereWritten) {
  const TempFolder folder;
  const RunResult written = ResultWithArms();
  const std::string text = ResultToJson(written);
  WriteFileAtomically(folder / "result.json", text);
  const RunResult read = ReadRunResult(folder / "result.json");
  EXPECT_EQ(ResultToJson(read), text);
  EXPECT_EQ(FindEstimatedArm(read, 0), nullptr);
  EXPECT_EQ(WhyNotEstimated(read, 0),
            "the kinematics of the arm left were not estimated (they are not significantly better)");
  const RobotSummary* const arm = FindEstimatedArm(read, 1);
  ASSERT_NE(arm, nullptr);
  EXPECT_EQ(arm->errors_name, written.arms[1]->errors_name);
  EXPECT_EQ(read.solution.effects[1], written.solution.effects[1]);
  EXPECT_EQ(read.solution.effect_sigmas, written.solution.effect_sigmas);
  EXPECT_EQ(read.rig.effects[0], nullptr);
  EXPECT_EQ(read.rig.effects[1]->Names(), written.rig.effects[1]->Names());
  EXPECT_EQ(read.solution.covariance.layout.Names(), written.solution.covariance.layout.Names());
  EXPECT_EQ(read.solution.covariance.matrix, written.solution.covariance.matrix);
}

TEST(CellResultFileTest, AnUnknownParameterOfAnArmIsRefused) {
  const TempFolder folder;
  std::string text = ResultToJson(ResultWithArms());
  const size_t at = text.find("\"joint2.offset\"", text.find("\"estimated\": {"));
  ASSERT_NE(at, std::string::npos);
  text.replace(at, 15, "\"joint9.offset\"");
  WriteFileAtomically(folder / "result.json", text);
  EXPECT_THAT(InputErrorOf([&] { ReadRunResult(folder / "result.json"); }),
              HasSubstr("'joint9.offset' is estimated, but the arm has no such parameter"));
}

// A result of either schema is read in one form.
TEST(WholeResultTest, HasCamerasAndArmsOfEitherSchema) {
  const TempFolder folder;
  const RunResult one = ResultWithEstimatedArm();
  WriteFileAtomically(folder / "one.json", ResultToJson(one));
  const RunResult whole = ReadWholeResult(folder / "one.json");
  ASSERT_EQ(whole.rig.cameras.size(), 1U);
  EXPECT_EQ(whole.rig.cameras[0].name, "");
  EXPECT_EQ(whole.solution.covariance.layout.Names(), UnknownsOf(whole.rig).Names());
  EXPECT_EQ(whole.solution.covariance.matrix, one.estimates.back().solution->covariance.matrix);
  ASSERT_NE(FindEstimatedArm(whole, 0), nullptr);
  const RunResult several = ResultWithArms();
  WriteFileAtomically(folder / "several.json", ResultToJson(several));
  EXPECT_EQ(ResultToJson(ReadWholeResult(folder / "several.json")), ResultToJson(several));
}

// Without images, the estimate of the poses stands for the result; without it, there is no result.
TEST(WholeResultTest, PosesAloneHaveAResultWithoutACamera) {
  const TempFolder folder;
  RunResult result = ResultWithEstimatedArm();
  Estimate& chain = result.estimates.back();
  chain.method = kChainMethod;
  chain.camera = Camera();
  PairSolution& solution = *chain.solution;
  solution.covariance.layout = HandEyePoses();
  solution.covariance.layout.AddEffects(kRobotBlock, solution.shared_effects->Names());
  WriteFileAtomically(folder / "result.json", ResultToJson(result));
  const RunResult whole = ReadWholeResult(folder / "result.json");
  EXPECT_TRUE(whole.solution.cameras[0].params.empty());
  EXPECT_EQ(whole.solution.covariance.matrix, solution.covariance.matrix);
  ASSERT_NE(FindEstimatedArm(whole, 0), nullptr);
  EXPECT_EQ(whole.solution.effects[0], solution.effects);
  chain.ok = false;
  WriteFileAtomically(folder / "result.json", ResultToJson(result));
  EXPECT_THAT(InputErrorOf([&] { ReadWholeResult(folder / "result.json"); }),
              HasSubstr("contains no refined estimate"));
}

TEST(WholeResultTest, AnArmWithoutANameIsNotNamed) {
  RunResult result = ResultWithEstimatedArm();
  result.arms[0]->is_estimated = false;
  result.arms[0]->reason = Failure("they are not significantly better");
  EXPECT_EQ(WhyNotEstimated(WithFinalEstimate(result), 0),
            "the kinematics of the arm were not estimated (they are not significantly better)");
  result.arms[0].reset();
  EXPECT_EQ(WhyNotEstimated(WithFinalEstimate(result), 0),
            "the kinematics of the arm were not estimated; the config names no arm (robot.model)");
}

TEST(CaptureRoleTest, NamesAndRolesAreInverse) {
  for (const std::string_view name : kCaptureRoleNames) EXPECT_EQ(RoleName(*FindCaptureRole(name)), name);
  EXPECT_EQ(RoleName(CaptureRole::kTranslateY), "translate_y");
  EXPECT_EQ(RoleName(CaptureRole::kNone), "");
  EXPECT_FALSE(FindCaptureRole("hoem").has_value());
}

}  // namespace
}  // namespace heba
