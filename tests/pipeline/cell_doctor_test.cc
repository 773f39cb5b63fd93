// Runs the doctor on the data set of a rig that was spoiled on purpose: it must name the cause first, and the camera,
// the target or the arm that has it.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/rendered_cell.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kScene = R"(
cameras:
  left:
    mount: world
    pose: {translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, 175 deg]}
    camera: &camera {model: brown4, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [-0.08, 0.05, 0, 0]}
  right:
    mount: world
    pose: {translation: [700 mm, 550 mm, 600 mm], rpy: [-105 deg, 0 deg, 165 deg]}
    camera: *camera
  wrist:
    mount: gripper
    pose: {translation: [60 mm, 0 mm, 40 mm], rpy: [5 deg, -5 deg, 90 deg]}
    camera: *camera
targets:
  plate:
    mount: gripper
    pose: {translation: [0 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 deg]}
    target: {type: charuco, rows: 5, columns: 7, square: 30 mm, marker: 22 mm, dictionary: DICT_4X4_250}
  wall:
    mount: world
    pose: {translation: [900 mm, -400 mm, 200 mm], rpy: [180 deg, 0 deg, 0 deg]}
    target: {type: charuco, rows: 5, columns: 7, square: 40 mm, marker: 29 mm, dictionary: DICT_4X4_250, first_marker: 100}
motion: {captures: 16, distance: 700 mm, tilt: 30 deg}
image: {noise: 2 grey}
robot_noise: {translation: 0.1 mm, rotation: 0.02 deg}
)";

// The setting of a target on the wall with other markers than those that were rendered.
constexpr const char* kOtherWall =
    "targets.wall.target={type: charuco, rows: 5, columns: 7, square: 40 mm, marker: 29 mm, "
    "dictionary: DICT_4X4_250, first_marker: 200}";

// The rig as it was rendered, shared by all tests.
class CellDoctorTest : public RenderedCellTest<CellDoctorTest> {
 public:
  static const char* Name() { return "rig_doctor"; }
  static const char* Scene() { return kScene; }

 protected:
  static CommandResult Doctor(const std::vector<std::string>& settings) {
    return WithSettings({"doctor", (Cell() / "config.yaml").string(), "--quiet"}, settings);
  }
  static CommandResult Run(const std::vector<std::string>& settings) {
    return WithSettings({"run", (Cell() / "config.yaml").string(), "--out", (*folder_ / "run").string(), "--quiet"},
                        settings);
  }

  // Returns the first symptom and its cure: from "1." to "2.", on one line.
  static std::string First(const CommandResult& doctor) {
    EXPECT_EQ(doctor.status, 0) << doctor.err;
    const size_t begin = doctor.out.find("\n1. ");
    if (begin == std::string::npos) return "";
    std::string line;
    for (const char c : doctor.out.substr(begin + 1, doctor.out.find("\n2. ") - begin - 1)) {
      if (c != '\n') line += c;
      if (c == '\n') line += ' ';
    }
    return line;
  }

  // Copies the images of a camera as those of the capture `by` rows later, and returns the setting that selects them.
  static std::string Shifted(const std::string& camera, const std::string& as, int by) {
    return Renamed(camera, as, [&](const std::string& name) {
      char next[16];
      std::snprintf(next, sizeof(next), "%03d.png", (std::stoi(name) + by + 16) % 16);
      return std::string(next);
    });
  }

  // Copies the images of a camera with the name of each changed, and returns the setting that selects them.
  static std::string Renamed(const std::string& camera, const std::string& as,
                             const std::function<std::string(const std::string&)>& name_of) {
    const fs::path copies = *folder_ / as;
    fs::create_directory(copies);
    for (const fs::directory_entry& entry : fs::directory_iterator(Cell() / camera)) {
      fs::copy_file(entry.path(), copies / name_of(entry.path().filename().string()));
    }
    return "cameras." + camera + ".images=" + copies.string();
  }

  // Returns the detections of a camera and a target.
  static nlohmann::json DetectionsOf(const std::string& camera, const std::string& target) {
    const CommandResult detected = RunHeba(
        {"detect", (Cell() / "config.yaml").string(), "--out", (*folder_ / "detected").string(), "--quiet"}, Cache());
    EXPECT_EQ(detected.status, 0) << detected.err;
    return nlohmann::json::parse(
        ReadAll(*folder_ / "detected/detections" / (camera + "." + target + ".json")))["captures"];
  }
};

