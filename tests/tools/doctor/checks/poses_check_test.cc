// Tests of the check whether the robot's poses mean what the config says: tools/doctor/checks/poses.cc.
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/matchers.h"
#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

PoseFormat FormatOf(const std::string& rotation, const std::string& angle_unit, const std::string& translation_unit) {
  const bool has_four = rotation.starts_with("quaternion");
  return {"",
          has_four ? std::vector<std::string>{"x", "y", "z", "r1", "r2", "r3", "r4"}
                   : std::vector<std::string>{"x", "y", "z", "r1", "r2", "r3"},
          translation_unit, rotation, angle_unit};
}

// Expects the mounts of all views to be those of an examination without a fault.
void ExpectCorrected(const Examination& examination, const Examination& clean) {
  ASSERT_EQ(examination.views.size(), clean.views.size());
  for (size_t i = 0; i < clean.views.size(); ++i) {
    EXPECT_THAT(examination.views[i].view.camera_mount_from_target_mount,
                IsNearPose(clean.views[i].view.camera_mount_from_target_mount, 1e-6, 1e-6));
  }
}

class CleanPosesTest : public testing::TestWithParam<Setup> {};

TEST_P(CleanPosesTest, HaveNoSymptom) {
  SimulatedSetOptions options;
  options.setup = GetParam();
  Examination examination = CleanExamination(options);
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), IsEmpty());
  ASSERT_TRUE(examination.pose_fit.has_value());
  EXPECT_EQ(examination.pose_fit->format.name, "ros");
  EXPECT_TRUE(examination.pose_fit->fits);
  EXPECT_LT(examination.pose_fit->misfit_m, 2e-3);
  ExpectCorrected(examination, CleanExamination(options));
}

INSTANTIATE_TEST_SUITE_P(, CleanPosesTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& setup) {
                           return setup.param == Setup::kEyeToHand ? "EyeToHand" : "EyeInHand";
                         });

struct Misread {
  std::string name;
  PoseFormat written;
  PoseFormat read;
  std::string code;
  std::string fault;
};

class MisreadPosesTest : public testing::TestWithParam<Misread> {};

TEST_P(MisreadPosesTest, AreNamedAndCorrected) {
  const Misread& misread = GetParam();
  Examination examination = CleanExamination();
  MisreadPoses(misread.written, misread.read, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong " + misread.code));
  EXPECT_THAT(symptoms[0].what, HasSubstr(misread.fault));
  EXPECT_THAT(symptoms[0].evidence, HasSubstr("with this reading, robot and images differ by "));
  EXPECT_EQ(symptoms[0].cure, "set captures.pose_format: " + PoseFormatText(misread.written));
  ASSERT_TRUE(examination.pose_fit.has_value());
  EXPECT_TRUE(examination.pose_fit->fits);
  EXPECT_EQ(PoseFormatText(examination.pose_fit->format), PoseFormatText(misread.written));
  ExpectCorrected(examination, CleanExamination());
}

INSTANTIATE_TEST_SUITE_P(
    , MisreadPosesTest,
    testing::Values(Misread{"EulerOrder", FormatOf("euler_zyx", "deg", "mm"), FormatOf("euler_xyz", "deg", "mm"),
                            "rotation_format", "the rotations are euler_zyx in deg, not euler_xyz in deg"},
                    Misread{"RotationVector", FormatOf("rotation_vector", "rad", "m"),
                            FormatOf("extrinsic_xyz", "rad", "m"), "rotation_format",
                            "the rotations are rotation_vector in rad, not extrinsic_xyz in rad"},
                    Misread{"QuaternionOrder", FormatOf("quaternion_wxyz", "", "m"),
                            FormatOf("quaternion_xyzw", "", "m"), "rotation_format",
                            "the rotations are quaternion_wxyz, not quaternion_xyzw"},
                    Misread{"AngleUnit", FormatOf("euler_zyx", "deg", "mm"), FormatOf("euler_zyx", "rad", "mm"),
                            "angle_unit", "the angles are in deg, not in rad"},
                    Misread{"LengthUnit", FormatOf("euler_zyx", "deg", "mm"), FormatOf("euler_zyx", "deg", "m"),
                            "pose_units", "the positions are in mm, not in m"},
                    Misread{"Inches", FormatOf("euler_zyx", "deg", "in"), FormatOf("euler_zyx", "deg", "cm"),
                            "pose_units", "the positions are in in, not in cm"},
                    Misread{"OrderAndUnit", FormatOf("euler_zyx", "deg", "mm"), FormatOf("euler_xyz", "deg", "m"),
                            "rotation_format", "; the positions are in mm, not in m"}),
    [](const auto& misread) { return misread.param.name; });

TEST(PosesCheckTest, FindsInvertedPosesAndOffersBothExplanations) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) pose = Inverse(pose);
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pose_direction"));
  EXPECT_THAT(symptoms[0].cure,
              HasSubstr("if the camera is fixed beside the robot, set captures.poses_are: gripper_from_base; "));
  EXPECT_TRUE(symptoms[0].settings.empty());  // The cure is a choice between two settings.
  EXPECT_THAT(symptoms[0].cure, HasSubstr("if the robot carries the camera, set setup: eye_in_hand; "));
  EXPECT_THAT(symptoms[0].evidence, HasSubstr("or gripper_from_camera, if the robot carries it, is ["));
  ExpectCorrected(examination, CleanExamination());
}

