#include <cmath>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/detection.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/io/result_file.h"
#include "heba/robot/ur_kinematics.h"
#include "heba/robot/urdf_arm.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pixel_flag.h"
#include "tools/cli/pose_flag.h"
#include "tools/cli/rig_locate.h"
#include "tools/config/capture_section.h"
#include "tools/config/finished_run.h"
#include "tools/config/run_config.h"
#include "tools/files/location_file.h"
#include "tools/run/image_location.h"
#include "tools/text/console.h"
#include "tools/text/location_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

// Returns the joints that --joints gives, or --pose if the run's poses are joints; nothing otherwise.
std::optional<Eigen::VectorXd> JointsAskedFor(const FinishedRun& run, const RobotSummary& robot) {
  if (!FLAGS_joints.empty()) return JointsOfFlag("joints", FLAGS_joints, robot.nominal, run.joints_are_deg);
  const PoseFormat& format = run.pose_reading.format;
  if (format.robot.empty()) return std::nullopt;
  return JointsOfFlag("pose", FLAGS_pose, robot.nominal, format.angle_unit == "deg");
}

// Sets the pose of the gripper that carries the camera, with the errors of the arm if the run has estimated them and
// the joints are known.
void SetCameraMount(const FinishedRun& run, LocationRequest* request) {
  const PoseReading& reading = run.pose_reading;
  const Rigid3d stated = BaseFromGripper(reading, PoseOfFlag("pose", FLAGS_pose, reading.format));
  std::optional<Eigen::VectorXd> joints;
  if (request->robot != nullptr) {
    joints = JointsAskedFor(run, *request->robot);
  } else if (!FLAGS_joints.empty()) {
    joints = Eigen::VectorXd();
  }
  const Outcome<StatedPose> with_errors = WithErrorsOfArm(request->robot, stated, joints);
  if (with_errors) {
    request->camera_mount = *with_errors;
    return;
  }
  if (joints) throw InputError((FLAGS_joints.empty() ? "--pose: " : "--joints: ") + with_errors.reason());
  request->camera_mount = stated;
  request->why_not_corrected = with_errors.reason();
}

// Returns the pose that --near expects, base_from_target; nothing without the flag.
std::optional<Rigid3d> NearAskedFor(const FinishedRun& run) {
  if (FLAGS_near.empty()) return std::nullopt;
  if (!FLAGS_pixels.empty()) {
    throw InputError("--near: the target's plane is the same for all of its possible poses; leave this flag out");
  }
  if (run.target->Symmetries().size() == 1) {
    throw InputError("--near: the target has no symmetry and only one possible pose; leave this flag out");
  }
  return PoseOfFlag("near", FLAGS_near, FormatOfNear(run.pose_reading.format));
}

// Returns the arm of --robot; nothing without the flag.
std::optional<ReachingArm> ArmAskedFor() {
  if (FLAGS_robot.empty()) return std::nullopt;
  if (FLAGS_robot.ends_with(".urdf")) return ReachingArm{FLAGS_robot, nullptr, UrdfArm::Read(FLAGS_robot)};
  const UrRobot* robot = FindUrRobot(FLAGS_robot);
  if (robot == nullptr) {
    throw InputError("--robot: " + UnknownName(FLAGS_robot, UrRobotNames()) + "; or a .urdf file");
  }
  return ReachingArm{robot->name, robot, nullptr};
}

// Sets the pixels and the plane that --pixels and --plane request.
void SetPixels(const Camera& camera, LocationRequest* request) {
  if (FLAGS_pixels.empty()) {
    if (FLAGS_plane != "target") {
      throw InputError("--plane: requires --pixels; without that flag the target itself is located");
    }
    return;
  }
  request->plane = PlaneOfFlag();
  for (const std::string& pair : Split(FLAGS_pixels, ';')) {
    request->pixels.push_back(PixelOfFlag(pair, "u,v is needed, several separated by semicolons"));
    CheckPixelInImage(request->pixels.back(), camera);
  }
}

