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
// Returns `text` with the first occurrence of `from` replaced by `to`.
std::string With(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  CHECK(at != std::string::npos) << from;
  return text.replace(at, from.size(), to);
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

// Rigs.

const char* const kMchecInfo =
    "number_of_cameras: 3\ncamera_folder_prefix: camera\npattern_type: checkerboard\nnumber_of_rows: 4\n"
    "number_of_columns: 3\nsize: 0.05\nresize_factor: 1\nvisual_error: 1\ncalibration_setup: 1\n";

std::string MchecIntrinsics(const std::string& centre) {
  return "fx: 1371.0\nfy: 1371.0\n" + centre + "has_dist_coeff: 0\nimg_width: 1920\nimg_height: 1080\n";
}

void WriteMchecCapture(const fs::path& camera, const std::string& image, const std::string& pose,
                       const Rigid3d& value) {
  Write(camera / "image" / image, "x");
  Write(camera / "pose" / pose, MatrixLines(value, ","));
}

// Writes two cameras of the three that are stated: the first sees the captures 0, 1 and 7, the second 1 and 9, in files
// with other names. A pose is kGripper moved by as many centimetres as its number.
Rigid3d Moved(Rigid3d pose, double x_m) {
  pose.translation.x() += x_m;
  return pose;
}
Rigid3d PoseOfNumber(int number) { return Moved(kGripper, 0.01 * number); }
void WriteMchec(const fs::path& folder) {
  Write(folder / "CalibrationInfo.yaml", kMchecInfo);
  Write(folder / "camera1/intrinsic_pars_file.yaml", MchecIntrinsics("cx: 960\ncy: 540\n"));
  Write(folder / "camera2/intrinsic_pars_file.yaml", MchecIntrinsics("cx: 960.5\ncy: 540.5\n"));
  for (const int number : {0, 1, 7}) {
    const std::string name = "000" + std::to_string(number);
    WriteMchecCapture(folder / "camera1", name + ".png", name + ".csv", PoseOfNumber(number));
  }
  for (const int number : {1, 9}) {
    const std::string name = "000" + std::to_string(number);
    WriteMchecCapture(folder / "camera2", "sample_" + name + ".jpg", name + ".csv", PoseOfNumber(number));
  }
  Write(folder / "camera2/image/sample_0100.jpg", "x");
  Write(folder / "gt_cam1.csv", MatrixLines(kTarget, " "));
  Write(folder / "GT/gt_cam2.csv", MatrixLines(kGripper, " "));
}

TEST(ImportCellTest, MatchesTheImagesOfSeveralCamerasByTheirNumbers) {
  const TempFolder folder;
  WriteMchec(folder.path());
  const std::optional<ImportedCell> rig = ImportCell(folder.path(), "");
  ASSERT_TRUE(rig.has_value());
  EXPECT_EQ(rig->format, "mchec");
  EXPECT_EQ(rig->setup, Setup::kEyeToHand);
  ASSERT_EQ(rig->cameras.size(), 2U);
  EXPECT_EQ(rig->cameras[1].name, "camera2");
  EXPECT_EQ(rig->cameras[1].images, folder / "camera2/image");
  std::vector<std::vector<std::string>> images;
  for (const ImportedCellCapture& capture : rig->captures) images.push_back(capture.images);
  EXPECT_EQ(images, (std::vector<std::vector<std::string>>{
                        {"0000.png", ""}, {"0001.png", "sample_0001.jpg"}, {"0007.png", ""}, {"", "sample_0009.jpg"}}));
  const int numbers[] = {0, 1, 7, 9};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_LT(DistanceM(rig->captures[i].base_from_gripper, PoseOfNumber(numbers[i])), 1e-12) << i;
    EXPECT_LT(AngleRad(rig->captures[i].base_from_gripper, PoseOfNumber(numbers[i])), 1e-7) << i;
  }
  EXPECT_LT(DistanceM(*rig->cameras[0].mount_from_camera, kTarget), 1e-12);
  EXPECT_LT(DistanceM(*rig->cameras[1].mount_from_camera, kGripper), 1e-12);
  const std::string remarks = Join(rig->remarks, "\n");
  EXPECT_THAT(remarks, testing::HasSubstr("camera2/image have no pose of their number"));
  EXPECT_THAT(remarks, testing::HasSubstr("left out: camera3"));
}