// The unit can be set, the direction is a choice: the setting alone would not cure the config.
TEST(PosesCheckTest, SettingsThatAreOnlyAPartOfTheCureAreLeftOut) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) pose = Inverse(pose);
  SetPoses(poses, &examination);
  MisreadPoses(FormatOf("euler_zyx", "deg", "mm"), FormatOf("euler_zyx", "deg", "m"), &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pose_units"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("set captures.pose_format: "));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("captures.poses_are: gripper_from_base"));
  EXPECT_TRUE(symptoms[0].settings.empty());
}

TEST(PosesCheckTest, FindsTransposedRotations) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) pose.rotation = pose.rotation.conjugate();
  SetPoses(poses, &examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), ElementsAre("wrong rotation_inverse"));
  ExpectCorrected(examination, CleanExamination());
}

struct Pairing {
  std::string name;
  std::function<size_t(size_t i, size_t num)> row_of;  // The row whose pose belongs to capture i.
  std::string fault;
};

class PairingTest : public testing::TestWithParam<Pairing> {};

TEST_P(PairingTest, IsNamed) {
  Examination examination = CleanExamination();
  const std::vector<Rigid3d> poses = PosesOf(examination);
  std::vector<Rigid3d> paired(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) paired[GetParam().row_of(i, poses.size())] = poses[i];
  SetPoses(paired, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pairing"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("images and poses are paired wrongly: " + GetParam().fault));
}

INSTANTIATE_TEST_SUITE_P(, PairingTest,
                         testing::Values(Pairing{"OneRowLate", [](size_t i, size_t num) { return (i + 1) % num; },
                                                 "each image belongs to the pose 1 row further down"},
                                         Pairing{"TwoRowsEarly",
                                                 [](size_t i, size_t num) { return (i + num - 2) % num; },
                                                 "each image belongs to the pose 2 rows further up"},
                                         Pairing{"Reversed", [](size_t i, size_t num) { return num - 1 - i; },
                                                 "the images are in the reverse order of the poses"}),
                         [](const auto& pairing) { return pairing.param.name; });

// The captures are named view_0, ..., view_11, so view_10 and view_11 follow view_1 if they are sorted by letters.
TEST(PosesCheckTest, FindsNamesThatWereSortedByLetters) {
  Examination examination = CleanExamination();
  const std::vector<Rigid3d> poses = PosesOf(examination);
  const std::vector<size_t> by_letters = {0, 1, 10, 11, 2, 3, 4, 5, 6, 7, 8, 9};
  std::vector<Rigid3d> paired;
  for (const size_t i : by_letters) paired.push_back(poses[i]);
  SetPoses(paired, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pairing"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("images and poses were sorted differently"));
}

// Returns the context of a pair in a rig with these rows: those of the data set are at `place`.
CellContext ContextOf(const std::vector<Rigid3d>& poses_of_rows, const std::vector<size_t>& place) {
  CellContext rig;
  for (size_t row = 0; row < poses_of_rows.size(); ++row) rig.captures.push_back("view_" + std::to_string(row));
  rig.base_from_gripper = poses_of_rows;
  rig.place = place;
  return rig;
}

// A camera of a rig that sees another target in every third capture: its rows are shifted among those of all captures,
// not among those that are left.
TEST(PosesCheckTest, CountsTheRowsOfACameraThatSeesSeveralTargets) {
  SimulatedSetOptions options;
  options.num_captures = 24;
  Examination examination = CleanExamination(options);
  const std::vector<Rigid3d> poses = PosesOf(examination);
  RunConfig& config = examination.config;
  std::vector<Rigid3d> rows(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) rows[(i + 1) % poses.size()] = poses[i];
  std::vector<size_t> place;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (i % 3 == 0) continue;
    place.push_back(i);
  }
  config.data = PartOf(config.data, place);
  examination.detections = config.data.given_detections;
  std::vector<Rigid3d> poses_of_captures;
  for (const size_t row : place) poses_of_captures.push_back(rows[row]);
  SetPoses(poses_of_captures, &examination);
  examination.rig = ContextOf(rows, place);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pairing"));
  EXPECT_EQ(symptoms[0].reading, "each image belongs to the pose 1 row further down");
}

// Returns an examination with the poses of an arm that moved otherwise than the target.
Examination WithUnrelatedPoses(std::vector<Rigid3d>* right) {
  Examination examination = CleanExamination();
  *right = PosesOf(examination);
  SimulatedSetOptions options;
  options.seed = 7;
  SetPoses(PosesOf(CleanExamination(options)), &examination);
  return examination;
}

TEST(PosesCheckTest, NamesTheArmWhosePosesFit) {
  std::vector<Rigid3d> right;
  Examination examination = WithUnrelatedPoses(&right);
  std::vector<size_t> place;
  for (size_t i = 0; i < right.size(); ++i) place.push_back(i);
  examination.rig = ContextOf(PosesOf(examination), place);
  Rng rng(3);
  std::vector<Rigid3d> other;
  for (size_t i = 0; i < right.size(); ++i) {
    other.push_back({ExpRotation(rng.Uniform(0, 3) * rng.Direction3()), 0.5 * rng.Direction3()});
  }
  examination.rig.other_arms = {{"third", other}, {"right", right}};
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong other_arm"));
  EXPECT_EQ(symptoms[0].reading, "right");
  EXPECT_THAT(symptoms[0].evidence, HasSubstr("with the poses of arm right, robot and images differ by "));
  EXPECT_FALSE(examination.pose_fit->fits);
  ExpectCorrected(examination, CleanExamination());
  // No arm is named if none fits, or if the own one does.
  examination = WithUnrelatedPoses(&right);
  examination.rig = ContextOf(PosesOf(examination), place);
  examination.rig.other_arms = {{"third", other}};
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), ElementsAre("wrong poses_unexplained"));
  Examination clean = CleanExamination();
  clean.rig = ContextOf(PosesOf(clean), place);
  clean.rig.other_arms = {{"right", PosesOf(clean)}, {"third", other}};
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &clean)), IsEmpty());
}