TEST_F(CellDoctorTest, FindsNothingWrongWithAGoodCell) {
  const CommandResult doctor = Doctor({});
  EXPECT_THAT(doctor.out, HasSubstr("16 captures, ")) << doctor.err;
  EXPECT_THAT(doctor.out, HasSubstr("of 48 images determine a pose of a target; nothing is wrong")) << doctor.out;
}

// The two images that are looked at first do not show the board of the fourth camera, and a larger board would be found
// in some of the others: as often as that of the config.
TEST_F(CellDoctorTest, TakesNoBoardForAnotherBecauseTheFirstImagesDoNotShowIt) {
  WriteAll(*folder_ / "edge.yaml", R"(
cameras:
  side:
    mount: world
    pose: {translation: [900 mm, 0 mm, 700 mm], rpy: [-110 deg, 0 deg, 90 deg]}
    camera: &camera {model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [-0.08, 0.05, 0.0005, -0.0003, 0]}
  front:
    mount: world
    pose: {translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, 175 deg]}
    camera: {model: brown5, image_size: [800, 600], fx: 800, fy: 800, cx: 400, cy: 300, distortion: [-0.05, 0.02, 0, 0, 0]}
  left:
    mount: world
    pose: {translation: [700 mm, 550 mm, 600 mm], rpy: [-105 deg, 0 deg, 165 deg]}
    camera: *camera
  right:
    mount: world
    pose: {translation: [300 mm, 550 mm, 600 mm], rpy: [-105 deg, 0 deg, -165 deg]}
    camera: *camera
targets:
  plate:
    mount: gripper
    pose: {translation: [0 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 deg]}
    target: {type: charuco, rows: 8, columns: 10, square: 18 mm, marker: 13 mm, dictionary: DICT_4X4_250}
motion: {captures: 15, distance: 700 mm, tilt: 30 deg}
image: {noise: 2 grey}
robot_noise: {translation: 0.1 mm, rotation: 0.02 deg}
)");
  const CommandResult made =
      RunHeba({"simulate", (*folder_ / "edge.yaml").string(), "--out", (*folder_ / "edge").string(), "--quiet"});
  ASSERT_EQ(made.status, 0) << made.err;
  const CommandResult doctor = RunHeba({"doctor", (*folder_ / "edge/config.yaml").string()});
  EXPECT_EQ(doctor.status, 0) << doctor.err;
  EXPECT_THAT(doctor.out, AllOf(HasSubstr("nothing is wrong"), Not(HasSubstr("[target]")))) << doctor.out;
}

// Only one of these two images shows the wall, against which the wrist moves: the rest of the rig determines the wrist.
TEST_F(CellDoctorTest, TwoImagesOfACameraAreNoFault) {
  const CommandResult doctor = Doctor({"cameras.wrist.images=[" + (Cell() / "wrist/003.png").string() + ", " +
                                       (Cell() / "wrist/005.png").string() + "]"});
  EXPECT_THAT(doctor.out, AllOf(HasSubstr("nothing is wrong"), Not(HasSubstr("[target_not_seen]")))) << doctor.err;
}

TEST_F(CellDoctorTest, NamesTheCameraWhoseImagesAreShifted) {
  const std::string images = Shifted("right", "shifted", 1);
  EXPECT_THAT(First(Doctor({images})),
              AllOf(HasSubstr("wrong [pairing]: camera right, target plate: "), HasSubstr("1 row further up"),
                    HasSubstr("the images of cameras left, wrist fit the poses, so correct cameras.right.images")));
  // The run ends with the cause, not with its own words for it.
  const CommandResult run = Run({images});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err,
              AllOf(HasSubstr("heba doctor: camera right, target plate: images and poses are paired wrongly: "),
                    HasSubstr("so correct cameras.right.images"), Not(HasSubstr("shifted against")),
                    Not(HasSubstr("robot and images differ"))));
}

// The wrist sees the plate in captures without the wall: its images are shifted among those of all captures.
TEST_F(CellDoctorTest, NamesTheCameraWhoseImagesOfSeveralTargetsAreShifted) {
  EXPECT_THAT(First(Doctor({Shifted("wrist", "shifted_wrist", 1)})),
              AllOf(HasSubstr("wrong [pairing]: camera wrist, target wall: "), HasSubstr("1 row further up"),
                    HasSubstr("the images of cameras left, right fit the poses")));
}

