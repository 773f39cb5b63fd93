#include "heba/io/export_files.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>

#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/geometry/rigid3.h"
#include "heba/io/export_format.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "tests/support/matchers.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

Rigid3d PoseOf(double number) { return {ExpRotation({0.1 * number, -0.2, 0.3}), Eigen::Vector3d(number, 0.5, -0.25)}; }

// A rig whose arms and cameras have these names and mounts.
RunResult CellOf(const std::vector<std::string>& arms, const std::vector<std::pair<std::string, Mount>>& cameras) {
  RunResult result;
  result.name = "cell";
  result.rig.robots = arms;
  Solution& solution = result.solution;
  for (size_t r = 0; r < arms.size(); ++r) {
    solution.poses.world_from_base.push_back(r == 0 ? Rigid3d() : PoseOf(10.0 + static_cast<double>(r)));
  }
  for (const auto& [name, mount] : cameras) {
    solution.poses.mount_from_camera.push_back(PoseOf(static_cast<double>(result.rig.cameras.size())));
    solution.cameras.push_back({"pinhole", 640, 480, {600, 600, 320, 240}});
    result.rig.cameras.push_back({name, mount, solution.cameras.back()});
  }
  solution.covariance.layout = UnknownsOf(result.rig);
  const int size = solution.covariance.layout.size();
  solution.covariance.matrix = 1e-6 * Eigen::MatrixXd::Identity(size, size);
  return result;
}

constexpr Mount kWorld{0, Mount::Part::kBase};
constexpr Mount kGripper{0, Mount::Part::kGripper};

std::vector<ExportedFile> FilesOf(const std::string& format, const RunResult& result, bool is_inverted = false) {
  ExportRequests requests = MakeExportRequests(result);
  for (std::vector<ExportRequest>* const poses : {&requests.cameras, &requests.bases}) {
    for (ExportRequest& pose : *poses) pose = is_inverted ? Inverted(pose) : pose;
  }
  return ExportFiles(*FindEntry(ExportFormats(), format), requests);
}

const ExportedFile& FileOf(const std::vector<ExportedFile>& files, const std::string& name) {
  static const ExportedFile none;
  const auto found = std::find_if(files.begin(), files.end(), [&](const auto& file) { return file.name == name; });
  if (found != files.end()) return *found;
  ADD_FAILURE() << "no file " << name;
  return none;
}

std::vector<std::string> NamesOf(const std::vector<ExportedFile>& files) {
  std::vector<std::string> names;
  for (const ExportedFile& file : files) names.push_back((file.text.empty() ? "not " : "") + file.name);
  return names;
}

Rigid3d PoseOf(const urdf::ModelInterface& model, const std::string& joint) {
  const urdf::Pose& pose = model.getJoint(joint)->parent_to_joint_origin_transform;
  return {Eigen::Quaterniond(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z),
          Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z)};
}

std::vector<std::string> LinksOf(const urdf::ModelInterface& model) {
  std::vector<std::string> links;
  for (const auto& [name, link] : model.links_) links.push_back(name);
  return links;
}

TEST(ExportFilesTest, AUrdfOfCamerasWithOneRootIsLoaded) {
  const RunResult rig = CellOf({"robot"}, {{"top", kWorld}, {"far-side", kWorld}});
  const std::vector<ExportedFile> files = FilesOf("urdf", rig);
  EXPECT_THAT(NamesOf(files),
              ElementsAre("top.camera.urdf", "far-side.camera.urdf", "cameras.urdf", "cameras.urdf.xacro"));
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(FileOf(files, "cameras.urdf").text);
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->getRoot()->name, "base_link");
  EXPECT_THAT(LinksOf(*model), ElementsAre("base_link", "far_side_optical_frame", "top_optical_frame"));
  EXPECT_THAT(PoseOf(*model, "base_link_to_far_side_optical_frame"),
              IsNearPose(rig.solution.poses.mount_from_camera[1], 1e-12, 1e-12));
}

