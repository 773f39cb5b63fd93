#include <algorithm>
#include <iostream>
#include <optional>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/urdf_arm.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pixel_flag.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/capture_section.h"
#include "tools/config/finished_run.h"
#include "tools/files/location_file.h"
#include "tools/run/image_location.h"
#include "tools/text/console.h"
#include "tools/text/location_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// The images of one moment: one of a single camera, which gives the moment its name, or one of each of several cameras.
struct Moment {
  std::string name;
  std::vector<std::pair<size_t, std::string>> images;  // The camera and the path.
};

template <class Part>
std::vector<std::string> NamesOf(const std::vector<Part>& parts) {
  std::vector<std::string> names;
  for (const Part& part : parts) names.push_back(part.name);
  return names;
}

// Returns the poses and joints of the arms that --pose and --joints give; the joints are those of --pose if the poses
// of the arm are joints.
std::vector<GivenArmPose> PosesOfFlags(const FinishedRun& run) {
  const std::vector<std::string>& robots = run.result.rig.robots;
  const std::vector<std::string> poses = ValuesByArm("--pose", FLAGS_pose, robots, "ARM=NUMBERS");
  const std::vector<std::string> joints = ValuesByArm("--joints", FLAGS_joints, robots, "ARM=NUMBERS");
  std::vector<GivenArmPose> given(robots.size());
  for (size_t r = 0; r < robots.size(); ++r) {
    const PoseReading& reading = run.pose_readings[r];
    const RobotSummary* const arm = FindEstimatedArm(run.result, r);
    if (!poses[r].empty()) {
      given[r].base_from_gripper = BaseFromGripper(reading, PoseOfFlag("pose", poses[r], reading.format));
    }
    if (!joints[r].empty()) {
      if (arm == nullptr) {
        throw InputError("--joints: the run has not estimated the errors of " +
                         (robots[r].empty() ? "an arm" : "the arm " + robots[r]) + "; leave them out");
      }
      given[r].joints = JointsOfFlag("joints", joints[r], arm->nominal, run.joints_are_deg[r]);
    } else if (arm != nullptr && !poses[r].empty() && !reading.format.robot.empty()) {
      given[r].joints = JointsOfFlag("pose", poses[r], arm->nominal, reading.format.angle_unit == "deg");
    }
  }
  return given;
}

// Returns the poses of the arms for images of these cameras.
std::vector<ArmPose> PosesFor(const FinishedRun& run, const std::vector<size_t>& cameras, size_t num_images) {
  const Problem& rig = run.result.rig;
  if (IsSingleCamera(rig) && rig.cameras.front().mount.part == Mount::Part::kGripper &&
      (FLAGS_pose.empty() || num_images > 1)) {
    throw InputError("the robot carries the camera: one IMAGE, with --pose " +
                     Join(run.pose_readings.front().format.columns, ",") + ", the robot pose of that image, is needed");
  }
  return PosesForCameras(run.result, cameras, PosesOfFlags(run), "--pose",
                         FLAGS_joints.empty() ? "--pose" : "--joints");
}

// Returns the rough poses of the targets that --near gives, empty without the flag: the numbers of the only target with
// a symmetry, or TARGET=NUMBERS;TARGET=NUMBERS.
std::vector<std::optional<Rigid3d>> NearOfFlag(const FinishedRun& run) {
  if (FLAGS_near.empty()) return {};
  if (!FLAGS_pixels.empty()) {
    throw InputError(
        "--near: the target's plane is the same for all of its possible poses, so that a pixel has only "
        "one position; leave this flag out");
  }
  const std::vector<ProblemTarget>& targets = run.result.rig.targets;
  const std::vector<std::string> names = NamesOf(targets);
  std::vector<size_t> symmetric;
  for (size_t t = 0; t < targets.size(); ++t) {
    if (targets[t].symmetries.size() > 1) symmetric.push_back(t);
  }
  if (symmetric.empty()) {
    throw InputError("--near: no target has a symmetry, and each has only one possible pose; leave this flag out");
  }
  std::vector<std::optional<Rigid3d>> near(targets.size());
  const PoseFormat& format = FormatOfNear(run.pose_readings.front().format);
  if (symmetric.size() == 1 && FLAGS_near.find('=') == std::string::npos) {
    near[symmetric.front()] = PoseOfFlag("near", FLAGS_near, format);
    return near;
  }
  for (const std::string& part : Split(FLAGS_near, ';')) {
    const auto [t, numbers] = NamedValue("--near", part, names, "TARGET=NUMBERS");
    if (targets[t].symmetries.size() == 1) {
      throw InputError("--near: target " + names[t] + " has no symmetry and only one possible pose; leave it out");
    }
    if (near[t]) throw InputError("--near: target " + names[t] + " is named twice");
    near[t] = PoseOfFlag("near", numbers, format);
  }
  return near;
}