// A centre that is counted from the corner or from 1 becomes that of heba's pixels; any other principal point stays.
TEST(ImportCellTest, ConvertsTheStatedCentreOfTheImage) {
  const TempFolder folder;
  WriteMchec(folder.path());
  const std::optional<ImportedCell> rig = ImportCell(folder.path(), "");
  ASSERT_TRUE(rig.has_value());
  for (const ImportedCamera& camera : rig->cameras) {
    EXPECT_EQ(camera.camera->params, (std::vector<double>{1371, 1371, 959.5, 539.5})) << camera.name;
  }
  for (const char* centre : {"cx: 960\ncy: 540.5\n", "cx: 934.5\ncy: 529.0\n", "cx: 959.5\ncy: 539.5\n"}) {
    Write(folder / "camera1/intrinsic_pars_file.yaml", MchecIntrinsics(centre));
    const std::vector<double> params = ImportCell(folder.path(), "")->cameras[0].camera->params;
    EXPECT_EQ("cx: " + RoundTrip(params[2]) + "\n", std::string(centre).substr(0, std::string(centre).find('\n') + 1));
  }
}

TEST(ImportCellTest, ReadsOneCameraFromItsFolder) {
  const TempFolder folder;
  WriteMchec(folder.path());
  EXPECT_FALSE(ImportCell(folder / "camera2", "").has_value());
  EXPECT_EQ(ImportDataSet(folder / "camera2", "").captures.size(), 2U);
  EXPECT_EQ(ImportDataSet(folder.path(), "").captures.size(), 3U);
}

TEST(ImportCellTest, RefusesPosesThatContradictEachOther) {
  const TempFolder folder;
  WriteMchec(folder.path());
  // The record of another camera may differ by the rounding of its file, not by a millimetre.
  WriteMchecCapture(folder / "camera2", "sample_0001.jpg", "0001.csv", Moved(PoseOfNumber(1), 1e-8));
  EXPECT_EQ(ImportCell(folder.path(), "")->captures.size(), 4U);
  WriteMchecCapture(folder / "camera2", "sample_0001.jpg", "0001.csv", Moved(PoseOfNumber(1), 1e-3));
  const std::string error = InputErrorOf([&] { ImportCell(folder.path(), ""); });
  EXPECT_THAT(error, testing::HasSubstr("camera2/pose/0001.csv: is 1.0 mm and 0 deg from"));
  EXPECT_THAT(error, testing::HasSubstr("camera1/pose/0001.csv"));
}

TEST(ImportCellTest, FaultsAreInputErrors) {
  const TempFolder folder;
  WriteMchec(folder.path());
  Write(folder / "camera1/image/left_7.png", "x");
  EXPECT_THAT(InputErrorOf([&] { ImportCell(folder.path(), ""); }), testing::HasSubstr("has the same number as"));
  fs::remove(folder / "camera1/image/left_7.png");
  Write(folder / "camera1/intrinsic_pars_file.yaml", "fx: 0\nfy: 0\ncx: 1\ncy: 1\nimg_width: 2\nimg_height: 2\n");
  EXPECT_THAT(InputErrorOf([&] { ImportCell(folder.path(), ""); }),
              testing::HasSubstr("the camera camera1: fx and fy must be positive"));
  fs::remove_all(folder / "camera1");
  fs::remove_all(folder / "camera2");
  EXPECT_THAT(InputErrorOf([&] { ImportCell(folder.path(), ""); }),
              testing::HasSubstr("no folder cameraN has images with poses"));
  for (const std::string& text :
       {std::string("number_of_cameras: 2\n"), std::string(), With(kMchecInfo, "0.05", "x")}) {
    Write(folder / "CalibrationInfo.yaml", text);
    EXPECT_THAT(InputErrorOf([&] { ImportCell(folder.path(), ""); }), testing::HasSubstr("CalibrationInfo.yaml"));
  }
}