// Other cameras are named as good only if they were found to be good.
TEST_F(CellDoctorTest, BlamesACameraOnlyIfAnotherOneFits) {
  const std::string left = Shifted("left", "left_by_1", 1);
  const auto doctor = [&](std::vector<std::string> settings) {
    settings.insert(settings.end(), {left, "cameras.wrist=", "targets.wall="});
    return Doctor(settings).out;
  };
  EXPECT_THAT(Unbroken(doctor({})),
              HasSubstr("the images of camera right fit the poses, so correct cameras.left.images"));
  // There is no other camera.
  EXPECT_THAT(doctor({"cameras.right="}),
              AllOf(HasSubstr("[pairing]: camera left"), HasSubstr("correct the rows of the poses file"),
                    Not(HasSubstr("fit the poses"))));
  // The other one has the same fault, the same with other figures, or another.
  EXPECT_THAT(doctor({Shifted("right", "right_by_1", 1)}),
              AllOf(HasSubstr("[pairing]: cameras left, right: "), HasSubstr("correct the rows of the poses file"),
                    Not(HasSubstr("fit the poses"))));
  const std::string two_faults = doctor({Shifted("right", "right_by_2", 2)});
  EXPECT_THAT(Unbroken(two_faults),
              AllOf(HasSubstr("[pairing]: camera left: images and poses are paired wrongly: each "
                              "image belongs to the pose 1 row further up"),
                    HasSubstr("[pairing]: camera right: images and poses are paired wrongly: "
                              "each image belongs to the pose 2 rows further up"),
                    HasSubstr("name the images of each capture"), Not(HasSubstr("fit the poses"))));
  const std::string mixed = Renamed("right", "right_mixed", [](const std::string& name) {
    char next[16];
    std::snprintf(next, sizeof(next), "%03d.png", (5 * std::stoi(name) + 3) % 16);
    return std::string(next);
  });
  EXPECT_THAT(doctor({mixed}), AllOf(HasSubstr("[pairing]: camera left"),
                                     HasSubstr("[poses_unexplained]: camera right"), Not(HasSubstr("fit the poses"))));
  // The other one has too few images.
  const fs::path few = *folder_ / "right_few";
  fs::create_directory(few);
  int num_seen = 0;
  for (const nlohmann::json& capture : DetectionsOf("right", "plate")) {
    if (capture["ids"].size() < 12 || ++num_seen > 5) continue;
    const std::string image = capture["image"];
    fs::copy_file(Cell() / "right" / image, few / image);
  }
  EXPECT_THAT(doctor({"cameras.right.images=" + few.string()}),
              AllOf(HasSubstr("[pairing]: camera left"), Not(HasSubstr("fit the poses"))));
}

// The poses of all cameras of an arm are inverse for one reason.
TEST_F(CellDoctorTest, NamesInversePosesOnce) {
  const CommandResult inverse = Doctor({"captures.poses_are=gripper_from_base"});
  EXPECT_THAT(inverse.out, HasSubstr("1 wrong"));
  EXPECT_THAT(First(inverse), AllOf(HasSubstr("[pose_direction]: cameras left, right, wrist, targets plate, wall: "),
                                    HasSubstr("-> set captures.poses_are: base_from_gripper")));
  // Without the wrist, the cameras might be carried. Each key is named once.
  const std::string either = First(Doctor({"captures.poses_are=gripper_from_base", "cameras.wrist=", "targets.wall="}));
  EXPECT_THAT(either, AllOf(HasSubstr("cameras.left.mount: gripper, cameras.right.mount: gripper, "),
                            HasSubstr("targets.plate.mount: world; ")));
  EXPECT_EQ(either.find("targets.plate"), either.rfind("targets.plate"));
  EXPECT_THAT(First(Doctor({"cameras.wrist.mount=world", "targets.wall.mount=gripper"})),
              HasSubstr("-> the images of cameras left, right fit the poses, so set cameras.wrist.mount: gripper, "
                        "targets.wall.mount: world"));
}

TEST_F(CellDoctorTest, NamesTheSwappedImagesOfOneCamera) {
  const std::string images = Renamed("right", "swapped", [](const std::string& name) {
    if (name == "001.png") return std::string("006.png");
    return name == "006.png" ? std::string("001.png") : name;
  });
  EXPECT_THAT(First(Doctor({images})),
              AllOf(HasSubstr("wrong [swapped]: camera right"), HasSubstr("001.png and 006.png are swapped")));
}