// The gripper has no constant pose in the base, so that a URDF of both has two roots, which parsers refuse.
TEST(ExportFilesTest, EachRootHasAUrdfThatIsLoaded) {
  const RunResult rig = CellOf({"robot"}, {{"top", kWorld}, {"wrist", kGripper}, {"side", kWorld}});
  const std::vector<ExportedFile> files = FilesOf("urdf", rig);
  EXPECT_THAT(NamesOf(files),
              ElementsAre("top.camera.urdf", "wrist.camera.urdf", "side.camera.urdf", "cameras.base_link.urdf",
                          "cameras.tool0.urdf", "not cameras.urdf", "cameras.urdf.xacro"));
  EXPECT_THAT(FileOf(files, "cameras.urdf").reason,
              HasSubstr("one root link, and these poses are given in base_link and tool0"));
  const urdf::ModelInterfaceSharedPtr fixed = urdf::parseURDF(FileOf(files, "cameras.base_link.urdf").text);
  ASSERT_NE(fixed, nullptr);
  EXPECT_THAT(LinksOf(*fixed), ElementsAre("base_link", "side_optical_frame", "top_optical_frame"));
  const urdf::ModelInterfaceSharedPtr carried = urdf::parseURDF(FileOf(files, "cameras.tool0.urdf").text);
  ASSERT_NE(carried, nullptr);
  EXPECT_EQ(carried->getRoot()->name, "tool0");
  EXPECT_THAT(LinksOf(*carried), ElementsAre("tool0", "wrist_optical_frame"));
}

// The fragment has the links of the cameras only; together with an arm that has the others, it is one URDF.
TEST(ExportFilesTest, TheFragmentCompletesTheUrdfOfTheArm) {
  const RunResult rig = CellOf({"robot"}, {{"top", kWorld}, {"wrist", kGripper}});
  const std::string fragment = FileOf(FilesOf("urdf", rig), "cameras.urdf.xacro").text;
  EXPECT_THAT(fragment, HasSubstr("must define base_link, tool0"));
  const size_t begin = fragment.find('\n', fragment.find("<robot ")) + 1;
  const std::string content = fragment.substr(begin, fragment.find("</robot>") - begin);
  const std::string arm =
      "<robot name=\"arm\"><link name=\"base_link\"/><link name=\"tool0\"/>"
      "<joint name=\"axis\" type=\"continuous\"><parent link=\"base_link\"/><child link=\"tool0\"/></joint>";
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(arm + content + "</robot>");
  ASSERT_NE(model, nullptr);
  EXPECT_THAT(LinksOf(*model), ElementsAre("base_link", "tool0", "top_optical_frame", "wrist_optical_frame"));
}

// The bases of all arms have constant poses in the first one, and are exported with the cameras, even with one camera.
TEST(ExportFilesTest, BasesAreExported) {
  const RunResult rig = CellOf({"left-arm", "right"}, {{"top", {1, Mount::Part::kBase}}});
  const std::vector<ExportedFile> files = FilesOf("urdf", rig);
  EXPECT_THAT(NamesOf(files), ElementsAre("top.camera.urdf", "cameras.urdf", "cameras.urdf.xacro"));
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(FileOf(files, "cameras.urdf").text);
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->getRoot()->name, "left_arm_base_link");
  EXPECT_THAT(PoseOf(*model, "left_arm_base_link_to_right_base_link"),
              IsNearPose(rig.solution.poses.world_from_base[1], 1e-12, 1e-12));
  EXPECT_THAT(PoseOf(*model, "right_base_link_to_top_optical_frame"),
              IsNearPose(rig.solution.poses.mount_from_camera[0], 1e-12, 1e-12));
  const std::string launch = FileOf(FilesOf("ros2", rig), "cameras.launch.py").text;
  EXPECT_THAT(launch,
              HasSubstr("'--frame-id', \"left_arm_base_link\",\n            '--child-frame-id', \"right_base_link\""));
  EXPECT_THAT(launch, HasSubstr("one sigma along and about the axes of right_base_link: 1.0, 1.0, 1.0 mm"));
  EXPECT_THAT(NamesOf(FilesOf("kalibr", rig)), ElementsAre("top.camchain.yaml"));
}

// A camera and an arm without names have the usual names of files and frames.
TEST(ExportFilesTest, ACameraWithoutANameHasTheUsualNames) {
  for (const Mount& mount : {kWorld, kGripper}) {
    const RunResult result = CellOf({""}, {{"", mount}});
    const ExportRequests requests = MakeExportRequests(result);
    EXPECT_EQ(requests.cameras[0].parent_frame, mount == kWorld ? "base_link" : "tool0");
    EXPECT_EQ(requests.cameras[0].child_frame, "camera_optical_frame");
    EXPECT_TRUE(requests.cameras[0].covariance.has_value());
    EXPECT_THAT(NamesOf(FilesOf("urdf", result)), ElementsAre("camera.urdf"));
    EXPECT_THAT(NamesOf(FilesOf("dh_csv", result)), ElementsAre("not arm_dh.csv"));
    EXPECT_THAT(FilesOf("dh_csv", result)[0].reason, HasSubstr("the estimate 'bundle' has no kinematics of the arm"));
  }
}

