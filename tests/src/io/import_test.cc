// Tests of the import of data sets in the formats of other projects.
#include "heba/io/import.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/geometry/rigid3.h"
#include "heba/io/pose_formats.h"
#include "tests/support/data_sets.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// The base_from_gripper that every set contains, and the camera_from_target that some contain.
const Rigid3d kGripper(ExpRotation({0.3, -0.5, 1.1}), {0.25, -0.5, 0.75});
const Rigid3d kTarget(ExpRotation({-2.0, 0.4, 0.2}), {0.05, -0.125, 0.5});

void Write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  WriteFileAtomically(path, text);
}

std::vector<std::string> Texts(const PoseFormat& format, const Rigid3d& pose) {
  std::vector<std::string> texts;
  for (const double number : NumbersFromPose(format, pose)) texts.push_back(RoundTrip(number));
  return texts;
}
std::string Numbers(const std::string& format, const Rigid3d& pose, const std::string& between) {
  return Join(Texts(*FindPoseFormat(format), pose), between);
}
Rigid3d InMm(Rigid3d pose) {
  pose.translation *= 1000;
  return pose;
}
// Returns the homogeneous matrix as four lines of four numbers.
std::string MatrixLines(const Rigid3d& pose, const std::string& between) {
  const std::vector<std::string> n = Texts(*FindPoseFormat("matrix"), pose);
  std::string text;
  for (size_t row = 0; row < 4; ++row) {
    text += Join({n[4 * row], n[4 * row + 1], n[4 * row + 2], n[4 * row + 3]}, between) + "\n";
  }
  return text;
}
std::string Transform(const Rigid3d& pose) {
  const std::vector<std::string> n = Texts(*FindPoseFormat("ros"), pose);
  return "{translation: {x: " + n[0] + ", y: " + n[1] + ", z: " + n[2] + "}, rotation: {x: " + n[3] + ", y: " + n[4] +
         ", z: " + n[5] + ", w: " + n[6] + "}}";
}
std::string VispPose(const Rigid3d& pose) {
  std::string text = "rows: 6\ncols: 1\ndata:\n";
  for (const std::string& number : Texts(*FindPoseFormat("ur"), pose)) text += "  - [" + number + "]\n";
  return text;
}
std::string OpenCvMatrix(const Rigid3d& pose) {
  return "!!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [ " + Numbers("matrix", pose, ",\n       ") +
         " ]\n";
}

struct Peer {
  std::string format;
  std::function<fs::path(const fs::path& folder)> write;  // Writes the set and returns the path to import.
  bool has_target_pose = false;
  std::optional<Setup> setup = {};
  std::string image = {};       // File name of the first image; empty if the set has no images.
  double fx = 0;                // Focal length in px; 0 if the set has no camera.
  std::string target_has = {};  // Part of the text of the target.
};

