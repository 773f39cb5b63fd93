#include "heba/io/export.h"

#include <cmath>
#include <functional>
#include <map>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/io/camera_file.h"
#include "heba/io/export_files.h"
#include "heba/io/export_format.h"
#include "heba/io/pose_file.h"
#include "heba/robot/arm_table.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

using testing::HasSubstr;

ExportRequest TestRequest(const Rigid3d& pose, const std::string& model = "brown5", bool is_ur_controller = false) {
  RunResult result = ShortResult(Setup::kEyeToHand, "chessboard", 48);
  result.name = "cell_7";
  Estimate estimate;
  estimate.ok = true;
  estimate.hand_eye.camera_mount_from_camera = pose;
  estimate.camera = TestCamera(model);
  return MakeExportRequests(WithEstimate(result, estimate), "park", {is_ur_controller}).cameras[0];
}

std::string Exported(const std::string& format, const ExportRequest& request) {
  for (const ExportFormat& entry : ExportFormats()) {
    if (entry.name != format) continue;
    const Outcome<std::string> text = ExportText(entry, request);
    EXPECT_TRUE(text.ok()) << text.reason();
    return text.ok() ? *text : "";
  }
  ADD_FAILURE() << "no format " << format;
  return "";
}

// Returns whether a format holds the kinematics of the arm instead of the camera's pose.
bool IsOfArm(const ExportFormat& format) {
  for (const char* name : {"robot_urdf", "ur_calibration", "ur_kinematics", "dh_csv"}) {
    if (format.name == name) return true;
  }
  return false;
}

// Returns poses of every kind: the identity, small numbers, gimbal lock, rotations by 180 deg, and random poses.
std::vector<Rigid3d> Poses() {
  Rng rng(3);
  std::vector<Rigid3d> poses = {
      Rigid3d(),
      {Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * M_PI, Eigen::Vector3d::UnitY())), Eigen::Vector3d(1e-5, -2e-7, 3)},
      {Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d(-1, 2, 0)}};
  for (int i = 0; i < 20; ++i) {
    poses.push_back({ExpRotation(rng.Uniform(0, 3.1) * rng.Direction3()), rng.Uniform(0, 2) * rng.Direction3()});
  }
  return poses;
}

std::vector<double> NumbersIn(const std::string& text) {
  static const std::regex kNumber(R"([-+]?\d+\.\d*(e[-+]\d+)?)");
  std::vector<double> numbers;
  for (std::sregex_iterator at(text.begin(), text.end(), kNumber), end; at != end; ++at) {
    numbers.push_back(std::stod(at->str()));
  }
  return numbers;
}

std::string After(const std::string& text, const std::string& mark) {
  const size_t at = text.find(mark);
  EXPECT_NE(at, std::string::npos) << mark << "\n" << text;
  return at == std::string::npos ? "" : text.substr(at + mark.size());
}

Rigid3d PoseIn(const std::string& text, const PoseFormat& format) {
  std::vector<double> numbers = NumbersIn(text);
  EXPECT_GE(numbers.size(), format.columns.size()) << text;
  numbers.resize(format.columns.size());
  const Outcome<Rigid3d> pose = PoseFromNumbers(format, numbers);
  EXPECT_TRUE(pose.ok()) << pose.reason();
  return pose.ok() ? *pose : Rigid3d();
}

void ExpectSame(const Rigid3d& found, const Rigid3d& wanted, const std::string& what) {
  EXPECT_LT(LocalCoordinates(wanted, found).norm(), 1e-14 * (1 + wanted.translation.norm()) + 3e-15) << what;
}

// The exported pose is read from where the other software looks for it, and equals the original.
TEST(ExportTest, PosesRoundTrip) {
  const PoseFormat& ros = *FindPoseFormat("ros");
  const PoseFormat rpy{"", {"x", "y", "z", "r", "p", "w"}, "m", "extrinsic_xyz", "rad"};
  for (const Rigid3d& pose : Poses()) {
    const ExportRequest request = TestRequest(pose);
    ExpectSame(PoseIn(After(Exported("urdf", request), "<origin"), rpy), pose, "urdf");
    ExpectSame(PoseIn(After(Exported("ros1", request), "args=\""), ros), pose, "ros1");
    ExpectSame(PoseIn(After(Exported("moveit", request), "args=\""), ros), pose, "moveit");
    ExpectSame(PoseIn(After(Exported("ros2", request), "arguments=["), ros), pose, "ros2");
    ExpectSame(PoseIn(After(Exported("easy_handeye2", request), "transform:"), ros), pose, "easy_handeye2");
    ExpectSame(PoseIn(After(After(Exported("opencv", request), "hand_eye:"), "data:"), *FindPoseFormat("matrix")), pose,
               "opencv");
    std::vector<double> extrinsics = NumbersIn(After(Exported("mrcal", request), "'extrinsics':"));
    ASSERT_GE(extrinsics.size(), 6U);
    const Rigid3d camera_from_parent(ExpRotation(Eigen::Vector3d(extrinsics[0], extrinsics[1], extrinsics[2])),
                                     Eigen::Vector3d(extrinsics[3], extrinsics[4], extrinsics[5]));
    ExpectSame(Inverse(camera_from_parent), pose, "mrcal");
  }
}

