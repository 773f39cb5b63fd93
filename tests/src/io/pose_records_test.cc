#include "heba/io/pose_records.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/error.h"
#include "heba/io/pose_source.h"
#include "heba/io/pose_syntax.h"
#include "heba/io/record_tree.h"
#include "tests/support/data_sets.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class PoseRecordsTest : public testing::Test {
 protected:
  fs::path Write(const std::string& name, const std::string& text) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }
  TempFolder folder_;
};

// The archive that numpy.savez_compressed(poses=numpy.arange(6.).reshape(1, 6)) writes, as hexadecimal digits.
constexpr const char* kCompressedArchive =
    "504b030414000000080000002100f00f1b7557000000b000000009001400706f7365732e6e707901001000b000000000000000570000"
    "00000000009bec17ea1b10c9c850c650ad9e925a9c5ca46ea5a06e9366a1aea3a09e965f54529498179f5f94920a12774bcc294e058a"
    "17672416a402f91a863a0a669a3a0ab50a64032e0614f0c11eca7080501c505a004a8b380000504b0102140314000000080000002100"
    "f00f1b7557000000b0000000090000000000000000000000800100000000706f7365732e6e7079504b05060000000001000100370000"
    "00920000000000";

TEST_F(PoseRecordsTest, ReadsCompressedArchives) {
  std::string bytes;
  const std::string digits = kCompressedArchive;
  for (size_t i = 0; i < digits.size(); i += 2) {
    bytes.push_back(static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  }
  const std::optional<RecordTree> tree = ReadRecordTree(Write("poses.npz", bytes));
  ASSERT_TRUE(tree.has_value());
  EXPECT_EQ((*tree)["poses"].dump(), "[[0.0,1.0,2.0,3.0,4.0,5.0]]");
  // A spoiled byte of the compressed data is a fault with the array's name, and so is an end that is missing.
  std::string spoiled = bytes;
  spoiled[70] = static_cast<char>(spoiled[70] ^ 0x7f);
  const auto error_of = [&](const std::string& archive) {
    return InputErrorOf([&] { ReadRecordTree(Write("spoiled.npz", archive)); });
  };
  EXPECT_THAT(error_of(spoiled), HasSubstr("spoiled.npz: is spoiled: the checksum of the array 'poses' differs"));
  EXPECT_THAT(error_of(bytes.substr(0, 80)), HasSubstr("is truncated"));
}

// A text in a program's syntax that holds the pose x, y, z = 1, 2, 3 with the rotation 4, 5, 6, and a quaternion with
// the numbers .5, .5, .5, .5.
struct Program {
  const char* name;
  const char* pose_format;
  const char* text;
};

class SyntaxTest : public testing::TestWithParam<Program> {};

TEST_P(SyntaxTest, IsReadWithItsLines) {
  const std::string pose = GetParam().text;
  const WrittenPoses written = FindWrittenPoses("a heading\n" + pose + "\n" + pose + "\n");
  EXPECT_EQ(written.pose_format, GetParam().pose_format);
  ASSERT_THAT(written.rows, SizeIs(2));
  EXPECT_THAT(written.lines, SizeIs(2));
  EXPECT_GE(written.lines[0], 2);
  EXPECT_EQ(written.rows[0], written.rows[1]);
  if (written.rows[0].size() == 6) {
    EXPECT_THAT(written.rows[0], ElementsAre(1, 2, 3, 4, 5, 6));
  } else {
    EXPECT_THAT(written.rows[0], ElementsAre(1, 2, 3, 0.5, 0.5, 0.5, 0.5));
  }
  EXPECT_EQ(written.broken_line, 0);
}

INSTANTIATE_TEST_SUITE_P(
    , SyntaxTest,
    testing::Values(
        Program{"Rapid", "abb", "CONST robtarget p:=[[1,2,3],[0.5,0.5,0.5,0.5],[0,0,-1,0],[9E+09,9E+09]];"},
        Program{"RapidMove", "abb", "MoveL [[1, 2, 3], [.5, .5, .5, .5], [0,0,0,0], [9E9]], v100, fine, tool0;"},
        Program{"Krl", "kuka", "DECL E6POS XP1={X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 35,E1 0.0}"},
        Program{
            "Tp", "fanuc",
            "P[1]{\n GP1:\n UF : 0, UT : 1,\n X = 1.0 mm, Y = 2 mm, Z = 3 mm,\n W = 4 deg, P = 5 deg, R = 6 deg\n};"},
        Program{"UrScript", "ur", "movel(p[1, 2, 3, 4, 5, 6], a=1.2, v=0.25)"},
        Program{"Drl", "doosan", "movel(posx(1, 2, 3, 4, 5, 6), v=30, a=60)"},
        Program{"Jbi", "yaskawa", "///RECTAN\nC00001=1.000,2.000,3.000,4.0000,5.0000,6.0000"},
        Program{"Val3", "staubli",
                "<Value key=\"0\" x=\"1\" y=\"2\" z=\"3\" rx=\"4\" ry=\"5\" rz=\"6\" shoulder=\"lefty\" />"},
        Program{"Techman", "techman", "Point[\"P1\"].Value = {1, 2, 3, 4, 5, 6}"},
        Program{"TmScript", "techman", "PTP(\"CPP\",1,2,3,4,5,6,10,200,0,false)"},
        Program{"Kawasaki", "kawasaki", "LMOVE TRANS(1, 2, 3, 4, 5, 6)"},
        Program{"TfEcho", "ros",
                "- Translation: [1, 2, 3]\n- Rotation: in Quaternion [.5, .5, .5, .5]\n  in RPY (radian) [0, 1, 2]"},
        Program{"Tf2Echo", "ros", "- Translation: [1, 2, 3]\n- Rotation: in Quaternion (xyzw) [.5, .5, .5, .5]"},
        Program{"RosMessage", "ros",
                "Pose(position=geometry_msgs.msg.Point(x=1.0, y=2.0, z=3.0), "
                "orientation=geometry_msgs.msg.Quaternion(x=0.5, y=0.5, z=0.5, w=0.5))"}),
    [](const auto& program) { return program.param.name; });

// A number that is misspelt is a fault of its line, not a pose less.
TEST_F(PoseRecordsTest, APoseThatBreaksOffIsAFault) {
  const fs::path file =
      Write("a.script", "p[1, 2, 3, 4, 5, 6]\np[1, 2, 3, 4, 5, 6]\np[1, 2, 3, 4, 5, 7]\np[1, 2, O, 4, 5, 6]\n");
  EXPECT_THAT(InputErrorOf([&] { FindPoseRecords(file); }), HasSubstr("a.script:4: the pose breaks off"));
}

// Another kind of point with as many numbers at its beginning is none.
TEST_F(PoseRecordsTest, AJointTargetIsNoPose) {
  const std::string pose = "CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,-1,0],[9E+09]];\n";
  const fs::path file = Write("a.mod", pose + "CONST jointtarget j:=[[0,0,0,0,30,0],[9E+09]];\n" + pose + pose);
  EXPECT_THAT(FindPoseRecords(file).at(0).rows, SizeIs(3));
}

constexpr const char* kMatrix = "[[0,-1,0,0.1],[1,0,0,0.2],[0,0,1,0.3],[0,0,0,1]]";

TEST_F(PoseRecordsTest, FindsPosesAtAnyDepthWithTheirImages) {
  std::string records;
  for (const char* const name : {"a.png", "b.png", "c.png"}) {
    records += std::string(records.empty() ? "" : ",") + "{\"image\": \"img/" + name +
               "\", \"robot\": {\"H\": " + kMatrix +
               ", \"joints\": [0,1,2,3,4,5]}, \"board\": {\"position\": {\"x\": 1, \"y\": 2, \"z\": 3}, "
               "\"orientation\": {\"w\": 0.5, \"x\": 0.5, \"y\": 0.5, \"z\": -0.5}}}";
  }
  const std::vector<PoseRecords> places =
      FindPoseRecords(Write("a.json", "{\"session\": {\"records\": [" + records + "]}}"));
  ASSERT_THAT(places, SizeIs(3));  // Six joints look like a pose; the images decide.
  EXPECT_EQ(places[0].paths.pose, "session.records[].robot.H");
  EXPECT_EQ(places[0].paths.image, "session.records[].image");
  EXPECT_THAT(places[0].images, ElementsAre("a.png", "b.png", "c.png"));
  EXPECT_THAT(places[0].rows, SizeIs(3));
  EXPECT_EQ(places[2].paths.pose, "session.records[].board");
  EXPECT_THAT(places[2].columns, ElementsAre("x", "y", "z", "qx", "qy", "qz", "qw"));
  EXPECT_THAT(places[2].rows[0], ElementsAre(1, 2, 3, 0.5, 0.5, -0.5, 0.5));
}

struct Value {
  const char* name;
  const char* text;
  size_t num_numbers;  // 0: it is no pose.
};

class ValueTest : public PoseRecordsTest, public testing::WithParamInterface<Value> {};

TEST_P(ValueTest, IsRecognisedByItsShape) {
  const std::string value = GetParam().text;
  const std::vector<PoseRecords> places =
      FindPoseRecords(Write("a.json", "[{\"v\":" + value + "},{\"v\":" + value + "},{\"v\":" + value + "}]"));
  if (GetParam().num_numbers == 0) {
    EXPECT_THAT(places, IsEmpty());
    return;
  }
  ASSERT_THAT(places, SizeIs(1));
  EXPECT_EQ(places[0].paths.pose, "[].v");
  EXPECT_THAT(places[0].rows.at(0), SizeIs(GetParam().num_numbers));
}

INSTANTIATE_TEST_SUITE_P(
    , ValueTest,
    testing::Values(Value{"Matrix", "[[0,-1,0,0.1],[1,0,0,0.2],[0,0,1,0.3],[0,0,0,1]]", 16},
                    Value{"UpperRows", "[[0,-1,0,0.1],[1,0,0,0.2],[0,0,1,0.3]]", 16},
                    Value{"ByColumns", "[0,1,0,0,-1,0,0,0,0,0,1,0,0.1,0.2,0.3,1]", 16},
                    Value{"NoRotation", "[1,2,3,4,5,6,7,8,9,10,11,12,0,0,0,1]", 0},
                    Value{"Quaternion", "[1,2,3,0,0,0,1]", 7}, Value{"Angles", "[1,2,3,10,20,30]", 6},
                    Value{"Pair", "[[1,2,3],[0,0,0,1]]", 7},
                    Value{"RotationAndPlace", "{\"R\":[[0,-1,0],[1,0,0],[0,0,1]],\"t\":[1,2,3]}", 12},
                    Value{"Vectors", "{\"rvec\":[0,0,1],\"tvec\":[[1],[2],[3]]}", 6},
                    Value{"Named", "{\"x\":1,\"y\":2,\"z\":3,\"roll\":4,\"pitch\":5,\"yaw\":6}", 6},
                    Value{"Joints", "[0,1,2,3,4]", 0}, Value{"Text", "\"1 2 3 4 5 6\"", 0}),
    [](const auto& value) { return value.param.name; });

TEST_F(PoseRecordsTest, AMatrixByColumnsIsTurned) {
  const std::string value = "[0,1,0,0,-1,0,0,0,0,0,1,0,0.1,0.2,0.3,1]";
  const std::vector<PoseRecords> places =
      FindPoseRecords(Write("a.json", "[" + value + "," + value + "," + value + "]"));
  ASSERT_THAT(places, SizeIs(1));
  EXPECT_THAT(places[0].rows[0], ElementsAre(0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1));
}

TEST_F(PoseRecordsTest, KeysMayNameTheImages) {
  const std::vector<PoseRecords> places =
      FindPoseRecords(Write("a.yaml", "a.png: [1,2,3,0,0,0,1]\nb.png: [1,2,4,0,0,0,1]\nc.png: [1,2,5,0,0,0,1]\n"));
  ASSERT_THAT(places, SizeIs(1));
  EXPECT_EQ(places[0].paths.pose, "*");
  EXPECT_THAT(places[0].images, ElementsAre("a.png", "b.png", "c.png"));
}

TEST_F(PoseRecordsTest, ReadsDocumentsOfTopics) {
  std::string text;
  for (int i = 0; i < 3; ++i) {
    text += "header:\n  seq: " + std::to_string(i) + "\npose:\n  position:\n    x: 1.0\n    y: 2.0\n    z: 3.0\n" +
            "  orientation:\n    x: 0.0\n    y: 0.0\n    z: 0.0\n    w: 1.0\n---\n";
  }
  const std::vector<PoseRecords> places = FindPoseRecords(Write("topic.yaml", text));
  ASSERT_THAT(places, SizeIs(1));
  EXPECT_EQ(places[0].paths.pose, "[].pose");
  EXPECT_THAT(places[0].rows[2], ElementsAre(1, 2, 3, 0, 0, 0, 1));
}

TEST_F(PoseRecordsTest, ReadsWhatNumPyPrints) {
  const std::string printed = "[[ 0. -1.  0.  0.1]\n [ 1.  0.  0.  0.2]\n [ 0.  0.  1.  0.3]\n [ 0.  0.  0.  1. ]]\n";
  EXPECT_THAT(FindPoseRecords(Write("a.txt", printed + printed + printed)).at(0).rows, SizeIs(3));
  const std::string repr = std::string("array(") + kMatrix + ", dtype=float32)\n";
  EXPECT_THAT(FindPoseRecords(Write("b.txt", repr + repr + repr)).at(0).rows, SizeIs(3));
  const std::string lines = "0 -1 0 .1\n1 0 0 .2\n0 0 1 .3\n0 0 0 1\n\n";
  EXPECT_THAT(FindPoseRecords(Write("c.txt", lines + lines + lines)).at(0).rows, SizeIs(3));
}

TEST_F(PoseRecordsTest, ReadsXml) {
  std::string poses;
  for (int i = 0; i < 3; ++i) {
    poses += "<pose image=\"" + std::to_string(i) +
             ".png\"><position x=\"1\" y='2' z=\"3\"/><!-- a > b -->"
             "<orientation>0 0 0 1</orientation></pose>";
  }
  const std::vector<PoseRecords> places =
      FindPoseRecords(Write("a.xml", "<?xml version=\"1.0\"?><log>" + poses + "</log>"));
  ASSERT_THAT(places, SizeIs(1));
  EXPECT_EQ(places[0].paths.pose, "log.pose[]");
  EXPECT_THAT(places[0].images, ElementsAre("0.png", "1.png", "2.png"));
  EXPECT_THAT(InputErrorOf([&] { ReadRecordTree(Write("b.xml", "<a>\n<b></a>")); }),
              HasSubstr("b.xml:2: not valid XML"));
}

TEST_F(PoseRecordsTest, AFolderOfRecordsIsReadByTheirPath) {
  for (int i = 0; i < 4; ++i) {
    Write("poses/" + std::to_string(i) + ".json", std::string("{\"stamp\": 12.5, \"gripper\": {\"H\": ") + kMatrix +
                                                      "}, \"camera\": {\"H\": " + kMatrix + "}}");
  }
  const std::vector<PoseRow> rows = ReadPoses(folder_ / "poses", *FindPoseFormat("matrix"), {}, {"gripper.H", ""});
  ASSERT_THAT(rows, SizeIs(4));
  EXPECT_EQ(rows[3].image, "3");
  EXPECT_EQ(rows[3].pose.translation, Eigen::Vector3d(0.1, 0.2, 0.3));
  // Without the path, there is a choice.
  EXPECT_THAT(InputErrorOf([&] {
                ReadPoses(folder_ / "poses", *FindPoseFormat("matrix"), {}, {"tool.H", ""});
              }),
              HasSubstr("there are no poses at 'tool.H'; poses are at gripper.H (16 numbers), camera.H (16 numbers)"));
}

// Every kind of record that is at hand: all of its poses are found.
TEST(RecordedPosesTest, AllAreFound) {
  const fs::path records = DataDir() / "cases" / "records";
  if (!fs::exists(records)) GTEST_SKIP() << "no recorded data in " << DataDir();
  for (const fs::directory_entry& entry : fs::directory_iterator(records)) {
    // Tables are read as such.
    if (entry.path().extension() == ".csv" || entry.path().filename() == "kitti.txt") continue;
    const std::vector<PoseRecords> places = FindPoseRecords(entry.path());
    ASSERT_FALSE(places.empty()) << entry.path();
    EXPECT_GE(places.front().rows.size(), 10u) << entry.path();
  }
}

}  // namespace
}  // namespace heba