// Returns a set for each reader that no recorded set covers. The files are those that the programs of the projects
// write.
std::vector<Peer> Peers() {
  return {
      {"industrial_calibration",
       [](const fs::path& folder) {
         Write(folder / "cal_data.yaml", "data:\n  - image: images/0.png\n    pose: poses/0.yaml\n");
         const std::vector<std::string> n = Texts(*FindPoseFormat("ros"), kGripper);
         Write(folder / "poses/0.yaml", "x: " + n[0] + "\ny: " + n[1] + "\nz: " + n[2] + "\nqz: " + n[5] +
                                            "\nqx: " + n[3] + "\nqw: " + n[6] + "\nqy: " + n[4] + "\n");
         Write(folder / "config.yaml",
               "intrinsics: {fx: 1352.0, fy: 1356.1, cx: 965.0, cy: 653.3}\nstatic_camera: true\nhomography_threshold: "
               "2\ntarget_finder:\n"
               "  type: CharucoGridTargetFinder\n  rows: 7\n  cols: 5\n  chessboard_dim: 0.036195\n"
               "  aruco_marker_dim: 0.018256\n  dictionary: 10\n");
         return folder;
       },
       false, Setup::kEyeToHand, "0.png", 1352, "DICT_6X6_250"},
      {"easy_handeye2",
       [](const fs::path& folder) {
         Write(
             folder / "my.samples",
             "parameters:\n  name: my\n  calibration_type: eye_on_base\n  robot_base_frame: base\nsamples:\n- robot: " +
                 Transform(Inverse(kGripper)) + "\n  tracking: " + Transform(kTarget) + "\n");
         return folder / "my.samples";
       },
       true, Setup::kEyeToHand},
      {"moveit_calibration",
       [](const fs::path& folder) {
         Write(folder / "samples.yaml", "- effector_wrt_world: [" + Numbers("matrix", kGripper, ", ") +
                                            "]\n  object_wrt_sensor: [" + Numbers("matrix", kTarget, ", ") + "]\n");
         return folder / "samples.yaml";
       },
       true},
      {"visp",
       [](const fs::path& folder) {
         Write(folder / "pose_rPe_1.yaml", VispPose(kGripper));
         Write(folder / "pose_cPo_1.yaml", VispPose(kTarget));
         return folder;
       },
       true},
      {"mchec",
       [](const fs::path& folder) {
         Write(folder / "CalibrationInfo.yaml",
               "number_of_cameras: 2\ncamera_folder_prefix: camera\npattern_type: checkerboard\nnumber_of_rows: 4\n"
               "number_of_columns: 3\nsize: 0.05\nresize_factor: 1\nvisual_error: 1\ncalibration_setup: 1\n");
         Write(folder / "camera2/intrinsic_pars_file.yaml",
               "fx: 1371.0\nfy: 1371.0\ncx: 960.5\ncy: 540.5\nhas_dist_coeff: 1\ndist_k0: 0.1\ndist_k1: 0\ndist_px: 0\n"
               "dist_py: 0\ndist_k2: 0\ndist_k3: 0\ndist_k4: 0\ndist_k5: 0\nimg_width: 1920\nimg_height: 1080\n");
         Write(folder / "camera2/image/0000.png", "x");
         Write(folder / "camera2/pose/0000.csv", MatrixLines(kGripper, ","));
         return folder / "camera2";
       },
       false, Setup::kEyeToHand, "0000.png", 1371, "rows: 4"},
      {"visp",
       [](const fs::path& folder) {
         Write(folder / "franka_pose_rPe_1.yaml", VispPose(kGripper));
         Write(folder / "franka_image-1.png", "x");
         return folder;
       },
       false, std::nullopt, "franka_image-1.png"},
      {"tabb",
       [](const fs::path& folder) {
         Write(folder / "robot_cali.txt", "1\n" + MatrixLines(InMm(Inverse(kGripper)), " ") + "\n");
         Write(folder / "calibration_object.txt", "tile size: 28.5 mm\n");
         Write(folder / "image0.png", "x");
         return folder;
       },
       false, Setup::kEyeInHand, "image0.png"},
      {"tabb",
       [](const fs::path& folder) {
         Write(folder / "robot_cali.txt", "1\n" + MatrixLines(InMm(Inverse(kGripper)), " ") + "\n");
         Write(folder / "calibration_object.txt",
               "chess_mm_height 15.8\nchess_mm_width 15.8\nchess_height 6\nchess_width 8\n");
         Write(folder / "images/camera0/image0.png", "x");
         return folder;
       },
       false, Setup::kEyeInHand, "image0.png", 0, "columns: 8"},
      {"koide",
       [](const fs::path& folder) {
         Write(folder / "001_image.jpg", "x");
         Write(folder / "001_pose.csv", MatrixLines(kGripper, " "));
         Write(folder / "camera_matrix.csv", "600 0 320\n0 601 240\n0 0 1\n");
         Write(folder / "distortion.csv", "0.1 -0.2 0 0 0\n");
         return folder;
       },
       false, Setup::kEyeInHand, "001_image.jpg", 600},
      {"opencv_pairs",
       [](const fs::path& folder) {
         Write(folder / "pairs.yml",
               "%YAML:1.0\n---\nframeCount: 1\nT1_0: " + OpenCvMatrix(kGripper) + "T2_0: " + OpenCvMatrix(kTarget));
         return folder / "pairs.yml";
       },
       true},
      {"zivid",
       [](const fs::path& folder) {
         Write(folder / "pos01.yaml", "%YAML:1.0\n---\nPoseState: " + OpenCvMatrix(InMm(kGripper)));
         Write(folder / "img01.png", "x");
         return folder;
       },
       false, std::nullopt, "img01.png"},
      {"fishros",
       [](const fs::path& folder) {
         const PoseFormat format{"", {"x", "y", "z", "rx", "ry", "rz"}, "m", "extrinsic_xyz", "deg"};
         Write(folder / "poses.csv",
               "hand," + Join(Texts(format, kGripper), ",") + "\neye," + Join(Texts(format, kTarget), ",") + "\n");
         return folder / "poses.csv";
       },
       true},
      {"tum",
       [](const fs::path& folder) {
         Write(folder / "poses.txt",
               "# time tx ty tz qx qy qz qw\n1305031102.1 " + Numbers("ros", kGripper, " ") + "\n");
         Write(folder / "images/1305031102.1.png", "x");
         return folder / "poses.txt";
       },
       false, std::nullopt, "1305031102.1.png"},
      {"matrices",
       [](const fs::path& folder) {
         Write(folder / "RobotPosesVec.txt", Numbers("matrix", kGripper, " ") + "\n");
         return folder / "RobotPosesVec.txt";
       },
       false},
  };
}

class ImportTest : public testing::TestWithParam<Peer> {
 protected:
  TempFolder folder_;
};