// The export is read back by the reader of poses.csv.
TEST(ExportTest, RobotPosesRoundTripInEveryFormat) {
  for (const Rigid3d& pose : Poses()) {
    for (const PoseFormat& format : PoseFormats()) {
      const std::string text = Exported(format.name, TestRequest(pose));
      ExpectSame(ParsePoses(text, "export", format).front().pose, pose, format.name);
    }
    ExportRequest in_mm = TestRequest(pose);
    in_mm.length_unit = "mm";
    PoseFormat matrix = *FindPoseFormat("matrix");
    matrix.translation_unit = "mm";
    ExpectSame(ParsePoses(Exported("matrix", in_mm), "export", matrix).front().pose, pose, "matrix in mm");
  }
}

// Returns the reason why a format cannot hold the request; an empty text if it can.
std::string Refusal(const std::string& name, const ExportRequest& request) {
  for (const ExportFormat& format : ExportFormats()) {
    if (format.name == name) return ExportText(format, request).reason();
  }
  return name + " is not a format";
}

// The export is read back by the reader of camera files.
TEST(ExportTest, CamerasRoundTrip) {
  for (const CameraModel* model : CameraModels()) {
    const ExportRequest request = TestRequest(Rigid3d(), std::string(model->name()));
    for (const char* format : {"opencv", "camera_info", "mrcal"}) {
      const std::optional<OpenCvLens> lens = OpenCvLensOf(request.camera);
      const bool is_held = lens && (lens->kind == LensKind::kPerspective || std::string(format) != "mrcal");
      EXPECT_EQ(Refusal(format, request).empty(), is_held) << format << " " << model->name();
      if (!is_held) {
        EXPECT_THAT(Refusal(format, request), HasSubstr("camera model " + std::string(model->name())));
        continue;
      }
      const Camera camera = ParseCameraFile(Exported(format, request), "export");
      EXPECT_EQ(camera.width_px, request.camera.width_px) << format;
      EXPECT_EQ(camera.height_px, request.camera.height_px) << format;
      std::vector<double> wanted = request.camera.params;
      // A smaller model may be read back as a larger one whose additional coefficients are zero.
      if (camera.model == "brown5") wanted.resize(camera.params.size(), 0);
      EXPECT_EQ(camera.params, wanted) << format << " " << model->name();
    }
  }
}

// The polynomial lens model of Kalibr has no k3.
TEST(ExportTest, CamerasRoundTripThroughKalibr) {
  for (const std::string model : {"pinhole", "brown4", "brown5", "kannala_brandt4", "double_sphere", "eucm", "omni"}) {
    ExportRequest request = TestRequest(Rigid3d(), model);
    if (model == "brown5") request.camera.params[8] = 0;
    const Camera camera = ParseCameraFile(Exported("kalibr", request), "export");
    EXPECT_EQ(camera.width_px, request.camera.width_px) << model;
    std::vector<double> wanted = request.camera.params;
    // Kalibr's lens is brown4, which pinhole and a brown5 without k3 become.
    if (camera.model == "brown4") wanted.resize(camera.params.size(), 0);
    EXPECT_EQ(camera.params, wanted) << model;
  }
}

TEST(ExportTest, RefusesWhatAFormatCannotHold) {
  ExportRequest request = TestRequest(Rigid3d());
  request.camera.params[8] = 0.01;
  EXPECT_THAT(Refusal("kalibr", request), HasSubstr("k3 is 0.01"));
  EXPECT_THAT(Refusal("kalibr", request), HasSubstr("calibrate it with the model brown4"));
  request.camera.params[8] = 0;
  EXPECT_EQ(Refusal("kalibr", request), "");
  EXPECT_THAT(Refusal("mrcal", TestRequest(Rigid3d(), "kannala_brandt4")), HasSubstr("kannala_brandt4"));
  EXPECT_THAT(Exported("kalibr", TestRequest(Rigid3d(), "kannala_brandt4")),
              HasSubstr("distortion_model: equidistant"));
}

