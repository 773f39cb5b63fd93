// Tests of what the readers of other projects' data sets conclude from the files: format, setup, direction and units of
// the poses, target, and which images belong to which poses.
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/io/import.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// A translation by 1, 2, 3 without rotation, as a row and as a matrix.
constexpr const char* kMatrix = "1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n";
Rigid3d Shift(double x, double y, double z) { return {Eigen::Quaterniond::Identity(), {x, y, z}}; }

class ImportGuessesTest : public testing::Test {
 protected:
  fs::path Write(const std::string& name, const std::string& text = "x") const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  ImportedSet Import(const std::string& name = "") const { return ImportDataSet(folder_ / name, ""); }

  TempFolder folder_;
};

struct Recognised {
  std::string name;
  std::string text;
  std::string format;  // Empty if no format recognises the text.
};

class RecognisedFileTest : public ImportGuessesTest, public testing::WithParamInterface<Recognised> {};

TEST_P(RecognisedFileTest, IsRecognisedByItsBeginning) {
  const ImportFormat* format = FindImportFormat(Write("file", GetParam().text));
  EXPECT_EQ(format == nullptr ? "" : format->name, GetParam().format);
}

INSTANTIATE_TEST_SUITE_P(
    , RecognisedFileTest,
    testing::Values(Recognised{"EightNumbers", "# time x y z qx qy qz qw\n1 0 0 0 0 0 0 1\n", "tum"},
                    Recognised{"SixteenNumbers", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n", "matrices"},
                    Recognised{"FourNumbers", kMatrix, "matrices"}, Recognised{"SevenNumbers", "0 0 0 0 0 0 1\n", ""},
                    Recognised{"ListOfPairsOfMatrices", "  [[[[1, 0, 0, 1], [0, 1, 0, 2]", "moveit_calibration"},
                    Recognised{"ListOfMatrices", "[[[1, 0, 0, 1], [0, 1, 0, 2]", ""},
                    Recognised{"HandAndEye", "hand,1,2,3,0,0,0\neye,1,2,3,0,0,0\n", "fishros"},
                    Recognised{"HandAlone", "hand,1,2,3,0,0,0\nhand,1,2,3,0,0,0\n", ""},
                    Recognised{"Samples", "samples:\n- robot: {}\n  tracking: {}\n", "easy_handeye2"},
                    Recognised{"SamplesWithoutTracking", "samples:\n- robot: {}\n", ""},
                    Recognised{"Corners", "# filename x y level\n", "mrcal_corners"},
                    Recognised{"Prose", "notes on the recording\n", ""}),
    [](const auto& recognised) { return recognised.param.name; });

TEST_F(ImportGuessesTest, EasyHandeyePosesAreInvertedForAFixedCamera) {
  const auto import = [&](const std::string& type) {
    const std::string pose = "{translation: {x: 1, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}";
    Write("a.samples",
          "parameters: {calibration_type: " + type + "}\nsamples:\n- {robot: " + pose + ", tracking: " + pose + "}\n");
    return Import("a.samples");
  };
  const ImportedSet carried = import("eye_in_hand");
  EXPECT_EQ(carried.setup, Setup::kEyeInHand);
  EXPECT_THAT(*carried.captures.at(0).base_from_gripper, IsNearPose(Shift(1, 2, 3), 1e-9, 1e-12));
  const ImportedSet fixed = import("eye_on_base");
  EXPECT_EQ(fixed.setup, Setup::kEyeToHand);
  EXPECT_THAT(*fixed.captures.at(0).base_from_gripper, IsNearPose(Shift(-1, -2, -3), 1e-9, 1e-12));
  // The direction of the target's pose does not depend on the setup.
  EXPECT_THAT(*fixed.captures.at(0).camera_from_target, IsNearPose(Shift(1, 2, 3), 1e-9, 1e-12));
  EXPECT_THAT(InputErrorOf([&] { import("eye_on_hand"); }), HasSubstr("'eye_on_hand' is unknown"));
}

TEST_F(ImportGuessesTest, MchecNumbersTheSetups) {
  Write("camera1/image/0.png");
  Write("camera1/pose/0.csv", kMatrix);
  const auto setup_of = [&](const std::string& number) {
    Write("CalibrationInfo.yaml",
          "{calibration_setup: " + number + ", number_of_rows: 4, number_of_columns: 3, size: 0.05}\n");
    return Import().setup;
  };
  EXPECT_EQ(setup_of("0"), Setup::kEyeInHand);
  EXPECT_EQ(setup_of("1"), Setup::kEyeToHand);
  EXPECT_THAT(InputErrorOf([&] { setup_of("2"); }), HasSubstr("calibration_setup: 2 is out of range"));
}

TEST_F(ImportGuessesTest, MchecReadsTheFirstOfSeveralCamerasAndSaysSo) {
  Write("CalibrationInfo.yaml",
        "{calibration_setup: 1, number_of_cameras: 2, number_of_rows: 4, number_of_columns: 3, size: 0.05}\n");
  for (const char* camera : {"camera1", "camera2"}) {
    Write(std::string(camera) + "/image/" + camera + ".png");
    Write(std::string(camera) + "/pose/" + camera + ".csv", kMatrix);
  }
  const ImportedSet whole = Import();
  EXPECT_EQ(whole.captures.at(0).name, "camera1.png");
  EXPECT_THAT(whole.remarks, ElementsAre(HasSubstr("of 2 cameras the first one is read")));
  const ImportedSet second = Import("camera2");
  EXPECT_EQ(second.captures.at(0).name, "camera2.png");
  EXPECT_THAT(second.remarks, IsEmpty());
}

TEST_F(ImportGuessesTest, MchecLensesWithoutHigherTermsAreBrown5) {
  Write("CalibrationInfo.yaml", "{calibration_setup: 1, number_of_rows: 4, number_of_columns: 3, size: 0.05}\n");
  Write("camera1/image/0.png");
  Write("camera1/pose/0.csv", kMatrix);
  const auto model_of = [&](const std::string& distortion) {
    Write("camera1/intrinsic_pars_file.yaml",
          "{fx: 600, fy: 600, cx: 320, cy: 240, img_width: 640, img_height: 480" + distortion + "}\n");
    return Import().camera->model;
  };
  EXPECT_EQ(model_of(""), "pinhole");
  EXPECT_EQ(model_of(", has_dist_coeff: 1, dist_k0: 0.1"), "brown5");
  EXPECT_EQ(model_of(", has_dist_coeff: 1, dist_k0: 0.1, dist_k3: 0.01"), "rational8");
}

TEST_F(ImportGuessesTest, IndustrialCalibrationNamesTheSetupAndTheTarget) {
  Write("cal_data.yaml", "data:\n- {image: a.png, pose: a.yaml}\n");
  Write("a.yaml", "{x: 1, y: 2, z: 3, qx: 0, qy: 0, qz: 0, qw: 1}\n");
  EXPECT_FALSE(Import().setup.has_value());
  EXPECT_EQ(Import().target, "");
  Write(
      "config.yaml",
      "static_camera: false\ntarget_finder: {type: ModifiedCircleGridTargetFinder, rows: 4, cols: 5, spacing: 0.02}\n");
  EXPECT_EQ(Import().setup, Setup::kEyeInHand);
  EXPECT_EQ(Import().target, "type: circle_grid\nrows: 4\ncolumns: 5\nspacing: 0.02 m\nmarker_dot: true\n");
  Write("config.yaml", "static_camera: true\ntarget_finder: {type: ArucoFinder, rows: 4, cols: 5}\n");
  EXPECT_EQ(Import().setup, Setup::kEyeToHand);
  EXPECT_EQ(Import().target, "");
  EXPECT_THAT(Import().remarks,
              ElementsAre("the target, 'ArucoFinder', is not supported; name a target in the config"));
}

TEST_F(ImportGuessesTest, IndustrialCalibrationNumbersTheDictionariesAsOpenCvDoes) {
  Write("cal_data.yaml", "data:\n- {image: a.png, pose: a.yaml}\n");
  Write("a.yaml", "{x: 1, y: 2, z: 3, qx: 0, qy: 0, qz: 0, qw: 1}\n");
  const auto target_of = [&](const std::string& number) {
    Write("config.yaml",
          "target_finder: {type: CharucoGridTargetFinder, rows: 7, cols: 5, chessboard_dim: 0.036, aruco_marker_dim: "
          "0.018, dictionary: " +
              number + "}\n");
    return Import().target;
  };
  EXPECT_THAT(target_of("0"), HasSubstr("dictionary: DICT_4X4_50\n"));
  EXPECT_THAT(target_of("7"), HasSubstr("dictionary: DICT_5X5_1000\n"));
  EXPECT_THAT(target_of("10"), HasSubstr("dictionary: DICT_6X6_250\n"));
  EXPECT_THAT(target_of("15"), HasSubstr("dictionary: DICT_7X7_1000\n"));
  EXPECT_THAT(target_of("16"), HasSubstr("dictionary: DICT_ARUCO_ORIGINAL\n"));
  EXPECT_THAT(InputErrorOf([&] { target_of("17"); }), HasSubstr("dictionary: 17 is out of range"));
}

TEST_F(ImportGuessesTest, TabbPosesAreInverseAndInMillimetres) {
  Write("robot_cali.txt", std::string("1\n") + kMatrix);
  const ImportedSet set = Import();
  EXPECT_EQ(set.setup, Setup::kEyeInHand);
  EXPECT_THAT(*set.captures.at(0).base_from_gripper, IsNearPose(Shift(-1e-3, -2e-3, -3e-3), 1e-9, 1e-12));
}

TEST_F(ImportGuessesTest, TabbTargetsAreChessboardsOfSquares) {
  Write("robot_cali.txt", std::string("1\n") + kMatrix);
  Write("calibration_object.txt", "chess_mm_height 15.8\nchess_mm_width 15.8\nchess_height 6\nchess_width 8\n");
  EXPECT_EQ(Import().target, "type: chessboard\nrows: 6\ncolumns: 8\nsquare: 0.0158 m\n");
  Write("calibration_object.txt", "chess_mm_height 15.8\nchess_mm_width 16\nchess_height 6\nchess_width 8\n");
  EXPECT_THAT(InputErrorOf([&] { Import(); }), HasSubstr("a chessboard of squares is needed"));
  Write("calibration_object.txt", "tile size: 28.5 mm\n");
  EXPECT_EQ(Import().target, "");
  EXPECT_THAT(Import().remarks, ElementsAre(HasSubstr("states 'tile size: 28.5 mm'")));
}

// The images are those of the first camera, of the folder images, or beside the poses.
TEST_F(ImportGuessesTest, TabbImagesAreFoundInThreePlaces) {
  Write("robot_cali.txt", std::string("1\n") + kMatrix);
  Write("beside.png");
  EXPECT_EQ(Import().captures.at(0).name, "beside.png");
  Write("images/inside.png");
  EXPECT_EQ(Import().captures.at(0).name, "inside.png");
  Write("images/camera0/first.png");
  EXPECT_EQ(Import().captures.at(0).name, "first.png");
  Write("images/camera0/second.png");
  EXPECT_THAT(InputErrorOf([&] { Import(); }), HasSubstr("has 1 poses for 2 images"));
}

TEST_F(ImportGuessesTest, TrajectoriesTakeImagesOnlyIfTheCountsAgree) {
  Write("poses.txt", "1 1 2 3 0 0 0 1\n2 1 2 3 0 0 0 1\n");
  EXPECT_EQ(Import("poses.txt").captures.at(1).name, "pose_1");
  Write("rgb/a.png");
  Write("rgb/b.png");
  EXPECT_EQ(Import("poses.txt").captures.at(1).name, "b.png");
  Write("rgb/c.png");
  const ImportedSet set = Import("poses.txt");
  EXPECT_TRUE(set.captures.at(1).image.empty());
  EXPECT_THAT(set.remarks, ElementsAre(HasSubstr("3 images are beside the 2 poses")));
}

TEST_F(ImportGuessesTest, MatricesMayBeOneOrFourLinesEach) {
  Write("lines.txt", std::string(kMatrix) + "\n" + kMatrix);
  EXPECT_THAT(Import("lines.txt").captures, SizeIs(2));
  Write("rows.txt", "1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n1 0 0 4 0 1 0 5 0 0 1 6 0 0 0 1\n");
  const ImportedSet set = Import("rows.txt");
  ASSERT_THAT(set.captures, SizeIs(2));
  EXPECT_THAT(*set.captures[1].base_from_gripper, IsNearPose(Shift(4, 5, 6), 1e-9, 1e-12));
  Write("odd.txt", std::string(kMatrix) + "1 0 0 1\n");
  EXPECT_THAT(InputErrorOf([&] { Import("odd.txt"); }),
              HasSubstr("20 numbers are not a whole number of 4 x 4 matrices"));
}

TEST_F(ImportGuessesTest, ZividPosesAreInMillimetresAndPairedByNumber) {
  for (const char* number : {"2", "10"}) {
    Write(std::string("pos") + number + ".yaml",
          "%YAML:1.0\n---\nPoseState: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [ 1., 0., 0., 100., "
          "0., 1., 0., 200., 0., 0., 1., 300., 0., 0., 0., 1. ]\n");
  }
  Write("img02.png");
  Write("img3.png");
  const ImportedSet set = Import();
  ASSERT_THAT(set.captures, SizeIs(2));
  EXPECT_EQ(set.captures[0].name, "img02.png");
  EXPECT_EQ(set.captures[1].name, "pose_10");
  EXPECT_THAT(*set.captures[0].base_from_gripper, IsNearPose(Shift(0.1, 0.2, 0.3), 1e-9, 1e-12));
}

TEST_F(ImportGuessesTest, VispNamesShareTheirFirstWord) {
  const std::string pose = "{rows: 6, cols: 1, data: [[1], [2], [3], [0], [0], [0]]}\n";
  Write("b_pose_rPe_1.yaml", pose);
  Write("b_pose_cPo_1.yaml", pose);
  EXPECT_TRUE(Import().captures.at(0).camera_from_target.has_value());
  // The first word in alphabetical order is used, with its files only.
  Write("a_pose_rPe_1.yaml", pose);
  Write("a_image-1.png");
  const ImportedSet set = Import();
  ASSERT_THAT(set.captures, SizeIs(1));
  EXPECT_EQ(set.captures[0].name, "a_image-1.png");
  EXPECT_FALSE(set.captures[0].camera_from_target.has_value());
}

TEST_F(ImportGuessesTest, TwoCapturesOfOneNameAreRefused) {
  Write("cal_data.yaml", "data:\n- {image: left/a.png, pose: a.yaml}\n- {image: right/a.png, pose: a.yaml}\n");
  Write("a.yaml", "{x: 1, y: 2, z: 3, qx: 0, qy: 0, qz: 0, qw: 1}\n");
  EXPECT_THAT(InputErrorOf([&] { Import(); }), HasSubstr("two captures have the name 'a.png'"));
}

TEST_F(ImportGuessesTest, AnUnknownFormatIsNamed) {
  Write("poses.txt", "1 1 2 3 0 0 0 1\n");
  EXPECT_THAT(InputErrorOf([&] { ImportDataSet(folder_ / "poses.txt", "tumm"); }),
              HasSubstr("the format 'tumm' is unknown; did you mean 'tum'? One of: "));
}

}  // namespace
}  // namespace heba