TEST_F(CellDoctorTest, NamesAWrongMount) {
  EXPECT_THAT(First(Doctor({"cameras.wrist.mount=world"})),
              AllOf(HasSubstr("wrong [mount]: camera wrist (world) and target wall (world)"),
                    HasSubstr("cameras.wrist.mount")));
}

// A fixed camera that was moved between two captures has the right mount.
TEST_F(CellDoctorTest, NamesTheFixedCameraThatWasMoved) {
  const CommandResult made = RunHeba(
      {"simulate", (*folder_ / "scene.yaml").string(), "--out", (*folder_ / "moved").string(), "--quiet", "--set",
       "cameras.left.moved={from: 8, by: {translation: [0 mm, 0 mm, 0 mm], rpy: [1.5 deg, 1 deg, 0 deg]}}", "--set",
       "targets.wall.pose={translation: [300 mm, -430 mm, 250 mm], rpy: [90 deg, 0 deg, 0 deg]}", "--set",
       "motion.captures=20"});
  ASSERT_EQ(made.status, 0) << made.err;
  const std::string config = (*folder_ / "moved" / "config.yaml").string();
  const CommandResult doctor = RunHeba({"doctor", config, "--quiet"}, Cache());
  EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [camera_moved]: camera left (world) or target wall (world)"),
                                   HasSubstr("and 008.png: the points of the target stay"), HasSubstr("px")));
  EXPECT_THAT(doctor.out, Not(HasSubstr("[mount]")));
  // The run states the motion that the adjustment has measured, and no wrong mount.
  const CommandResult run = RunHeba({"run", config, "--out", (*folder_ / "moved_run").string(), "--quiet"}, Cache());
  EXPECT_EQ(run.status, 0) << run.err;
  const nlohmann::json result = nlohmann::json::parse(ReadAll(*folder_ / "moved_run" / "result.json"));
  const nlohmann::json& first = result["verdict"]["findings"][0];
  EXPECT_EQ(first["code"], "camera_moved");
  EXPECT_NEAR(first["numbers"]["moved_deg"].get<double>(), 1.8, 0.1);
  EXPECT_THAT(first["text"].get<std::string>(), HasSubstr("camera left was moved by"));
  EXPECT_THAT(result["verdict"].dump(), Not(HasSubstr("\"mount\"")));
}

// The images of a camera that was moved far fit no poses as a whole, or some of them contradict the others: both are
// consequences. The images that are left out are told in one line, and stand in the result one by one.
TEST_F(CellDoctorTest, NamesTheMotionOfACameraNotItsConsequences) {
  for (const int from : {11, 15}) {
    const fs::path cell = *folder_ / ("far_" + std::to_string(from));
    const CommandResult made =
        RunHeba({"simulate", (*folder_ / "scene.yaml").string(), "--out", cell.string(), "--quiet", "--set",
                 "motion.captures=20", "--set", "cameras.wrist=", "--set", "targets.wall=", "--set",
                 "cameras.right.moved={from: " + std::to_string(from) +
                     ", by: {translation: [60 mm, 0 mm, 0 mm], rpy: [0 deg, 6 deg, 0 deg]}}"});
    ASSERT_EQ(made.status, 0) << made.err;
    const std::string config = (cell / "config.yaml").string();
    const CommandResult doctor = RunHeba({"doctor", config, "--quiet"}, Cache());
    EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [camera_moved]: camera right was moved by 60 mm and 6.0 deg "),
                                     HasSubstr(" images from 0")));
    EXPECT_THAT(doctor.out,
                AllOf(HasSubstr("1 wrong"), Not(HasSubstr("[contradicts]")), Not(HasSubstr("[poses_unexplained]"))));
    const fs::path folder = *folder_ / ("far_run_" + std::to_string(from));
    const CommandResult run = RunHeba({"run", config, "--out", folder.string()}, Cache());
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_THAT(run.out, Not(HasSubstr("poses_unexplained")));
    const nlohmann::json result = nlohmann::json::parse(ReadAll(folder / "result.json"));
    EXPECT_EQ(result["verdict"]["findings"][0]["code"], "camera_moved");
    std::vector<std::string> left_out;
    for (const nlohmann::json& image : result["captures"]) {
      const std::string reason = image["reason"];
      if (reason.find("the camera was moved before, between ") != std::string::npos)
        left_out.push_back(image["capture"]);
    }
    ASSERT_GE(left_out.size(), 4U);
    EXPECT_EQ(result["verdict"]["findings"][0]["numbers"]["images_left_out"], left_out.size());
    EXPECT_THAT(run.err, HasSubstr("config: camera right: " + std::to_string(left_out.size()) + " images, from " +
                                   left_out.front() + " to " + left_out.back() +
                                   ": target plate: the camera was moved before, between "));
    EXPECT_THAT(run.err, Not(HasSubstr(left_out.back() + ", camera right: ")));
  }
}