TEST_P(ImportTest, ReadsWhatTheProjectWrites) {
  const Peer& peer = GetParam();
  const fs::path source = peer.write(folder_.path());
  const ImportedSet set = ImportDataSet(source, "");
  EXPECT_EQ(set.format, peer.format);
  ASSERT_EQ(set.captures.size(), 1U);
  const ImportedCapture& capture = set.captures[0];
  ASSERT_TRUE(capture.base_from_gripper.has_value());
  EXPECT_LT(DistanceM(*capture.base_from_gripper, kGripper), 1e-12);
  EXPECT_LT(AngleRad(*capture.base_from_gripper, kGripper), 1e-7);
  EXPECT_EQ(capture.camera_from_target.has_value(), peer.has_target_pose);
  if (capture.camera_from_target) {
    EXPECT_LT(DistanceM(*capture.camera_from_target, kTarget), 1e-12);
    EXPECT_LT(AngleRad(*capture.camera_from_target, kTarget), 1e-7);
  }
  EXPECT_EQ(set.setup, peer.setup);
  EXPECT_EQ(capture.image.filename(), peer.image);
  EXPECT_EQ(set.camera ? set.camera->params[0] : 0, peer.fx);
  EXPECT_THAT(set.target, testing::HasSubstr(peer.target_has));
  EXPECT_FALSE(set.files.empty());
  // The format is also accepted by its name.
  EXPECT_EQ(ImportDataSet(source, peer.format).captures.size(), 1U);
}

// A file that is truncated at any position gives either the captures that remain or an InputError whose message is
// one line.
TEST_P(ImportTest, TruncatedFilesAreInputErrors) {
  const fs::path source = GetParam().write(folder_.path());
  const ImportedSet set = ImportDataSet(source, "");
  for (const fs::path& file : set.files) {
    const std::string text = ReadTextFile(file);
    for (size_t length = 0; length < text.size(); length += 1 + text.size() / 40) {
      WriteFileAtomically(file, text.substr(0, length));
      const std::string error = InputErrorOf([&] { ImportDataSet(source, GetParam().format); });
      EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
    WriteFileAtomically(file, text);
  }
}

INSTANTIATE_TEST_SUITE_P(, ImportTest, testing::ValuesIn(Peers()),
                         [](const auto& peer) { return peer.param.format + "_" + std::to_string(peer.index); });

TEST(ImportCornersTest, MrcalCornersKeepTheirIds) {
  const TempFolder folder;
  Write(folder / "corners.vnl",
        "# filename x y level\na.png 10.5 20.25 0\na.png 11 21 -\na.png 12 22 1\nb.png - - -\n");
  const ImportedSet set = ImportDataSet(folder / "corners.vnl", "");
  EXPECT_EQ(set.format, "mrcal_corners");
  ASSERT_EQ(set.captures.size(), 2U);
  EXPECT_EQ(set.captures[0].ids, (std::vector<int>{0, 2}));
  EXPECT_EQ(set.captures[0].pixels[0], Eigen::Vector2d(10.5, 20.25));
  EXPECT_EQ(set.captures[0].pixels[1], Eigen::Vector2d(12, 22));
  EXPECT_TRUE(set.captures[1].ids.empty());
  EXPECT_FALSE(set.captures[0].base_from_gripper.has_value());
}

TEST(ImportFaultsTest, SayWhatIsWrong) {
  const TempFolder folder;
  Write(folder / "notes.txt", "nothing of the kind\n");
  EXPECT_THAT(InputErrorOf([&] { ImportDataSet(folder / "notes.txt", ""); }),
              testing::HasSubstr("is not a data set in a known format"));
  EXPECT_THAT(InputErrorOf([&] { ImportDataSet(folder / "absent", ""); }),
              testing::HasSubstr("no such file or folder"));
  Write(folder / "twice.txt", "1 2 3 4 5 6 7\n");
  EXPECT_THAT(InputErrorOf([&] { ImportDataSet(folder / "twice.txt", "tum"); }),
              testing::HasSubstr("8 numbers are needed"));
}

// Data sets recorded by others, in the layout of their projects.
TEST(ImportRecordedTest, ReadsIndustrialCalibration) {
  const fs::path source = DataDir() / "ic_charuco_eye_to_hand" / "original";
  HEBA_SKIP_WITHOUT(source);
  const ImportedSet set = ImportDataSet(source, "");
  EXPECT_EQ(set.format, "industrial_calibration");
  EXPECT_EQ(set.captures.size(), 16U);
  EXPECT_NEAR(set.captures[0].base_from_gripper->translation.x(), 0.113074204220918, 1e-15);
}
TEST(ImportRecordedTest, ReadsMoveitCalibration) {
  const fs::path source = DataDir() / "moveit_pose_pairs" / "original" / "pose_samples.json";
  HEBA_SKIP_WITHOUT(source);
  const ImportedSet set = ImportDataSet(source, "");
  EXPECT_EQ(set.format, "moveit_calibration");
  EXPECT_EQ(set.captures.size(), 50U);
  EXPECT_NEAR(set.captures[0].camera_from_target->translation.z(), 0.9215995861113058, 1e-12);
}
TEST(ImportRecordedTest, ReadsTabb) {
  const fs::path source = DataDir() / "caliban_no_curv" / "original";
  HEBA_SKIP_WITHOUT(source);
  const ImportedSet set = ImportDataSet(source, "");
  EXPECT_EQ(set.format, "tabb");
  EXPECT_EQ(set.captures.size(), 100U);
  // The file contains the inverse of base_from_gripper.
  EXPECT_NEAR(1000 * Inverse(*set.captures[0].base_from_gripper).translation.x(), 44.00490855529249, 1e-9);
}

}  // namespace
}  // namespace heba
