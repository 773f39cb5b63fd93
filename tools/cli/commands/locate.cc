#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/detection.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/io/result_file.h"
#include "heba/robot/ur_kinematics.h"
#include "heba/robot/urdf_arm.h"
#include "heba/target_location.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/cli/pose_flag.h"
#include "tools/config/capture_section.h"
#include "tools/config/finished_run.h"
#include "tools/config/robot_section.h"
#include "tools/config/run_config.h"
#include "tools/text/console.h"
#include "tools/text/reach_text.h"
#include "tools/text/result_text.h"
#include "tools/text/target_symmetry.h"

namespace heba {
namespace {

// The pose of what carries the camera, and what is to be said about it.
struct CameraMount {
  StatedPose stated;  // The identity for a stationary camera.
  std::string remark;
};

// Returns the positions of the arm's joints that a flag gives.
Eigen::VectorXd JointsOfFlag(const std::string& name, const std::string& text, const RobotSummary& robot,
                             bool are_deg) {
  std::vector<double> numbers;
  for (const std::string& field : Split(text, ',')) {
    double number = 0;
    if (!ParseDouble(Trim(field), &number)) {
      throw InputError("--" + name + ": " + Quoted(Trim(field)) + " is not a number");
    }
    numbers.push_back(number);
  }
  const auto num_joints = static_cast<size_t>(robot.nominal.num_joints());
  if (numbers.size() != num_joints) {
    throw InputError("--" + name + ": " + std::to_string(numbers.size()) + " numbers; the arm " + robot.nominal.name +
                     " has " + std::to_string(num_joints) + " joints");
  }
  return PositionsOf(robot.nominal, numbers, are_deg);
}

// Returns the joints that --joints gives, or --pose if the run's poses are joints; nothing otherwise.
std::optional<Eigen::VectorXd> JointsAskedFor(const FinishedRun& run, const RobotSummary& robot) {
  if (!FLAGS_joints.empty()) return JointsOfFlag("joints", FLAGS_joints, robot, run.joints_are_deg);
  const PoseFormat& format = run.pose_reading.format;
  if (format.robot.empty()) return std::nullopt;
  return JointsOfFlag("pose", FLAGS_pose, robot, format.angle_unit == "deg");
}

CameraMount CameraMountAskedFor(const FinishedRun& run) {
  const PoseReading& reading = run.pose_reading;
  const Rigid3d stated = BaseFromGripper(reading, PoseOfFlag("pose", FLAGS_pose, reading.format));
  const RobotSummary* robot = run.FindArm();
  if (robot == nullptr) {
    if (FLAGS_joints.empty()) return {stated, ""};
    throw InputError("--joints: the run has not estimated the errors of an arm; leave this flag out");
  }
  if (const std::optional<Eigen::VectorXd> joints = JointsAskedFor(run, *robot)) {
    const Outcome<Rigid3d> is_near = TruePose(*robot, stated, *joints);
    if (!is_near) throw InputError((FLAGS_joints.empty() ? "--pose: " : "--joints: ") + is_near.reason());
    const StatedPose with_errors = WithArmErrors(*robot, stated, *joints);
    return {with_errors, CorrectionText(*robot, run.solution(), with_errors)};
  }
  const Outcome<StatedPose> with_errors = WithArmErrors(*robot, stated);
  if (with_errors) return {*with_errors, CorrectionText(*robot, run.solution(), *with_errors)};
  return {stated, "  the robot's pose was not corrected by the estimated errors of the arm " + robot->nominal.name +
                      ", whose uncertainty is missing in the sigmas: " + with_errors.reason() +
                      "; --joints, the positions of the joints at that pose, would tell them\n"};
}

// Returns the format of --near: that of the run's poses, or `ros` if those are joints.
const PoseFormat& FormatOfNear(const PoseReading& reading) {
  return reading.format.robot.empty() ? reading.format : *FindPoseFormat("ros");
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
  return PoseOfFlag("near", FLAGS_near, FormatOfNear(run.pose_reading));
}

// Returns whether the figures of a position can be shown. The covariance in a result file may be invalid.
bool IsKnown(const Eigen::Vector3d& place_m, const PositionCovariance& covariance) {
  const Eigen::Vector3d variances = covariance.TotalM2().diagonal();
  return place_m.allFinite() && variances.allFinite() && variances.minCoeff() >= 0;
}
constexpr const char* kNotKnown = "the position or its uncertainty is not a finite number; do not use this result";

double LargestSigmaMm(const PositionCovariance& covariance) {
  return 1000 * std::sqrt(covariance.TotalM2().diagonal().maxCoeff());
}

std::string DescribeSigma(const LocatedTarget& located) {
  return "  one sigma of its centre, along the base's x, y, z: " + SigmasText(located.covariance) + "\n";
}

// The arm of --robot: one of the built-in table, or a URDF's from its root to its only tip. Neither without the flag.
struct ReachingArm {
  const UrRobot* ur = nullptr;
  std::shared_ptr<const UrdfArm> urdf = nullptr;
};

ReachingArm ArmAskedFor() {
  if (FLAGS_robot.empty()) return {};
  if (FLAGS_robot.ends_with(".urdf")) return {nullptr, UrdfArm::Read(FLAGS_robot)};
  const UrRobot* robot = FindUrRobot(FLAGS_robot);
  if (robot == nullptr) {
    throw InputError("--robot: " + Quoted(FLAGS_robot) + " is unknown; a .urdf file, or one of: " +
                     Join(UrRobotNames(), ", ") + DidYouMean(FLAGS_robot, UrRobotNames()));
  }
  return {robot, nullptr};
}

std::string DescribePostures(const UrdfArm& arm, const Rigid3d& base_from_target) {
  const Outcome<std::vector<std::vector<double>>> postures = arm.PosturesOf(base_from_target);
  if (!postures) return "  " + FLAGS_robot + ": " + postures.reason() + "\n";
  std::string text = "  " + FLAGS_robot + ": " + std::to_string(postures->size()) +
                     " postures found that align the tip's frame with the target's; " + Join(arm.joint_names(), ", ") +
                     " in deg or m:\n";
  for (const std::vector<double>& posture : *postures) {
    text += "   ";
    for (size_t i = 0; i < posture.size(); ++i) {
      text += PadLeft(arm.IsTurning(i) ? Fixed(RadToDeg(posture[i]), 3) : Fixed(posture[i], 5), 10);
    }
    text += "\n";
  }
  return text;
}

std::string DescribePostures(const UrRobot& robot, const Rigid3d& base_from_target) {
  const Outcome<std::vector<UrPosture>> postures = PosturesOf(robot, base_from_target);
  if (!postures) return "  " + robot.name + ": " + postures.reason() + "\n";
  std::string text = "  " + robot.name + ": " + std::to_string(postures->size()) +
                     " postures align the flange's frame with the target's; joints in deg:\n";
  for (const UrPosture& posture : *postures) {
    text += "   ";
    for (const double joint_rad : posture.joints_rad) text += PadLeft(Fixed(RadToDeg(joint_rad), 3), 10);
    text += (posture.singularity.empty() ? "" : "  (" + posture.singularity + ")") + "\n";
  }
  return text;
}

std::string DescribePostures(const ReachingArm& arm, const Rigid3d& base_from_target) {
  if (arm.ur != nullptr) return DescribePostures(*arm.ur, base_from_target);
  return arm.urdf ? DescribePostures(*arm.urdf, base_from_target) : "";
}

// Describes all poses that fit an image of a target with symmetries.
std::string DescribePossible(const std::vector<LocatedTarget>& possible, const ReachingArm& arm) {
  std::string text;
  for (size_t i = 0; i < possible.size(); ++i) {
    text += "  possible pose " + std::to_string(i + 1) + " of " + std::to_string(possible.size()) +
            ": base_from_target " + PoseText(possible[i].base_from_target) + "\n" +
            DescribePostures(arm, possible[i].base_from_target);
  }
  return text + DescribeSigma(possible.front());
}

// Lists the rotation angles between `rough` and the possible poses, such as "3.1 deg, 178 deg", in the order of
// `possible`.
std::string AnglesText(const std::vector<LocatedTarget>& possible, const Rigid3d& rough) {
  std::vector<std::string> angles;
  for (const LocatedTarget& located : possible) {
    angles.push_back(Significant(RadToDeg(AngleRad(located.base_from_target, rough)), 3) + " deg");
  }
  return Join(angles, ", ");
}

// Parses --pixels, "u,v; u,v", in px.
std::vector<Eigen::Vector2d> PixelsAskedFor() {
  std::vector<Eigen::Vector2d> pixels;
  for (const std::string& pair : Split(FLAGS_pixels, ';')) {
    const std::vector<std::string> fields = Split(pair, ',');
    Eigen::Vector2d pixel;
    if (fields.size() != 2 || !ParseDouble(Trim(fields[0]), &pixel.x()) || !ParseDouble(Trim(fields[1]), &pixel.y()) ||
        !pixel.allFinite()) {
      throw InputError("--pixels: " + Quoted(Trim(pair)) +
                       " is not a pixel; u,v is needed, several separated by semicolons");
    }
    pixels.push_back(pixel);
  }
  return pixels;
}

// Parses --plane, "nx, ny, nz, 120 mm"; nothing for the plane of the target.
std::optional<Plane> PlaneAskedFor() {
  if (FLAGS_plane == "target") return std::nullopt;
  const std::vector<std::string> fields = Split(FLAGS_plane, ',');
  Plane plane;
  bool are_numbers = fields.size() == 4;
  for (size_t i = 0; i < 3 && are_numbers; ++i) {
    are_numbers = ParseDouble(Trim(fields[i]), &plane.normal[static_cast<Eigen::Index>(i)]);
  }
  const bool is_direction = are_numbers && plane.normal.allFinite() && plane.normal.norm() > 1e-6;
  if (!is_direction) {
    throw InputError(
        "--plane: " + Quoted(FLAGS_plane) +
        " is not a plane; a normal in the base and the distance along it are needed, such as 0,0,1,120 mm, or "
        "target");
  }
  plane.normal.normalize();
  const ParsedQuantity distance = ParseQuantity(Trim(fields[3]), Quantity::kLength);
  if (!distance.fault.empty()) throw InputError("--plane: " + distance.fault);
  plane.distance_m = distance.value;
  return plane;
}

// Returns the flange pose that points at a plane: its z axis opposes the normal, its x axis is as close to the base's
// x axis as possible (to the base's y axis if the normal is nearly along x).
Rigid3d PointingAt(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d z = -normal;
  const bool is_along_x = std::abs(z.x()) > 0.9;
  const Eigen::Vector3d other = is_along_x ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d x = (other - other.dot(z) * z).normalized();
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return Rigid3d(rotation, point);
}

std::string DescribePoint(const Eigen::Vector2d& pixel, const LocatedPoint& located) {
  const Eigen::Vector3d mm = 1000 * located.in_base;
  return "  pixel " + Significant(pixel.x(), 6) + ", " + Significant(pixel.y(), 6) + ": [" + Fixed(mm.x(), 3) + ", " +
         Fixed(mm.y(), 3) + ", " + Fixed(mm.z(), 3) + "] mm in the base; one sigma " + SigmasText(located.covariance) +
         "\n";
}

// The values of --pixels and --plane.
struct PixelsAsked {
  std::vector<Eigen::Vector2d> pixels;
  std::optional<Plane> plane;  // The target's plane if not set.
};

PixelsAsked ReadPixelsAsked(const Camera& camera) {
  if (FLAGS_pixels.empty()) {
    if (FLAGS_plane != "target") {
      throw InputError("--plane: requires --pixels; without that flag the target itself is located");
    }
    return {};
  }
  PixelsAsked asked{PixelsAskedFor(), PlaneAskedFor()};
  for (const Eigen::Vector2d& pixel : asked.pixels) {
    if (pixel.minCoeff() < -0.5 || pixel.x() > camera.width_px - 0.5 || pixel.y() > camera.height_px - 0.5) {
      throw InputError("--pixels: " + Significant(pixel.x(), 6) + "," + Significant(pixel.y(), 6) +
                       " is outside the image of " + std::to_string(camera.width_px) + " x " +
                       std::to_string(camera.height_px) + " px");
    }
  }
  return asked;
}

// Describes the points that --pixels requests in one image.
Outcome<std::string> DescribePixels(const FinishedRun& run, const Solution& solution, const CaptureDetection& seen,
                                    const CameraMount& mount, const PixelsAsked& asked, const ReachingArm& arm) {
  const std::optional<Plane>& plane = asked.plane;
  const Observations observations = ObservationsOf(*run.target, seen.detection);
  Eigen::Vector3d normal = plane ? plane->normal : Eigen::Vector3d::Zero();
  if (!plane) {
    const Outcome<LocatedTarget> target = LocateTarget(run.result.setup, solution, observations, mount.stated);
    if (!target) return Failure{seen.detection.reason.empty() ? target.reason() : seen.detection.reason};
    // The normal on the side that the camera sees.
    normal = target->base_from_target.rotation * Eigen::Vector3d::UnitZ();
  }
  const Rigid3d base_from_camera =
      Correct(solution, mount.stated).base_from_mount * solution.hand_eye.camera_mount_from_camera;
  std::string text = mount.remark;
  for (const Eigen::Vector2d& pixel : asked.pixels) {
    const Outcome<LocatedPoint> located =
        plane ? LocatePixel(run.result.setup, solution, pixel, *plane, mount.stated)
              : LocatePixelOnTarget(run.result.setup, solution, pixel, observations, mount.stated);
    if (!located) {
      return Failure{"pixel " + Significant(pixel.x(), 6) + ", " + Significant(pixel.y(), 6) + ": " + located.reason()};
    }
    if (!IsKnown(located->in_base, located->covariance)) return Failure{kNotKnown};
    text += DescribePoint(pixel, *located);
    const bool is_seen_side = normal.dot(base_from_camera.translation - located->in_base) > 0;
    text += DescribePostures(arm, PointingAt(located->in_base, is_seen_side ? normal : Eigen::Vector3d(-normal)));
  }
  return text;
}

// The text about the target in one image.
struct TargetDescription {
  std::string text;         // For standard output; lists all possible poses if none is chosen.
  bool is_located = false;  // Whether one pose was chosen.
  std::string fault;        // Reason why none was chosen; empty if only --near is missing.
};

TargetDescription DescribeTarget(const FinishedRun& run, const Solution& solution, const std::string& image,
                                 const CaptureDetection& seen, const CameraMount& mount,
                                 const std::optional<Rigid3d>& near, const ReachingArm& arm) {
  const Outcome<std::vector<LocatedTarget>> possible = LocateSymmetricTarget(
      run.result.setup, solution, ObservationsOf(*run.target, seen.detection), run.target->Symmetries(), mount.stated);
  if (!possible) return {"", false, seen.detection.reason.empty() ? possible.reason() : seen.detection.reason};
  for (const LocatedTarget& located : *possible) {
    if (!IsKnown(located.base_from_target.translation, located.covariance)) return {"", false, kNotKnown};
  }
  const std::string fit = image + ": " + std::to_string(seen.detection.ids.size()) + " of " +
                          std::to_string(run.target->points().size()) + " points, rms " +
                          Significant(possible->front().rms_px, 2) + " px";
  const auto reach_of = [&](const LocatedTarget& located) {
    const RobotSummary* robot = run.FindArm();
    if (robot == nullptr) return std::string();
    const bool is_corrected = run.result.setup == Setup::kEyeToHand || mount.stated.effect != nullptr;
    return is_corrected ? ReachText(*robot, solution, located, !FLAGS_robot.empty())
                        : "  no pose to command: the target was located with a pose that was not corrected\n";
  };
  const auto describe_chosen = [&](const LocatedTarget& located, const std::string& why) {
    return fit + "\n  base_from_target " + PoseText(located.base_from_target, LargestSigmaMm(located.covariance)) +
           "\n" + DescribeSigma(located) + mount.remark + why + reach_of(located) +
           DescribePostures(arm, located.base_from_target);
  };
  if (possible->size() == 1) return {describe_chosen(possible->front(), ""), true, ""};
  const std::string all =
      fit + "; " + SymmetryText(*run.target) + "\n" + DescribePossible(*possible, arm) + mount.remark;
  if (!near) return {all, false, ""};
  const std::string angles = std::to_string(possible->size()) + " possible poses, from which its rotation differs by " +
                             AnglesText(*possible, *near);
  const std::optional<size_t> meant = FindMeantPose(*possible, *near);
  if (!meant) {
    return {all, false,
            "--near does not decide between the " + angles + "; it must be nearer to one of them by " +
                Significant(RadToDeg(kMinRotationGapRad), 2) + " deg"};
  }
  return {describe_chosen((*possible)[*meant], "  chosen by --near among the " + angles + "\n"), true, ""};
}

}  // namespace

int RunCommand_locate(const std::vector<std::string>& arguments) {
  const FinishedRun run = ReadFinishedRun(arguments[0]);
  const Estimate* refined = FindRefined(run.result);
  const ReachingArm arm = ArmAskedFor();
  const bool is_carried = run.result.setup == Setup::kEyeInHand;
  if (is_carried && (FLAGS_pose.empty() || arguments.size() > 2)) {
    throw InputError("the robot carries the camera: one IMAGE, with --pose " +
                     Join(run.pose_reading.format.columns, ",") + ", the robot pose of that image, is needed");
  }
  if (!is_carried && !FLAGS_pose.empty()) throw InputError("--pose: the camera is stationary; leave this flag out");
  if (!is_carried && !FLAGS_joints.empty()) {
    throw InputError("--joints: the camera is stationary; leave this flag out");
  }
  const CameraMount mount = is_carried ? CameraMountAskedFor(run) : CameraMount();
  const PixelsAsked asked = ReadPixelsAsked(refined->camera);
  const std::optional<Rigid3d> near = NearAskedFor(run);
  std::vector<std::string> undecided;
  bool all_found = true;
  for (size_t i = 1; i < arguments.size(); ++i) {
    const CaptureDetection seen = DetectCapture(*run.target, arguments[i]);
    CheckImageSize(run, seen, arguments[i]);
    if (!FLAGS_pixels.empty()) {
      const Outcome<std::string> points = DescribePixels(run, *refined->solution, seen, mount, asked, arm);
      if (points) {
        std::cout << ForTerminal(arguments[i] + ":\n" + *points);
      } else {
        all_found = false;
        PrintError(arguments[i] + ": " + points.reason());
      }
      continue;
    }
    const TargetDescription target = DescribeTarget(run, *refined->solution, arguments[i], seen, mount, near, arm);
    std::cout << ForTerminal(target.text);
    if (target.is_located) continue;
    all_found = false;
    if (target.fault.empty()) {
      undecided.push_back(arguments[i]);
    } else {
      PrintError(arguments[i] + ": " + target.fault);
    }
  }
  if (!undecided.empty()) {
    PrintError((undecided.size() == 1 ? undecided[0] : std::to_string(undecided.size()) + " images") + ": " +
               SymmetryText(*run.target) + ", so " + std::to_string(run.target->Symmetries().size()) +
               " poses fit an image equally well; --near " + Join(FormatOfNear(run.pose_reading).columns, ",") +
               ", a rough base_from_target, decides between them");
  }
  std::cout << std::flush;
  return all_found ? kDone : kWorkFailed;
}

}  // namespace heba