// Returns the arms of --robot, in whose place they stand; empty without the flag.
std::vector<std::optional<ReachingArm>> ReachingArmsOfFlag(const std::vector<std::string>& robots) {
  if (FLAGS_robot.empty()) return {};
  std::vector<std::optional<ReachingArm>> arms;
  for (const std::string& name : ValuesByArm("--robot", FLAGS_robot, robots, "ARM=MODEL")) {
    const Arm* const arm = FindArm(name);
    if (name.ends_with(".urdf")) {
      UrdfArm urdf = ReadUrdfArm(name);
      arms.push_back(ReachingArm{name, std::move(urdf.arm), std::move(urdf.joint_names)});
    } else if (arm != nullptr) {
      arms.push_back(ReachingArm{name, *arm, {}});
      for (int joint = 1; joint <= arm->num_joints(); ++joint) {
        arms.back()->joint_names.push_back("joint" + std::to_string(joint));
      }
    } else if (name.empty()) {
      arms.emplace_back();
    } else {
      throw InputError("--robot: " + UnknownName(name, ArmNames()) + "; or a .urdf file");
    }
  }
  return arms;
}

// Returns the pixels of --pixels. Those of several cameras show one point together, unless there is a plane.
std::vector<CameraPixel> PixelsOfFlag(const FinishedRun& run, bool has_plane) {
  const Problem& rig = run.result.rig;
  const bool is_one_point = !IsSingleCamera(rig) && !has_plane;
  const std::string form = IsSingleCamera(rig) ? "u,v" : "CAMERA=U,V";
  std::vector<CameraPixel> pixels;
  for (const std::string& part : Split(FLAGS_pixels, ';')) {
    const auto [camera, text] = NamedValue("--pixels", part, NamesOf(rig.cameras), form);
    const std::string& name = rig.cameras[camera].name;
    const CameraPixel pixel{camera, PixelOfFlag(text, form + " is needed, several separated by semicolons")};
    CheckPixelInImage(pixel.pixel, run.result.solution.cameras[camera], name);
    const auto is_same = [camera = camera](const CameraPixel& other) { return other.camera == camera; };
    if (is_one_point && std::any_of(pixels.begin(), pixels.end(), is_same)) {
      throw InputError("--pixels: camera " + name + " is named twice; one pixel of each camera shows the point");
    }
    pixels.push_back(pixel);
  }
  if (is_one_point && pixels.size() < 2) {
    throw InputError(
        "--pixels: a point needs its pixels in at least two cameras, or the plane that it lies on (--plane)");
  }
  return pixels;
}

// Returns the request with the pixels and the plane that --pixels and --plane state.
LocationRequest WithPixels(LocationRequest request, const FinishedRun& run, const std::vector<std::string>& images) {
  if (FLAGS_pixels.empty()) {
    if (FLAGS_plane == "target") return request;
    throw InputError("--plane: requires --pixels; without that flag the target itself is located");
  }
  const bool is_single = IsSingleCamera(run.result.rig);
  if (!is_single && !images.empty()) {
    throw InputError("--pixels: needs no image; leave " + Quoted(images.front()) + " out");
  }
  request.plane = PlaneOfFlag();
  if (is_single && !request.plane && images.empty()) {
    throw InputError("'heba locate' needs an IMAGE, except for --pixels on a plane in the base (--plane)");
  }
  request.pixels = PixelsOfFlag(run, request.plane.has_value());
  if (!is_single && !request.plane && !request.reaching.empty()) {
    throw InputError(
        "--robot: the point of several pixels has no orientation; name its plane (--plane), or leave this "
        "flag out");
  }
  return request;
}

// Returns the request with the tool and the grasp that --tool and --grasp state.
LocationRequest WithGrasp(LocationRequest request, const FinishedRun& run) {
  request.has_grasp = !FLAGS_tool.empty() || !FLAGS_grasp.empty();
  if (!request.has_grasp) return request;
  if (!FLAGS_pixels.empty()) {
    throw InputError("--tool and --grasp: a pixel has no orientation to grasp by; leave --pixels out");
  }
  const Problem& rig = run.result.rig;
  if (rig.robots.size() > 1 || rig.targets.size() > 1) {
    throw InputError("--tool and --grasp: are those of one arm and one target; the run has several");
  }
  const PoseFormat& format = FormatOfNear(run.pose_readings.front().format);
  if (!FLAGS_tool.empty()) request.gripper_from_tool = PoseOrMappingOfFlag("tool", FLAGS_tool, format);
  if (!FLAGS_grasp.empty()) request.target_from_grasp = PoseOrMappingOfFlag("grasp", FLAGS_grasp, format);
  return request;
}