Eigen::Matrix<double, 6, 6> TestCovariance() {
  Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Identity();
  root(0, 4) = 0.3;
  root(5, 1) = -0.4;
  root.diagonal() << 1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3;
  return root * root.transpose();
}

// Returns the Jacobian of the pose of `change(request)` with respect to the pose of the optical frame, both in their
// tangent spaces, by finite differences.
template <typename Change>
Eigen::Matrix<double, 6, 6> MovedBy(const ExportRequest& request, const Change& change) {
  const Rigid3d changed = change(request).parent_from_child;
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 6, 6> moved;
  for (int i = 0; i < 6; ++i) {
    ExportRequest near = request;
    near.parent_from_child = Retract(request.parent_from_child, kStep * Tangent6::Unit(i));
    moved.col(i) = LocalCoordinates(changed, change(near).parent_from_child) / kStep;
  }
  return moved;
}

// The exported covariance is that of the exported frame: it is compared with the covariance propagated through the
// numeric Jacobian.
TEST(ExportTest, CovarianceIsTransformedWithTheFrames) {
  const Rigid3d optical_from_child(ExpRotation({0.3, -0.2, 0.9}), {0.02, -0.05, 0.01});
  const auto link = [&](const ExportRequest& request) {
    return WithChild(request, ExportFrame::kLink, optical_from_child);
  };
  const auto inverse = [&](const ExportRequest& request) { return Inverted(link(request)); };
  for (const Rigid3d& pose : Poses()) {
    ExportRequest request = TestRequest(pose);
    request.covariance = TestCovariance();
    for (const std::function<ExportRequest(const ExportRequest&)>& change :
         {std::function<ExportRequest(const ExportRequest&)>(link), {inverse}}) {
      const Eigen::Matrix<double, 6, 6> moved = MovedBy(request, change);
      const Eigen::Matrix<double, 6, 6> wanted = moved * TestCovariance() * moved.transpose();
      EXPECT_LT((*change(request).covariance - wanted).norm(), 1e-4 * wanted.norm());
    }
  }
}

// The covariance of ROS is that of the position and of rotations about the fixed axes of the parent frame.
TEST(ExportTest, PoseWithCovarianceIsInTheParentsAxes) {
  for (const Rigid3d& pose : Poses()) {
    ExportRequest request = TestRequest(pose);
    request.covariance = TestCovariance();
    const std::string text = Exported("pose_with_covariance", request);
    ExpectSame(PoseIn(After(text, "position:"), *FindPoseFormat("ros")), pose, "pose_with_covariance");
    const std::vector<double> numbers = NumbersIn(After(text, "covariance: ["));
    ASSERT_EQ(numbers.size(), 36U);
    const Eigen::Matrix<double, 6, 6> found = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(numbers.data());
    constexpr double kStep = 1e-6;
    Eigen::Matrix<double, 6, 6> moved;
    for (int i = 0; i < 6; ++i) {
      const Rigid3d near = Retract(pose, kStep * Tangent6::Unit(i));
      moved.col(i) << near.translation - pose.translation, LogRotation(near.rotation * pose.rotation.conjugate());
    }
    moved /= kStep;
    const Eigen::Matrix<double, 6, 6> wanted = moved * TestCovariance() * moved.transpose();
    EXPECT_LT((found - wanted).norm(), 1e-4 * wanted.norm());
    EXPECT_EQ(found, found.transpose());
  }
}

TEST(ExportTest, TheInverseIsThePoseOfTheParentInTheChild) {
  for (const Rigid3d& pose : Poses()) {
    const ExportRequest request = Inverted(TestRequest(pose));
    EXPECT_EQ(request.parent_frame, "camera_optical_frame");
    EXPECT_EQ(request.child_frame, "base_link");
    ExpectSame(PoseIn(After(Exported("ros2", request), "arguments=["), *FindPoseFormat("ros")), Inverse(pose), "ros2");
    for (const ExportFormat& format : ExportFormats()) {
      const Outcome<std::string> text = ExportText(format, request);
      const bool has_room = text.ok();
      // These forms fix the direction of the pose, so a reader would take the inverse for the pose itself. The forms of
      // arms hold no pose, and this request has no arm.
      const bool is_of_arm = IsOfArm(format);
      EXPECT_EQ(has_room, format.name != "easy_handeye2" && format.name != "opencv" && format.name != "camera_info" &&
                              format.name != "kalibr" && format.name != "mrcal" &&
                              format.name != "pose_with_covariance" && !is_of_arm)
          << format.name << ": " << text.reason();
    }
  }
}