// Returns the request that the flags state for a run.
LocationRequest RequestFor(const FinishedRun& run, size_t num_images) {
  LocationRequest request;
  request.result = &run.result;
  request.target = run.target.get();
  request.robot = run.FindArm();
  request.arm = ArmAskedFor();
  const bool is_carried = run.result.setup == Setup::kEyeInHand;
  if (is_carried && (FLAGS_pose.empty() || num_images > 1)) {
    throw InputError("the robot carries the camera: one IMAGE, with --pose " +
                     Join(run.pose_reading.format.columns, ",") + ", the robot pose of that image, is needed");
  }
  if (!is_carried && !FLAGS_pose.empty()) throw InputError("--pose: the camera is stationary; leave this flag out");
  if (!is_carried && !FLAGS_joints.empty()) {
    throw InputError("--joints: the camera is stationary; leave this flag out");
  }
  if (is_carried) SetCameraMount(run, &request);
  SetPixels(FindRefined(run.result)->camera, &request);
  request.near = NearAskedFor(run);
  return request;
}

// Locates the target, or pixels, in an image. An image that cannot be read, or has another size than the camera's, is
// a fault of this image alone.
ImageLocation LocateInFile(const FinishedRun& run, const LocationRequest& request, const std::string& image,
                           bool* is_readable) {
  try {
    const CaptureDetection seen = DetectCapture(*run.target, image);
    CheckImageSize(run, seen, image);
    return LocateInImage(request, image, seen.detection);
  } catch (const InputError& error) {
    *is_readable = false;
    ImageLocation location;
    location.image = image;
    location.num_target_points = run.target->points().size();
    const std::string fault = error.what();
    const std::string prefix = image + ": ";  // The fault of an image is stated beside its name.
    location.fault = fault.starts_with(prefix) ? fault.substr(prefix.size()) : fault;
    return location;
  }
}

}  // namespace

int RunCommand_locate(const std::vector<std::string>& arguments) {
  const std::vector<std::string> images(arguments.begin() + 1, arguments.end());
  const auto require_image = [&] {
    if (images.empty()) {
      throw InputError("'heba locate' needs an IMAGE, except for --pixels on a plane in the base (--plane)");
    }
  };
  if (FLAGS_pixels.empty()) require_image();
  if (IsRigResult(RunFolderOf(arguments[0]) / "result.json")) return LocateWithRig(arguments);
  if (FLAGS_plane == "target") require_image();
  const FinishedRun run = ReadFinishedRun(arguments[0]);
  const LocationRequest request = RequestFor(run, images.size());
  std::vector<ImageLocation> locations;
  std::vector<std::string> undecided;
  int status = kDone;
  // Pixels on a plane in the base need no image.
  if (images.empty()) {
    locations.push_back(LocateInImage(request, "", {}));
    const ImageLocation& location = locations.back();
    if (!FLAGS_json) std::cout << ForTerminal(LocationText(request, location));
    if (!location.IsLocated()) {
      PrintError(LocationFault(location));
      status = kWorkFailed;
    }
  }
  for (const std::string& image : images) {
    bool is_readable = true;
    locations.push_back(LocateInFile(run, request, image, &is_readable));
    const ImageLocation& location = locations.back();
    if (!FLAGS_json) std::cout << ForTerminal(LocationText(request, location));
    if (location.IsLocated()) continue;
    if (status != kInputWrong) status = is_readable ? kWorkFailed : kInputWrong;
    if (const std::string fault = LocationFault(location); !fault.empty()) {
      PrintError(image + ": " + fault);
    } else {
      undecided.push_back(image);
    }
  }
  if (FLAGS_json) std::cout << LocationsToJson(request, locations);
  if (!undecided.empty()) {
    PrintError((undecided.size() == 1 ? undecided[0] : std::to_string(undecided.size()) + " images") + ": " +
               SymmetryText(*run.target) + ", so " + std::to_string(run.target->Symmetries().size()) +
               " poses fit an image equally well; --near " + Join(FormatOfNear(run.pose_reading.format).columns, ",") +
               ", a rough base_from_target, decides between them");
  }
  std::cout << std::flush;
  return status;
}

}  // namespace heba
