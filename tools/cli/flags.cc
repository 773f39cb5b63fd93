#include "tools/cli/flags.h"

#include <cmath>

#include <gflags/gflags.h>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"

// A description consists of the kind of value that the flag takes, a |, and the help text. Texts for single commands
// follow, each after a | and the command's name and a colon.
DEFINE_string(out, "",
              "PATH|file or folder for the results"
              "|init: the config to write; default: FOLDER/config.yaml"
              "|run: folder for the results; default: runs/NAME beside the config"
              "|compare: folder for the tables and the page; default: they are not written"
              "|detect: folder for the images with the detections; default: detections/NAME beside the config"
              "|target: the sheet, .svg, .pdf or .png; with --suggest, the target, .yaml"
              "|simulate: folder for the data set"
              "|plan: file for the poses; its page, and the joints of an arm, are written beside it; default: "
              "NAME_plan.csv beside the cell or the run"
              "|study: folder for the results; default: studies/NAME beside the study"
              "|import: folder for heba's own files"
              "|export: file for the result, or folder with --to all; default: standard output"
              "|correct: file for the poses");
DEFINE_int32(jobs, 0, "N|number of threads; 0 for one per processor");
DEFINE_bool(quiet, false, "|no progress and no table");
DEFINE_string(shard, "", "I/N|run part I, from 0 to N - 1, of N parts");
DEFINE_string(set, "",
              "KEY=VALUE|overrides the config, such as refine.loss=none; may be given several times"
              "|plan: overrides the cell, such as plan.tilt=30 deg; may be given several times"
              "|simulate: overrides the scene, such as motion.captures=30; may be given several times");
DEFINE_bool(resume, false, "|skip runs that are complete and whose inputs have not changed");
DEFINE_string(fail_on, "", "GRADE|bad or doubtful: a run with this verdict, or a worse one, ends with exit status 1");
DEFINE_bool(strict, false, "|images, rows of poses and an arm that were given and are not used end with exit status 1");
DEFINE_string(to, "", "FORM|urdf, ros1, ros2, opencv, kuka, ...; all writes every format into the folder --out");
DEFINE_string(method, "", "METHOD|method whose estimate is exported; default: the refined one");
DEFINE_string(parent, "", "FRAME|parent frame of the pose; default: base_link (base for Universal Robots) or tool0");
DEFINE_string(child, "", "FRAME|the camera's frame; default: camera_optical_frame, or camera_link with --child-is");
DEFINE_string(child_is, "",
              "FRAME|optical (z forward), body (x forward, same origin), or the optical frame's pose in the child, "
              "x,y,z,qx,qy,qz,qw in m");
DEFINE_bool(force, false,
            "|write the calibrated arm, or poses corrected by it, although the verdict of the run is bad"
            "|init: replace a config that 'heba init' wrote");
DEFINE_bool(inverse, false,
            "|export the pose of the parent in the child"
            "|correct: the poses are those to reach, and those to command are computed");
DEFINE_string(units, "m", "UNIT|length unit of the format matrix: m or mm");
DEFINE_string(pose, "",
              "NUMBERS|the robot pose of the image, as in the run's poses file, separated by commas; of several arms: "
              "ARM=NUMBERS;ARM=NUMBERS");
DEFINE_string(
    joints, "",
    "NUMBERS|the positions of the joints at --pose, as in the run's joints file, separated by commas: needed if "
    "the errors of the arm are estimated and the captures are in several configurations; of several arms: as --pose"
    "|check: with --poses, the file of the joints of the images, as the run's joints file");
DEFINE_string(
    near, "",
    "NUMBERS|approximate pose of the target, base_from_target, as in the run's poses file (x,y,z,qx,qy,qz,qw in m "
    "if that contains joints): decides between the poses of a target with a symmetry, by its position or by its "
    "rotation, one of which may be unknown; of several targets: TARGET=NUMBERS;TARGET=NUMBERS");
DEFINE_string(tool, "",
              "POSE|the tool in the gripper (heba tcp finds its tip): numbers as in the run's poses file, or "
              "'{translation: [0 mm, 0 mm, 120 mm]}'; with --grasp, the gripper's pose that brings it to the grasp");
DEFINE_string(grasp, "", "POSE|where the tool is to come, in the target, in the same forms");
DEFINE_string(arm, "", "NAME|the arm of a rig with several arms whose poses are corrected");
DEFINE_string(robot, "",
              "ARM|arm for which joints that reach the target are computed: ur5e, another of 'heba help config "
              "robot.model', or a .urdf file; of several arms: as --pose");