TEST(ExportTest, BodyFrameHasTheOriginOfTheOpticalFrame) {
  for (const Rigid3d& pose : Poses()) {
    const ExportRequest request = WithChild(TestRequest(pose), ExportFrame::kBody, OpticalFromBody());
    EXPECT_EQ(request.child_frame, "camera_link");
    EXPECT_THAT(Exported("urdf", request), HasSubstr("camera_link: the camera's BODY frame"));
    ExpectSame(request.parent_from_child, pose * OpticalFromBody(), "body");
  }
}

// The numbers are written in the controller's own syntax, with as many digits as it accepts.
TEST(ExportTest, ControllersReadTheirOwnSyntax) {
  const std::map<std::string, std::string> forms = {
      {"kuka", R"(\{X %, Y %, Z %, A %, B %, C %\})"},
      {"ur", R"(p\[%, %, %, %, %, %\])"},
      {"abb", R"(\[\[%, %, %\], \[%, %, %, %\]\])"},
      {"fanuc", "UFRAME: X % mm, Y % mm, Z % mm, W % deg, P % deg, R % deg"},
      {"staubli", R"(\{%, %, %, %, %, %\})"},
      {"doosan", R"(posx\(%, %, %, %, %, %\))"},
      {"techman", R"(\{%, %, %, %, %, %\})"},
      {"kawasaki", R"(TRANS\(%, %, %, %, %, %\))"},
      {"yaskawa", "X % Y % Z % Rx % Ry % Rz %"}};
  for (const auto& [name, form] : forms) {
    for (const Rigid3d& pose : Poses()) {
      const std::string text = Exported(name, TestRequest(pose));
      const std::string line =
          After(text, "# for the controller: ").substr(0, After(text, "# for the controller: ").find('\n'));
      EXPECT_TRUE(std::regex_match(line, std::regex(std::regex_replace(form, std::regex("%"), R"(-?\d+\.\d{3,6})"))))
          << line;
      const Rigid3d found = PoseIn(line, *FindPoseFormat(name));
      EXPECT_LT(LocalCoordinates(pose, found).norm(), 5e-6) << name;
    }
  }
}

// The inverse is a frame in the camera, which the controller cannot store.
TEST(ExportTest, InverseIsNotOfferedToTheController) {
  EXPECT_THAT(Exported("fanuc", Inverted(TestRequest(Rigid3d()))), testing::Not(HasSubstr("for the controller")));
}

// The base frame of the teach pendant is `base`, which is rotated by 180 deg about z from base_link.
TEST(ExportTest, UniversalRobotsPosesAreInTheControllersBase) {
  const ExportRequest request = TestRequest(Rigid3d(), "brown5", true);
  EXPECT_EQ(request.parent_frame, "base");
  EXPECT_THAT(Exported("ros2", request), HasSubstr("rotated by 180 deg about z"));
  EXPECT_THAT(Exported("ros2", TestRequest(Rigid3d())), testing::Not(HasSubstr("180 deg")));
}

// Command lines that are meant to be copied name both frames.
TEST(ExportTest, CommandLinesNameTheFrames) {
  ExportRequest request = TestRequest(Rigid3d());
  request.parent_frame = "world";
  request.child_frame = "cam/optical";
  EXPECT_THAT(Exported("ros2", request), HasSubstr("--frame-id world --child-frame-id cam/optical\n"));
  EXPECT_THAT(Exported("ros1", request), HasSubstr(" world cam/optical\n"));
}

// Every form states which frame's axes it uses. A malicious name cannot inject markup, end a comment or add code.
TEST(ExportTest, NamesAreHarmless) {
  ExportRequest request = TestRequest(Rigid3d());
  request.name = "a--><evil/>\"\nimport os\n#";
  request.camera.params[8] = 0;
  request.covariance = TestCovariance();
  request.arm = *FindArm("ur5e");
  for (const ExportFormat& format : ExportFormats()) {
    // Only this format needs an arm that its controller knows.
    request.arm->name = format.name == "ur_calibration" ? "ur5e" : request.name;
    const std::string text = Exported(format.name, request);
    const bool is_of_arm = IsOfArm(format);
    EXPECT_THAT(text, HasSubstr(is_of_arm ? "kinematics of the arm" : "OPTICAL")) << format.name;
    EXPECT_THAT(text, testing::Not(HasSubstr("\nimport os"))) << format.name;
  }
  EXPECT_THAT(Exported("camera_info", request), HasSubstr(R"(camera_name: "a--><evil/>\"\x0aimport os\x0a#")"));
}

TEST(ExportTest, TheBodyFrameLooksForward) {
  EXPECT_LT((OpticalFromBody() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
  EXPECT_LT((OpticalFromBody() * Eigen::Vector3d::UnitZ() + Eigen::Vector3d::UnitY()).norm(), 1e-15);
}

}  // namespace
}  // namespace heba