// A target that is larger than the config says makes the robot seem to move farther than the images show.
TEST(PosesCheckTest, FindsTheScaleOfTheTarget) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) pose.translation *= 1.1;
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong target_scale"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the target is 1.100 times as large as the config says"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("measure the target and multiply its lengths in the config by about 1.100"));
}

// The noise of this robot is too large for the scale to reduce the misfit several times, but not to hide the scale.
TEST(PosesCheckTest, FindsTheScaleOfTheTargetWithANoisyRobot) {
  SimulatedSetOptions options;
  options.num_captures = 40;
  Examination examination = CleanExamination(options);
  Rng rng(5);
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) pose.translation = 1.08 * pose.translation + 4e-3 * rng.NormalVector3();
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong target_scale"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the target is 1.0"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("one sigma)"));
  EXPECT_THAT(symptoms[0].evidence, HasSubstr(", robot and images differ by "));
}

// From the eighth capture on, a component of the rotation has the other sign. A reading that is several times better
// than that of the config, and still wrong by degrees, explains nothing.
TEST(PosesCheckTest, ReadingThatIsOnlyBetterIsNone) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (size_t i = 7; i < poses.size(); ++i) {
    Eigen::Vector3d vector = LogRotation(poses[i].rotation);
    vector.x() = -vector.x();
    poses[i].rotation = ExpRotation(vector);
  }
  SetPoses(poses, &examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), ElementsAre("wrong poses_unexplained"));
}

TEST(PosesCheckTest, SaysThatNothingExplainsUnrelatedPoses) {
  Examination examination = CleanExamination();
  Rng rng(3);
  std::vector<Rigid3d> poses;
  for (size_t i = 0; i < examination.config.data.captures.size(); ++i) {
    poses.push_back({ExpRotation(rng.Uniform(0, 3) * rng.Direction3()), 0.5 * rng.Direction3()});
  }
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong poses_unexplained"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("no other reading of the poses file explains it"));
  ASSERT_TRUE(examination.pose_fit.has_value());
  EXPECT_FALSE(examination.pose_fit->fits);
}