TEST_F(CellDoctorTest, NamesTheFormatOfPosesOnceForAllCameras) {
  std::vector<PoseRow> rows = ReadPoseFile(Cell() / "poses.csv", *FindPoseFormat("ros"));
  const PoseFormat written{"", {"x", "y", "z", "q0", "q1", "q2", "q3"}, "m", "quaternion_wxyz", ""};
  WriteAll(*folder_ / "wxyz.csv", PoseFileText(rows, written));
  const std::string declared =
      "captures.pose_format={columns: [x, y, z, q0, q1, q2, q3], translation: m, rotation: quaternion_xyzw}";
  const CommandResult doctor = Doctor({"captures.poses=" + (*folder_ / "wxyz.csv").string(), declared});
  EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [rotation_format]: cameras left, right, wrist"),
                                   HasSubstr("set captures.pose_format")));
  EXPECT_THAT(doctor.out, HasSubstr("1 wrong"));
}

TEST_F(CellDoctorTest, NamesTheTargetOfAnotherSize) {
  const CommandResult doctor =
      Doctor({"targets.plate.target={type: charuco, rows: 5, columns: 7, square: 36 mm, marker: 26.4 mm, dictionary: "
              "DICT_4X4_250}"});
  EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [target_scale]: cameras left, right, target plate"),
                                   HasSubstr("measure the target"), HasSubstr("0.83")));
}

TEST_F(CellDoctorTest, NamesTheCameraWithOtherIntrinsics) {
  WriteAll(
      *folder_ / "other.yaml",
      "model: brown4\nimage_size: [640, 480]\nfx: 900\nfy: 900\ncx: 320\ncy: 240\ndistortion: [-0.08, 0.05, 0, 0]\n");
  const std::string first = First(Doctor({"cameras.left.intrinsics=" + (*folder_ / "other.yaml").string()}));
  EXPECT_THAT(first, AllOf(HasSubstr("camera left"), HasSubstr("cameras.left.intrinsics")));
}

TEST_F(CellDoctorTest, NamesTheWrongTarget) {
  const CommandResult doctor = Doctor({kOtherWall});
  EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [target]: camera wrist, target wall"),
                                   HasSubstr("first_marker: 100"), HasSubstr("set in the target")));
}

TEST_F(CellDoctorTest, TellsProgramsTheSettingOfTheCell) {
  const CommandResult doctor =
      RunHeba({"doctor", (Cell() / "config.yaml").string(), "--quiet", "--json", "--set", kOtherWall}, Cache());
  ASSERT_EQ(doctor.status, 0) << doctor.err;
  const nlohmann::json json = nlohmann::json::parse(doctor.out);
  EXPECT_EQ(json["captures"], 16);
  EXPECT_EQ(json["images"], 48);
  ASSERT_GE(json["symptoms"].size(), 1U);
  EXPECT_EQ(json["symptoms"][0]["settings"][0]["key"], "targets.wall.target.first_marker");
  EXPECT_EQ(json["symptoms"][0]["settings"][0]["value"], "100");
}

// The rig with an arm that has errors of its own and whose joints are recorded, as the arm `left` of a list of arms.
class OneArmDoctorTest : public CellDoctorTest {
 protected:
  static void SetUpTestSuite() {
    CellDoctorTest::SetUpTestSuite();
    WriteAll(*folder_ / "arm.yaml",
             "base: scene.yaml\n"
             "robot: {model: ur10e, offsets: 0.05 deg, lengths: 0.3 mm, angles: 0.03 deg, configurations: one, "
             "record_joints: true, tool: {translation: [0 mm, 0 mm, 100 mm], rpy: [0 deg, 0 deg, 0 deg]}}\n"
             "robot_noise: {translation: 0.02 mm, rotation: 0.004 deg}\n");
    const CommandResult made =
        RunHeba({"simulate", (*folder_ / "arm.yaml").string(), "--out", (*folder_ / "arm").string(), "--quiet"});
    ASSERT_EQ(made.status, 0) << made.err;
    const std::string config = ReadAll(*folder_ / "arm/config.yaml");
    std::string listed = config.substr(config.find("\ncameras:"));
    for (size_t at = listed.find("gripper"); at != std::string::npos; at = listed.find("gripper", at + 12)) {
      listed.insert(at, "left.");
    }
    WriteAll(*folder_ / "arm/listed.yaml",
             "robots:\n  left: {poses: poses.csv, joints: joints.csv, model: ur10e}\n" + listed);
  }