std::vector<Moment> MomentsOf(const Problem& rig, const std::vector<std::string>& images) {
  std::vector<Moment> moments;
  if (IsSingleCamera(rig) && !images.empty()) {
    for (const std::string& image : images) moments.push_back({image, {{0, image}}});
    return moments;
  }
  Moment& moment = moments.emplace_back();
  for (const std::string& text : images) {
    const auto [camera, path] = NamedValue("an image", text, NamesOf(rig.cameras), "CAMERA=IMAGE");
    for (const auto& [other, other_path] : moment.images) {
      if (other != camera) continue;
      throw InputError("camera " + rig.cameras[camera].name + " is named twice; one image of each is located");
    }
    moment.images.emplace_back(camera, path);
  }
  return moments;
}

// Returns the request that the flags state for a run.
LocationRequest RequestFor(const FinishedRun& run, const std::vector<std::string>& images,
                           const std::vector<Moment>& moments) {
  LocationRequest request;
  request.result = &run.result;
  request.targets = run.targets;
  request.reaching = ReachingArmsOfFlag(run.result.rig.robots);
  request.near_form = "--near " + Join(FormatOfNear(run.pose_readings.front().format).columns, ",");
  request = WithGrasp(WithPixels(std::move(request), run, images), run);
  request.near = NearOfFlag(run);
  std::vector<size_t> cameras;
  for (const CameraPixel& pixel : request.pixels) cameras.push_back(pixel.camera);
  for (const auto& [camera, image] : moments.front().images) cameras.push_back(camera);
  request.arms = PosesFor(run, cameras, images.size());
  return request;
}

// The images of one moment have one location.
struct LocatedMoment {
  ImageLocation location;
  bool is_readable = true;  // Whether all images can be read.
};

// Locates what the images of a moment show. An image of a single camera that cannot be read, or has another size than
// the camera's, is a fault of this image alone.
LocatedMoment LocateMoment(const FinishedRun& run, const LocationRequest& request, const Moment& moment) {
  std::vector<Sighting> sightings;
  try {
    for (const auto& [camera, image] : moment.images) {
      for (size_t t = 0; t < run.targets.size(); ++t) {
        sightings.push_back({camera, t, DetectFor(run.result.solution.cameras[camera], *run.targets[t], image)});
      }
    }
  } catch (const InputError& error) {
    if (moment.name.empty()) throw;
    ImageLocation location;
    location.image = moment.name;
    const std::string fault = error.what();
    const std::string prefix = moment.name + ": ";  // The fault of an image is stated beside its name.
    location.fault = Failure(fault.starts_with(prefix) ? fault.substr(prefix.size()) : fault);
    return {std::move(location), false};
  }
  return {LocateInImages(request, moment.name, sightings)};
}

// Returns whether --near is all that a target in the image of a single camera lacks.
bool LacksNear(const ImageLocation& location) {
  return !location.image.empty() && !location.IsLocated() && !location.targets.empty() &&
         !location.targets.front().possible.empty() && !location.targets.front().near;
}

}  // namespace

int RunCommand_locate(const std::vector<std::string>& arguments) {
  const std::vector<std::string> images(arguments.begin() + 1, arguments.end());
  if (images.empty() && FLAGS_pixels.empty()) {
    throw InputError("'heba locate' needs an IMAGE, except for --pixels on a plane in the base (--plane)");
  }
  const FinishedRun run = ReadFinishedRun(arguments[0]);
  for (const std::optional<RobotSummary>& arm : run.result.arms) {
    const std::string errors = arm ? ImplausibleArmText(*arm) : "";
    if (!errors.empty()) std::cerr << "heba: warning: the run has estimated " << errors << std::endl;
  }
  const std::vector<Moment> moments = MomentsOf(run.result.rig, images);
  const LocationRequest request = RequestFor(run, images, moments);
  std::vector<ImageLocation> locations;
  std::vector<std::string> undecided;
  std::string why_undecided;
  int status = kDone;
  for (const Moment& moment : moments) {
    LocatedMoment located = LocateMoment(run, request, moment);
    const ImageLocation& location = locations.emplace_back(std::move(located.location));
    if (!FLAGS_json) std::cout << ForTerminal(LocationText(request, location));
    if (location.point && !PointWarning(*location.point).empty()) {
      std::cerr << "heba: warning: " << PointWarning(*location.point) << std::endl;
    }
    const std::string fault = Join(LocationFaults(request, location), "; ");
    if (fault.empty()) continue;
    if (status != kInputWrong) status = located.is_readable ? kWorkFailed : kInputWrong;
    if (LacksNear(location)) {
      undecided.push_back(moment.name);
      why_undecided = fault;
    } else {
      PrintError((moment.name.empty() ? "" : moment.name + ": ") + fault);
    }
  }
  if (FLAGS_json) std::cout << LocationsToJson(request, locations);
  if (!undecided.empty()) {
    PrintError((undecided.size() == 1 ? undecided[0] : std::to_string(undecided.size()) + " images") + ": " +
               why_undecided);
  }
  std::cout << std::flush;
  return status;
}

}  // namespace heba