// Too few captures are not read in other ways, but what no hand-eye pose changes shows that they are wrong.
TEST(PosesCheckTest, FewCapturesAreOnlyUnexplained) {
  SimulatedSetOptions options;
  options.num_captures = 4;
  Examination examination = CleanExamination(options);
  MisreadPoses(FormatOf("euler_zyx", "deg", "mm"), FormatOf("euler_zyx", "rad", "mm"), &examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), ElementsAre("wrong poses_unexplained"));
  EXPECT_FALSE(examination.pose_fit.has_value());
}

// Images without rotations agree with every reading of the rotations.
TEST(PosesCheckTest, IsSilentIfTheImagesShowNoRotation) {
  Examination examination = CleanExamination();
  for (ExaminedView& view : examination.views) {
    const Eigen::Quaterniond rotation = examination.views[0].camera_from_target[0].rotation;
    view.camera_from_target = {Rigid3d(rotation, view.camera_from_target[0].translation)};
    view.view.camera_mount_from_target_mount.rotation = ExpRotation({0.3 * static_cast<double>(view.capture), 0, 0});
  }
  EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), IsEmpty());
  EXPECT_FALSE(examination.pose_fit.has_value());
}

// The poses of another project's data set have a fixed format, so the config cannot change it.
TEST(PosesCheckTest, SendsUsersOfImportedPosesToTheImport) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) pose = Inverse(pose);
  SetPoses(poses, &examination);
  examination.config.imported.emplace();
  examination.config.arms[0].file.clear();
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(symptoms, SizeIs(1));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("convert it to heba's files first (heba import)"));
}

// Replaces the images by the poses of the target that they show.
void SetTargetPoses(Examination* examination) {
  Dataset& data = examination->config.data;
  data.target_poses.clear();
  for (const ExaminedView& view : examination->views) data.target_poses.push_back(view.camera_from_target.front());
  data.detections_source = "target.csv";
}

TEST(PosesCheckTest, FindsPosesThatAreShiftedFromACaptureOn) {
  SimulatedSetOptions options;
  options.num_captures = 16;
  for (const size_t from : {4, 8, 12}) {
    Examination examination = CleanExamination(options);
    std::vector<Rigid3d> poses = PosesOf(examination);
    const std::vector<Rigid3d> right = poses;
    // A row too many before this capture.
    for (size_t i = from; i < poses.size(); ++i) poses[i] = right[i - 1];
    SetPoses(poses, &examination);
    const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
    if (from > 10) continue;  // Most captures fit: those that do not are wrong by themselves.
    ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pairing")) << from;
    EXPECT_THAT(symptoms[0].what, HasSubstr("from " + examination.config.data.captures[from].name + " on, "));
    EXPECT_THAT(symptoms[0].what, HasSubstr("1 row further down"));
  }
}

TEST(PosesCheckTest, NamesTheUnitOfGivenTargetPoses) {
  Examination examination = CleanExamination();
  SetTargetPoses(&examination);
  for (ExaminedView& view : examination.views) {
    for (Rigid3d& seen : view.camera_from_target) seen.translation *= 1000;
  }
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pose_units"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the positions of the target are in mm, not in m"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("captures.target_poses: {file: target.csv, "));
}

TEST(PosesCheckTest, NamesBothReadingsOfInvertedTargetPoses) {
  Examination examination = CleanExamination();
  SetTargetPoses(&examination);
  for (ExaminedView& view : examination.views) {
    for (Rigid3d& seen : view.camera_from_target) seen = Inverse(seen);
  }
  const std::vector<Symptom> symptoms = RunCheck(Check_poses, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pose_direction"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the poses of the robot, or those of the target, are the inverse"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("poses_are: target_from_camera}, which gives "));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("if those of the robot are: "));
  EXPECT_THAT(symptoms[0].settings, IsEmpty());
}

TEST(PosesCheckTest, SeesThatThreeOrFourCapturesBelongNotTogether) {
  for (const size_t num_captures : {3, 4}) {
    Examination examination = CleanExamination();
    examination.views.resize(num_captures);
    EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), IsEmpty());
    // The poses of other captures.
    const Examination others = CleanExamination();
    for (size_t i = 0; i < num_captures; ++i) {
      examination.views[i].camera_from_target = others.views[11 - 2 * i].camera_from_target;
    }
    EXPECT_THAT(CodesOf(RunCheck(Check_poses, &examination)), ElementsAre("wrong poses_unexplained"));
  }
}

}  // namespace
}  // namespace heba