  // Runs the doctor on the config with this name.
  static CommandResult DoctorOf(const std::string& config, const std::vector<std::string>& settings) {
    return WithSettings({"doctor", (*folder_ / "arm" / config).string(), "--quiet"}, settings);
  }
  // Returns the number of symptoms with this code.
  static int Count(const CommandResult& doctor, const std::string& code) {
    int count = 0;
    for (size_t at = doctor.out.find("[" + code + "]"); at != std::string::npos;
         at = doctor.out.find("[" + code + "]", at + 1)) {
      ++count;
    }
    return count;
  }
};

TEST_F(OneArmDoctorTest, FindsNothingWrongWithTheArm) {
  const CommandResult doctor = DoctorOf("listed.yaml", {});
  EXPECT_THAT(doctor.out, AllOf(HasSubstr("nothing is wrong"), HasSubstr("from where robots.left.tool has it")));
  EXPECT_EQ(Count(doctor, "calibrated_kinematics"), 1) << doctor.out;
}

TEST_F(OneArmDoctorTest, NamesTheUnitOfTheJoints) {
  const CommandResult listed = DoctorOf("listed.yaml", {"robots.left.joint_angle=deg"});
  EXPECT_THAT(First(listed), AllOf(HasSubstr("wrong [joint_angle]: the recorded joints"),
                                   HasSubstr("-> set robots.left.joint_angle: rad")));
  EXPECT_EQ(Count(listed, "joint_angle"), 1) << listed.out;
  EXPECT_THAT(First(DoctorOf("config.yaml", {"captures.joint_angle=deg"})),
              AllOf(HasSubstr("wrong [joint_angle]"), HasSubstr("-> set captures.joint_angle: rad")));
}

TEST_F(OneArmDoctorTest, NamesTheModelThatRecordedJointsAreOf) {
  const CommandResult listed = DoctorOf("listed.yaml", {"robots.left.model=ur5e"});
  EXPECT_THAT(First(listed), AllOf(HasSubstr("wrong [robot_model]"), HasSubstr("-> set robots.left.model: ur10e")));
  EXPECT_EQ(Count(listed, "robot_model"), 1) << listed.out;
  EXPECT_THAT(First(DoctorOf("config.yaml", {"robot.model=ur5e"})),
              AllOf(HasSubstr("wrong [robot_model]"), HasSubstr("-> set robot.model: ur10e")));
}

TEST_F(OneArmDoctorTest, NamesTheModelThatReachesThePoses) {
  const CommandResult doctor =
      DoctorOf("listed.yaml", {"robots.left.model=ur5e", "robots.left.joints=",
                               "robots.left.tool={translation: [0 mm, 0 mm, 100 mm], rpy: [0 deg, 0 deg, 0 deg]}"});
  EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [robot_unreachable]: the arm ur5e does not reach the poses of"),
                                   HasSubstr("-> set robots.left.model: ur10")));
  EXPECT_EQ(Count(doctor, "robot_unreachable"), 1) << doctor.out;
}

TEST_F(OneArmDoctorTest, NamesJointsOfOtherRows) {
  std::vector<std::string> lines;
  for (const std::string& line : Split(ReadAll(*folder_ / "arm/joints.csv"), '\n')) {
    if (!line.empty()) lines.push_back(line.substr(line.find(',') + 1));
  }
  std::rotate(lines.begin() + 1, lines.begin() + 2, lines.end());
  WriteAll(*folder_ / "arm/shifted.csv", Join(lines, "\n") + "\n");
  const CommandResult doctor =
      DoctorOf("listed.yaml", {"robots.left.joints=" + (*folder_ / "arm/shifted.csv").string()});
  EXPECT_THAT(First(doctor), AllOf(HasSubstr("wrong [joint_pairing]"), HasSubstr("are 1 row further up")));
  EXPECT_EQ(Count(doctor, "joint_pairing"), 1) << doctor.out;
}

}  // namespace
}  // namespace heba
