#include <algorithm>
#include <iostream>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/capture_section.h"
#include "tools/files/check_file.h"
#include "tools/pages/check_history.h"
#include "tools/pipeline/checked_session.h"
#include "tools/pipeline/session.h"
#include "tools/text/check_text.h"
#include "tools/text/console.h"

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

// Returns the poses of all arms at each image.
std::vector<ArmsAtImage> PosesOfFlags(const FinishedRun& run, const std::vector<SessionImage>& images) {
  const std::vector<std::string>& robots = run.result.rig.robots;
  if (FLAGS_poses.empty() == FLAGS_pose.empty()) {
    throw InputError(
        "the robot's poses at the images are needed: --poses FILE, or --pose NUMBERS for one image; without a robot, "
        "--reference PATH, an earlier image of the same target");
  }
  const bool has_files = !FLAGS_poses.empty();
  if (!has_files && images.size() != 1) {
    throw InputError("--pose: is the pose of one image; of several, --poses FILE is needed");
  }
  const std::vector<std::string> poses = has_files ? ValuesByArm("--poses", FLAGS_poses, robots, "ARM=FILE")
                                                   : ValuesByArm("--pose", FLAGS_pose, robots, "ARM=NUMBERS");
  const std::vector<std::string> joints =
      ValuesByArm("--joints", FLAGS_joints, robots, has_files ? "ARM=FILE" : "ARM=NUMBERS");
  std::vector<ArmsAtImage> at_images(images.size(), ArmsAtImage(robots.size()));
  for (size_t r = 0; r < robots.size(); ++r) {
    const RobotSummary* const arm = FindEstimatedArm(run.result, r);
    if (poses[r].empty()) throw InputError("the poses of arm " + robots[r] + " are needed: ARM=VALUE;ARM=VALUE");
    if (!joints[r].empty() && arm == nullptr) {
      throw InputError("--joints: the run has not estimated the errors of " +
                       (robots[r].empty() ? "an arm" : "the arm " + robots[r]) + "; leave them out");
    }
    if (has_files) {
      const std::vector<GivenArmPose> of_arm = PosesOfImages(run, r, poses[r], joints[r], images);
      for (size_t i = 0; i < images.size(); ++i) at_images[i][r] = of_arm[i];
      continue;
    }
    const PoseReading& reading = run.pose_readings[r];
    GivenArmPose& pose = at_images.front()[r];
    pose.base_from_gripper = BaseFromGripper(reading, PoseOfFlag("pose", poses[r], reading.format));
    if (!joints[r].empty()) pose.joints = JointsOfFlag("joints", joints[r], arm->nominal, run.joints_are_deg[r]);
  }
  return at_images;
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

// Reads images that were taken at poses of the robot.
CheckedSession ReadAtPoses(const FinishedRun& run, const std::vector<SessionImage>& images) {
  const bool is_in_place = IsTargetInPlace();
  return SessionAtPoses(run, images, PosesOfFlags(run, images), is_in_place, NumThreads());
}

// Reads images of one camera that stands still, as its targets do.
CheckedSession ReadBesideReferences(const FinishedRun& run, const std::vector<SessionImage>& images) {
  if (!FLAGS_poses.empty() || !FLAGS_pose.empty() || !FLAGS_joints.empty()) {
    throw InputError("--reference: takes the place of the robot's poses; leave out --poses, --pose and --joints");
  }
  if (!FLAGS_target.empty() && !IsTargetInPlace()) {
    throw InputError("--reference: says nothing about a camera if the target was moved");
  }
  return SessionBesideReferences(run, FLAGS_reference, images, NumThreads());
}

}  // namespace

int RunCommand_check(const std::vector<std::string>& arguments) {
  const std::vector<std::string> paths(arguments.begin() + 1, arguments.end());
  const FinishedRun run = ReadFinishedRun(arguments[0]);
  const std::vector<SessionImage> images = ImagesOf(run.result.rig, paths);
  const CheckedSession session = FLAGS_reference.empty() ? ReadAtPoses(run, images) : ReadBesideReferences(run, images);
  for (const std::string& note : session.notes) std::cerr << "heba: warning: " << note << std::endl;
  const Problem& rig = session.problem;
  const Outcome<SessionCheck> check = CheckSession(rig, session.solution, session.options);
  if (!check) return Undecided(WhyUndecided(check.failure(), images, NumThreads()));
  if (!FLAGS_history.empty()) AddToHistory(FLAGS_history, run.result.name, rig, *check);
  std::cout << (FLAGS_json ? CheckToJson(rig, *check) : ForTerminal(CheckText(rig, *check))) << std::flush;
  if (DecisionOf(*check) == "holds") return kDone;
  PrintError("the calibration does not hold any more: " + ChangeText(rig, *check));
  return kWorkFailed;
}

}  // namespace heba