TEST(ExportFilesTest, BasesOfUniversalRobotsAreThoseOfTheirControllers) {
  const RunResult rig = CellOf({"left", "right"}, {{"top", kWorld}, {"side", {1, Mount::Part::kBase}}});
  const ExportRequests requests = MakeExportRequests(rig, kBundleMethod, {false, true});
  EXPECT_EQ(requests.cameras[0].parent_frame, "left_base_link");
  EXPECT_EQ(requests.cameras[1].parent_frame, "right_base");
  EXPECT_EQ(requests.bases[0].child_frame, "right_base");
  const ExportFormat& ros2 = *FindEntry(ExportFormats(), "ros2");
  EXPECT_THAT(FileOf(ExportFiles(ros2, requests), "side.camera.launch.py").text, HasSubstr("rotated by 180 deg"));
}

// Other frames of several cameras keep names of their own.
TEST(ExportFilesTest, LinksAreCalledByTheirCameras) {
  const RunResult rig = CellOf({"robot"}, {{"top", kWorld}, {"far-side", kWorld}});
  const ExportRequest camera = MakeExportRequests(rig).cameras[1];
  EXPECT_EQ(WithChild(camera, ExportFrame::kBody, OpticalFromBody()).child_frame, "far_side_link");
  EXPECT_EQ(WithChild(camera, ExportFrame::kLink, Rigid3d()).child_frame, "far_side_link");
}

// With one arm and one camera, the camera's file has all poses.
TEST(ExportFilesTest, OnePoseHasNoFileOfAll) {
  EXPECT_THAT(NamesOf(FilesOf("urdf", CellOf({"robot"}, {{"top", kWorld}}))), ElementsAre("top.camera.urdf"));
}

// Inverted, both cameras are the parent of the base.
TEST(ExportFilesTest, AFrameWithTwoParentsIsRefused) {
  const RunResult rig = CellOf({"robot"}, {{"top", kWorld}, {"side", kWorld}});
  EXPECT_THAT(FileOf(FilesOf("urdf", rig, true), "cameras.urdf").reason, HasSubstr("base_link would have two"));
  EXPECT_THAT(FileOf(FilesOf("urdf", rig, true), "cameras.urdf.xacro").reason, HasSubstr("base_link would have two"));
  EXPECT_THAT(FileOf(FilesOf("ros2", rig, true), "cameras.launch.py").reason, HasSubstr("base_link would have two"));
}

// A file with all cameras is refused if the format cannot hold one of them, by its name.
TEST(ExportFilesTest, TheFaultOfACameraIsOneOfTheFileWithAll) {
  RunResult rig = CellOf({"robot"}, {{"top", kWorld}, {"side", kWorld}});
  const std::vector<ExportedFile> inverted = FilesOf("kalibr", rig, true);
  EXPECT_THAT(FileOf(inverted, "cameras.camchain.yaml").text, IsEmpty());
  rig.solution.cameras[1] = {"brown5", 640, 480, {600, 600, 320, 240, 0.1, 0, 0, 0, 0.5}};
  const std::vector<ExportedFile> files = FilesOf("kalibr", rig);
  EXPECT_THAT(FileOf(files, "top.camchain.yaml").text, Not(IsEmpty()));
  EXPECT_THAT(FileOf(files, "cameras.camchain.yaml").reason, HasSubstr("camera side: Kalibr's lens has"));
}

