#include <algorithm>
#include <iostream>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/capture_section.h"
#include "tools/files/check_file.h"
#include "tools/pages/check_history.h"
#include "tools/pipeline/session.h"
#include "tools/text/check_text.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

// Returns the images of the arguments: paths or, of several cameras, CAMERA=PATH.
std::vector<SessionImage> ImagesOf(const Problem& rig, const std::vector<std::string>& arguments) {
  std::vector<SessionImage> images;
  std::vector<std::string> names;
  for (const ProblemCamera& camera : rig.cameras) names.push_back(camera.name);
  for (const std::string& text : arguments) {
    const auto [camera, path] = NamedValue("an image", text, names, "CAMERA=IMAGE");
    images.push_back({camera, path});
  }
  return images;
}

std::vector<GivenArmPose> PosesOfFlags(const FinishedRun& run, const std::vector<SessionImage>& images) {
  if (FLAGS_poses.empty() == FLAGS_pose.empty()) {
    throw InputError("the robot's poses at the images are needed: --poses FILE, or --pose NUMBERS for one image");
  }
  const RobotSummary* const arm = FLAGS_joints.empty() ? nullptr : FindEstimatedArm(run.result, 0);
  if (!FLAGS_joints.empty() && arm == nullptr) {
    throw InputError("--joints: the run has not estimated the errors of an arm; leave them out");
  }
  if (!FLAGS_poses.empty()) {
    std::vector<GivenArmPose> poses = PosesOfImages(run, FLAGS_poses, images);
    if (arm != nullptr) SetJoints(run, *arm, images, FLAGS_joints, &poses);
    return poses;
  }
  if (images.size() != 1) throw InputError("--pose: is the pose of one image; of several, --poses FILE is needed");
  const PoseReading& reading = run.pose_readings.front();
  GivenArmPose pose;
  pose.base_from_gripper = BaseFromGripper(reading, PoseOfFlag("pose", FLAGS_pose, reading.format));
  if (arm != nullptr) pose.joints = JointsOfFlag("joints", FLAGS_joints, arm->nominal, run.joints_are_deg.front());
  return {pose};
}

// Returns whether the target is where it was for the calibration, which must be said.
bool IsTargetInPlace() {
  const std::vector<std::string> choices = {"in-place", "moved"};
  if (FLAGS_target.empty()) {
    throw InputError(
        "--target in-place or moved is needed: whether the target is mounted exactly as it was for the calibration; a "
        "wrong answer looks like a move of the camera");
  }
  if (std::find(choices.begin(), choices.end(), FLAGS_target) == choices.end()) {
    throw InputError("--target: " + UnknownName(FLAGS_target, choices));
  }
  return FLAGS_target == choices.front();
}

int Undecided(const std::string& reason) {
  if (FLAGS_json) std::cout << UndecidedToJson(reason) << std::flush;
  PrintError("undecided: " + reason);
  return kWorkFailed;
}

}  // namespace

int RunCommand_check(const std::vector<std::string>& arguments) {
  const std::vector<std::string> paths(arguments.begin() + 1, arguments.end());
  const bool is_in_place = IsTargetInPlace();
  const FinishedRun run = ReadFinishedRun(arguments[0]);
  const std::vector<SessionImage> images = ImagesOf(run.result.rig, paths);
  const Session session = ReadSession(run, images, PosesOfFlags(run, images), NumThreads());
  for (const std::string& note : session.notes) std::cerr << "heba: warning: " << note << std::endl;
  const Problem& rig = session.problem;
  const Outcome<SessionCheck> check = CheckSession(rig, run.result.solution, SessionOptionsOf(run, is_in_place));
  if (!check && check.failure().code == "hidden_point") {
    return Undecided(
        "the robot's poses put the target out of the camera's view: they belong to other images, or are in other units "
        "than those of the calibration");
  }
  if (!check) return Undecided(FailureText(check.failure()));
  if (!FLAGS_history.empty()) AddToHistory(FLAGS_history, run.result.name, rig, *check);
  std::cout << (FLAGS_json ? CheckToJson(rig, *check) : ForTerminal(CheckText(rig, *check))) << std::flush;
  if (DecisionOf(*check) == "holds") return kDone;
  PrintError("the calibration does not hold any more: " + ChangeText(rig, *check));
  return kWorkFailed;
}

}  // namespace heba