DEFINE_string(format, "", "FORM|format of the data set: industrial_calibration, easy_handeye2, ...; default: detected");
DEFINE_string(target, "",
              "TARGET.yaml|the target in the images of a folder without a known format"
              "|init: the target in the images, or its keys, such as '{type: chessboard, rows: 6, columns: 9, square: "
              "25 mm}'; default: found"
              "|check: in-place or moved: whether the target is mounted exactly as it was for the calibration");
DEFINE_string(images, "", "PATH|the folder of the images; default: the one with the most images");
DEFINE_string(poses, "",
              "PATH|the file or folder of the robot poses; default: found|check: the robot poses of the images, as in "
              "the run's poses file; of several arms: ARM=FILE;ARM=FILE");
DEFINE_string(camera, "",
              "PATH|the camera file; default: found, or estimated from the captures"
              "|target: the file of the camera that is to see the proposed target");
DEFINE_string(setup, "", "SETUP|eye_to_hand or eye_in_hand; default: by the agreement of images and poses");
DEFINE_string(
    pixels, "",
    "U,V;U,V|pixels to locate instead of the target; without an image if --plane names a plane in the base; "
    "with a rig CAMERA=U,V;CAMERA=U,V, the pixels of one point or, with --plane, of one point each, without images");
DEFINE_string(plane, "target",
              "PLANE|plane of the points: target, or NX,NY,NZ,DISTANCE in the base (in the world of a rig), such as "
              "0,0,1,120 mm");
DEFINE_string(pose_format, "",
              "FORM|format of the poses: ros (the default), ur, kuka, ..., or a mapping as captures.pose_format");
DEFINE_bool(any, false, "|the arguments are images or folders: print which target they show, as a config to paste");
DEFINE_string(reference, "",
              "PATH|in place of the robot's poses, for a camera and a target that stand still: an earlier image of the "
              "target, or a folder of them");
DEFINE_string(history, "", "FOLDER|add the check to the history in this folder, and write its page, history.html");
DEFINE_int32(count, 15, "N|number of poses");
DEFINE_string(procedure, "", "two_step|the motions of the two-step method instead of the best poses");
DEFINE_bool(json, false, "|print one JSON document for programs instead of the text");
DEFINE_double(dpi, 300, "N|resolution of a .png sheet");
DEFINE_string(paper, "", "NAME|paper of the sheet: a4, a3, letter, ...; default: a page as large as the sheet");
DEFINE_bool(suggest, false, "|propose a target for --paper, --distance and --camera, as YAML");
DEFINE_string(target_type, "coded_board", "TYPE|type of the proposed target");
DEFINE_string(distance, "", "LENGTH|distance from the camera to the proposed target, such as '0.6 m'");

namespace heba {

int NumThreads() {
  constexpr int kMostThreads = 4096;
  if (FLAGS_jobs < 0 || FLAGS_jobs > kMostThreads) {
    throw InputError("--jobs needs a number from 0 to " + std::to_string(kMostThreads) + ", not " +
                     std::to_string(FLAGS_jobs));
  }
  return FLAGS_jobs == 0 ? NumProcessors() : FLAGS_jobs;
}

std::vector<std::string> Settings() {
  return FLAGS_set.empty() ? std::vector<std::string>() : Split(FLAGS_set, kSettingSeparator);
}

std::optional<Grade> FailOn() {
  if (FLAGS_fail_on.empty()) return std::nullopt;
  for (const Grade grade : {Grade::kDoubtful, Grade::kBad}) {
    if (FLAGS_fail_on == GradeName(grade)) return grade;
  }
  throw InputError("--fail-on: " + UnknownName(FLAGS_fail_on, {"bad", "doubtful"}));
}

Shard ParseShard() {
  if (FLAGS_shard.empty()) return {};
  const size_t slash = FLAGS_shard.find('/');
  double index = 0;
  double count = 0;
  const bool is_number = slash != std::string::npos && ParseDouble(FLAGS_shard.substr(0, slash), &index) &&
                         ParseDouble(FLAGS_shard.substr(slash + 1), &count);
  const bool is_whole = index == std::floor(index) && count == std::floor(count) && count <= 1e6;
  if (!is_number || !is_whole || count < 1 || index < 0 || index >= count) {
    throw InputError("--shard needs I/N with I from 0 to N - 1, not '" + FLAGS_shard + "'");
  }
  return {static_cast<int>(index), static_cast<int>(count)};
}

}  // namespace heba