// Adds the kinematics of each arm, of which those of these are estimated.
RunResult WithArms(RunResult rig, const std::vector<bool>& are_estimated) {
  for (const bool is_estimated : are_estimated) {
    RobotSummary& robot = rig.arms.emplace_back(RobotSummary()).value();
    robot.nominal = *FindArm("ur10e");
    robot.is_estimated = is_estimated;
    robot.reason = Failure(is_estimated ? "" : "they are not significantly better");
    robot.errors = Eigen::VectorXd::Zero(robot.nominal.num_params());
    rig.rig.effects.push_back(nullptr);
    rig.solution.effects.emplace_back();
    if (!is_estimated) continue;
    robot.errors[ArmParamPlace(1, ArmParam::kA)] = 1e-3 * static_cast<double>(rig.arms.size());
    const auto shared = std::make_shared<const SharedEffects>(ArmErrors(robot.nominal, ArmErrorModel::kGeometry));
    rig.rig.effects.back() = shared;
    rig.solution.effects.back() = Eigen::VectorXd::Zero(shared->size());
  }
  rig.solution.covariance.layout = UnknownsOf(rig.rig);
  const Eigen::Index size = rig.solution.covariance.layout.size();
  // The variance of each unknown is its place.
  rig.solution.covariance.matrix = 1e-6 * Eigen::VectorXd::LinSpaced(size, 1, static_cast<double>(size)).asDiagonal();
  return rig;
}

// Returns the length a of the second joint in a table of an arm.
double SecondLengthM(const std::string& table) {
  const size_t row = table.find("\n2,");
  return row == std::string::npos ? 0 : std::stod(Split(table.substr(row + 1), ',')[3]);
}

TEST(ExportFilesTest, EachEstimatedArmHasAFile) {
  const double nominal_m = FindArm("ur10e")->joints[1].a_m;
  const std::vector<ExportedFile> one = FilesOf("dh_csv", WithArms(CellOf({"robot"}, {{"top", kWorld}}), {true}));
  EXPECT_THAT(NamesOf(one), ElementsAre("arm_dh.csv"));
  EXPECT_NEAR(SecondLengthM(one[0].text), nominal_m + 1e-3, 1e-12);
  const RunResult rig = WithArms(CellOf({"left", "right", "third"}, {{"top", kWorld}}), {true, false, true});
  const std::vector<ExportedFile> tables = FilesOf("dh_csv", rig);
  EXPECT_THAT(NamesOf(tables), ElementsAre("left.arm_dh.csv", "not right.arm_dh.csv", "third.arm_dh.csv"));
  EXPECT_EQ(tables[1].reason, "the kinematics of the arm right were not estimated (they are not significantly better)");
  EXPECT_NEAR(SecondLengthM(tables[2].text), nominal_m + 3e-3, 1e-12);
  EXPECT_EQ(tables[2].part, "third");
  const std::vector<ExportedFile> urdfs = FilesOf("robot_urdf", rig);
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(FileOf(urdfs, "left.robot.urdf").text);
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->getRoot()->name, "base");
  EXPECT_THAT(FileOf(FilesOf("ur_kinematics", rig), "third.ur_kinematics.yaml").text, HasSubstr("forearm:"));
}

TEST(ExportFilesTest, AnArmWithoutEstimatedErrorsHasNoFile) {
  const std::vector<ExportedFile> files = FilesOf("robot_urdf", CellOf({"robot"}, {{"top", kWorld}}));
  EXPECT_THAT(NamesOf(files), ElementsAre("not robot.urdf"));
  EXPECT_EQ(files[0].reason,
            "the kinematics of the arm robot were not estimated; the config names no model of it (robot.model)");
  const std::vector<ExportedFile> of_two = FilesOf("robot_urdf", CellOf({"left", "right"}, {{"top", kWorld}}));
  EXPECT_THAT(of_two[1].reason, HasSubstr("robots.right.model"));
}

// The errors of the arm are unknowns before those of the cameras: each pose keeps its own covariance.
TEST(ExportFilesTest, PosesKeepTheirCovariancesBesideTheErrorsOfArms) {
  const RunResult rig = WithArms(CellOf({"left", "right"}, {{"top", kWorld}, {"side", kWorld}}), {true, true});
  const std::vector<ExportRequest> cameras = MakeExportRequests(rig).cameras;
  for (size_t c = 0; c < 2; ++c) {
    ASSERT_TRUE(cameras[c].covariance.has_value());
    for (Eigen::Index i = 0; i < 6; ++i) {
      EXPECT_NEAR((*cameras[c].covariance)(i, i), 1e-6 * static_cast<double>(6 * c + i + 1), 1e-15);
    }
  }
  const std::vector<ExportRequest> bases = MakeExportRequests(rig).bases;
  ASSERT_TRUE(bases[0].covariance.has_value());
  EXPECT_NEAR((*bases[0].covariance)(0, 0), 13e-6, 1e-15);
}

}  // namespace
}  // namespace heba