const char* const kChain =
    "cam0:\n  camera_model: pinhole\n  intrinsics: [700, 701, 640, 360]\n  distortion_model: radtan\n"
    "  distortion_coeffs: [-0.1, 0.02, 0.0003, -0.0002]\n  resolution: [1280, 720]\n"
    "cam1:\n  camera_model: pinhole\n  intrinsics: [710, 711, 640, 360]\n  distortion_model: radtan\n"
    "  distortion_coeffs: [-0.1, 0.02, 0.0003, -0.0002]\n  resolution: [1280, 720]\n"
    "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.11]\n  - [0.0, 0.0, -1.0, 0.02]\n  - [0.0, 1.0, 0.0, 0.3]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n";

TEST(ImportCellTest, ReadsTheCamerasOfACamchain) {
  const TempFolder folder;
  Write(folder / "bag-camchain.yaml", kChain);
  for (const fs::path& source : {folder.path(), folder / "bag-camchain.yaml"}) {
    const std::optional<ImportedCell> rig = ImportCell(source, "");
    ASSERT_TRUE(rig.has_value()) << source;
    EXPECT_EQ(rig->format, "kalibr");
    ASSERT_EQ(rig->cameras.size(), 2U);
    EXPECT_EQ(rig->cameras[1].name, "cam1");
    EXPECT_EQ(rig->cameras[1].camera->params[0], 710);
    EXPECT_TRUE(rig->captures.empty());
    EXPECT_FALSE(rig->setup.has_value());
    // The inverse of T_cn_cnm1: R = Rx(90 deg), so that -R' t = (0.11, -0.3, 0.02).
    ASSERT_EQ(rig->remarks.size(), 1U);
    EXPECT_THAT(rig->remarks[0], testing::HasSubstr("cam1 in camera cam0 is at [110.000, -300.000, 20.000] mm, "
                                                    "quaternion xyzw [-0.707107, 0.000000, 0.000000, 0.707107]"));
  }
  EXPECT_THAT(InputErrorOf([&] { ImportDataSet(folder.path(), ""); }), testing::HasSubstr("no captures"));
  // A recording of the user's own may have a camchain beside its images.
  Write(folder / "0.png", "x");
  EXPECT_EQ(FindImportFormat(folder.path()), nullptr);
}

TEST(ImportCellTest, SaysWhatIsWrongWithACamchain) {
  const TempFolder folder;
  const auto error_of = [&](const std::string& text) {
    Write(folder / "chain.yaml", text);
    return InputErrorOf([&] { ImportCell(folder / "chain.yaml", "kalibr"); });
  };
  EXPECT_THAT(error_of(With(kChain, "cam1", "cam2")), testing::HasSubstr("where cam1 is expected"));
  EXPECT_THAT(error_of(With(kChain, "T_cn_cnm1", "T_others")), testing::HasSubstr("'T_cn_cnm1' is missing"));
  EXPECT_THAT(error_of(With(kChain, "[1.0, 0.0, 0.0, -0.11]", "[2.0, 0.0, 0.0, -0.11]")),
              testing::HasSubstr("chain.yaml:14: cam1.T_cn_cnm1: the matrix is not a rotation"));
  EXPECT_THAT(error_of("imu0: {}\n"), testing::HasSubstr("no cameras called cam0"));
  EXPECT_THAT(error_of(With(kChain, "700, 701", "-700, 701")), testing::HasSubstr("the camera cam0: fx and fy"));
}

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
