#include "tools/text/failure_text.h"

#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/failure_code.h"
#include "heba/base/text.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

double Number(const Failure& failure, std::string_view key) {
  for (const auto& [name, value] : failure.numbers) {
    if (name == key) return value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

std::vector<std::string> NamesOf(const Failure& failure, std::string_view key) {
  std::vector<std::string> names;
  for (const auto& [name, value] : failure.names) {
    if (name == key) names.push_back(value);
  }
  return names;
}

// Returns the first name under a key; an empty one if there is none.
std::string Name(const Failure& failure, std::string_view key) {
  const std::vector<std::string> names = NamesOf(failure, key);
  return names.empty() ? "" : names.front();
}

bool HasName(const Failure& failure, std::string_view key) { return !Name(failure, key).empty(); }

// Returns the value of a placeholder: "key" is a name or a count, "key.2" a number with two decimals, "key:2" one with
// two significant digits, "key?one|many" the word that suits a count, and "cause" the words of the cause.
std::string ValueOf(std::string_view placeholder, const Failure& failure, ConfigKeys keys) {
  const size_t end = placeholder.find_first_of(".:?");
  const std::string_view key = placeholder.substr(0, end);
  if (key == "cause") return failure.causes.empty() ? "" : FailureText(failure.causes.front(), keys);
  const std::string format(end == std::string_view::npos ? "" : placeholder.substr(end + 1));
  const double number = Number(failure, key);
  if (format.empty()) return std::isnan(number) ? Name(failure, key) : Fixed(number, 0);
  if (placeholder[end] == '?') {
    const size_t middle = format.find('|');
    return number == 1 ? format.substr(0, middle) : format.substr(middle + 1);
  }
  const int digits = std::atoi(format.c_str());
  return placeholder[end] == '.' ? Fixed(number, digits) : Significant(number, digits);
}

// Returns a text with its placeholders, {...}, filled in. Of <one|other> the first is for users of a config, the
// second, which may be missing, for others.
std::string Fill(std::string_view text, const Failure& failure, ConfigKeys keys) {
  std::string filled;
  for (size_t at = 0; at < text.size(); ++at) {
    if (text[at] != '{' && text[at] != '<') {
      filled += text[at];
      continue;
    }
    const size_t end = text.find(text[at] == '{' ? '}' : '>', at);
    const std::string_view inside = text.substr(at + 1, end - at - 1);
    if (text[at] == '{') {
      filled += ValueOf(inside, failure, keys);
    } else if (keys == ConfigKeys::kNamed) {
      filled += inside.substr(0, inside.find('|'));
    } else if (inside.find('|') != std::string_view::npos) {
      filled += inside.substr(inside.find('|') + 1);
    }
    at = end;
  }
  return filled;
}

// The unknowns of one kind of owner: how their names begin if the owner has no name, between what its name stands
// otherwise, and the words for both. A pose is along and about the axes of `frame`.
struct OwnerWords {
  std::string_view alone, before, after;
  std::string_view plain_alone, plain_kind, frame;
};
constexpr OwnerWords kOwners[] = {
    {"hand_eye.", "cameras.", ".pose.", "the hand-eye", "camera", "the camera's"},
    {"board.", "targets.", ".pose.", "the board's", "target", "the target's"},
    {"", "robots.", ".world_from_base.", "", "arm", "its base's"},
    {"robot.", "robots.", ".errors.", "the arm's", "arm", ""},
    {"camera.", "cameras.", ".camera.", "the camera's", "camera", ""},
    {"target.", "targets.", ".shape.", "the target's", "target", ""},
};
constexpr std::string_view kShapeWords[] = {"scale along x",  "scale along y",  "bend along x",
                                            "bend along y",   "twist",          "cubic bend xxx",
                                            "cubic bend xxy", "cubic bend xyy", "cubic bend yyy"};
static_assert(std::size(kShapeWords) == TargetShape::kNumParams);

std::string ParameterText(std::string_view name, std::string_view frame) {
  for (size_t i = 0; i < kTangentNames.size(); ++i) {
    if (name != kTangentNames[i]) continue;
    return (i < 3 ? "translation along " : "rotation about ") + std::string(frame) + " " + "xyz"[i % 3];
  }
  for (size_t i = 0; i < std::size(kShapeWords); ++i) {
    if (name == kTargetShapeParamNames[i]) return std::string(kShapeWords[i]);
  }
  return std::string(name);
}

// Returns the key of the config that holds the intrinsics of the camera with this block (CameraBlock).
std::string IntrinsicsKey(const std::string& block) {
  return (block.starts_with("cameras.") ? block.substr(0, block.rfind('.') + 1) : "") + "refine.intrinsics";
}

std::string HiddenAtStart(const Failure& failure, ConfigKeys keys) {
  return Fill(HasName(failure, "camera")
                  ? "at the initial guess the target of capture {capture} in camera {camera} lies behind the camera; "
                    "check the mounts and the direction of the poses"
                  : "at the initial guess the target of capture {capture} lies behind the camera; try another seed, or "
                    "check the setup and the direction of the poses",
              failure, keys);
}

std::string NoInformation(const Failure& failure, ConfigKeys keys) {
  std::string text = "the data do not determine " + UnknownText(Name(failure, "unknown"));
  if (!HasName(failure, "of_camera")) return text;
  text += "; hold it with a camera file";
  return keys == ConfigKeys::kNamed ? text + " and " + IntrinsicsKey(Name(failure, "of_camera")) : text;
}

std::string Undetermined(const Failure& failure, ConfigKeys keys) {
  std::vector<std::string> unknowns;
  for (const std::string& name : NamesOf(failure, "unknown")) unknowns.push_back(UnknownText(name));
  std::vector<std::string> of_cameras;
  for (const std::string& block : NamesOf(failure, "of_camera")) of_cameras.push_back(IntrinsicsKey(block));
  const auto in_brackets = [&](const std::string& key) {
    return keys == ConfigKeys::kNamed ? " (" + key + ")" : std::string();
  };
  std::vector<std::string> cures = {"move the target through more depth and tilt"};
  if (!of_cameras.empty()) cures.push_back("hold intrinsics" + in_brackets(Join(of_cameras, ", ")));
  if (HasName(failure, "of_target")) cures.push_back("hold the target's shape" + in_brackets("refine.target_shape"));
  return "the captures do not determine " + Join(unknowns, " together with ") + "; " + Join(cures, ", or ");
}

std::string LargeSigma(const Failure& failure, ConfigKeys keys) {
  const bool is_rotation = !std::isnan(Number(failure, "sigma_deg"));
  return "the captures do not determine " + UnknownText(Name(failure, "unknown")) +
         Fill(is_rotation ? " (one sigma {sigma_deg:2} deg)" : " (one sigma {sigma_mm:2} mm)", failure, keys) +
         "; more captures with larger rotations about different axes are needed";
}

std::string ImplausibleRefinedCamera(const Failure& failure, ConfigKeys keys) {
  return Fill(HasName(failure, "camera") ? "the refined camera {camera} is implausible: {faults}"
                                         : "the refined camera is implausible: {faults}",
              failure, keys);
}

std::string NotJoined(const Failure& failure, ConfigKeys /*keys*/) {
  std::vector<std::string> parts = NamesOf(failure, "part");
  const bool is_one = parts.size() == 1;
  std::string text = parts.empty() ? "" : parts.back();
  if (!parts.empty()) parts.pop_back();
  if (!parts.empty()) text = Join(parts, ", ") + " and " + text;
  const std::vector<std::string> cameras = NamesOf(failure, "of_camera");
  const std::vector<std::string> targets = NamesOf(failure, "of_target");
  std::vector<std::string> images;
  for (size_t i = 0; i < cameras.size(); ++i) images.push_back("camera " + cameras[i] + " with target " + targets[i]);
  return text + (is_one ? " is" : " are") + " not joined to the rest by any image: " +
         (images.empty() ? "a camera of both must see one target" : "images are needed of " + Join(images, " or "));
}

std::string CameraWithoutTarget(const Failure& failure, ConfigKeys keys) {
  const std::vector<std::string> targets = NamesOf(failure, "target");
  return Fill("camera {camera} saw no target in any image, so that nothing joins it to the rest: the rig has ", failure,
              keys) +
         (targets.size() == 1 ? "target " : "targets ") + Join(targets, ", ") +
         "; add the one that it sees, or leave the camera out";
}

std::string ShiftedImages(const Failure& failure, ConfigKeys keys) {
  const double shift = Number(failure, "shift");
  const std::string places = std::abs(shift) == 1 ? "one place" : Fixed(std::abs(shift), 0) + " places";
  return Fill("the images of camera {camera} fit the poses of the captures ", failure, keys) + places +
         (shift > 0 ? " after" : " before") +
         " their own: its images are shifted against the poses; check which image is its first";
}

std::string NoPose(const Failure& failure, ConfigKeys keys) {
  return Fill(failure.numbers.empty() ? "the points that the cameras see do not determine a pose of the target"
                                      : "the {points} visible points do not determine the target's pose",
              failure, keys);
}

std::string OfPixel(const Failure& failure, ConfigKeys keys) {
  return Fill(
      HasName(failure, "camera") ? "pixel {u:6}, {v:6} of camera {camera}: {cause}" : "pixel {u:6}, {v:6}: {cause}",
      failure, keys);
}

std::string NothingDetected(const Failure& failure, ConfigKeys keys) {
  return Fill("the target was not detected in any of the {images} images", failure, keys) +
         (HasName(failure, "why") ? Fill(" ({image}: {why})", failure, keys) : "") +
         Fill("; is it the target< that the config names>?", failure, keys);
}

struct CodeWords {
  std::string_view code;
  std::string_view text;  // See Fill; empty if there is a function.
  std::string (*words)(const Failure& failure, ConfigKeys keys) = nullptr;
};

constexpr CodeWords kWords[] = {
    {"not_run", "not run"},
    {"cancelled", "the run was cancelled"},
    // The motion and the closed forms.
    {"few_captures", "at least 3 captures with the target are needed, there {captures?is|are} {captures}"},
    {"no_rotation",
     "the robot did not rotate between the captures ({rms_deg.2} deg rms), so the hand-eye pose is undetermined; "
     "rotate the gripper about two different axes by 20 deg or more"},
    {"one_axis",
     "the robot rotated about one axis only ({rms_deg.1} deg rms about [{x.2}, {y.2}, {z.2}], {other_deg.2} deg about "
     "any other), so the translation of the hand-eye pose along that axis is undetermined; rotate the gripper about a "
     "second axis by 20 deg or more"},
    {"no_solution", "the {equations} equations have no solution"},
    {"not_a_rotation", "the linear solution is not a rotation (the translations hardly determine the scale)"},
    {"bad_covariance", "the covariance of a target position is not positive definite"},
    {"weak_positions", "the positions of the target do not determine the hand-eye pose"},
    {"no_home",
     "no capture has the role home (home pose of the two-step motion), and none can be identified from the robot "
     "poses"},
    {"no_translation",
     "no capture moves the tool along its {axis} alone (role translate_{axis}): add one, 50 mm or more from home "
     "without rotation"},
    {"few_rotations",
     "{rotations} {rotations?rotation|rotations} about the tool point (role rotate) rotate the least observable "
     "direction by {least_deg.2} deg in total: two or more about different axes, by 10 deg or more, are needed"},
    {"no_closed_form", "no closed form has a result"},
    {"target_behind", "every closed form puts the target behind the camera; check setup and pose direction"},
    {"no_pixels", "poses of the target are given, not its points: bundle adjustment needs images or corners"},
    {"few_tilts",
     "the images show the target in one orientation, or turned about one axis only; tilt it about two axes"},
    {"few_touches", "at least 3 poses that touch one point are needed, there {poses?is|are} {poses}"},
    {"one_touch_axis",
     "the poses differ by rotations about one axis only, [{x.2}, {y.2}, {z.2}] of the gripper, which leaves the tip "
     "along it open; "
     "tilt the tool about two axes, by 20 deg or more"},
    // The intrinsics.
    {"no_camera", "the captures do not determine a camera; give a camera file< (camera.intrinsics)>"},
    {"intrinsics_failed", "the camera's intrinsics could not be estimated; give a camera file< (camera.intrinsics)>"},
    {"implausible_camera", "the estimated camera is implausible ({faults}); give a camera file"},
    {"few_captures_of_camera",
     "the camera cannot be calibrated from {captures} captures; use 3 or more, or a camera file< (camera.intrinsics)>"},
    {"undistorted", "a lens without distortion is taken only if none with distortion can be estimated"},
    // The refinement.
    {"no_points", "no image has points of a target"},
    {"hidden_at_start", "", &HiddenAtStart},
    {"hidden_point", "the refined estimate leaves a point of the target without an image"},
    {"no_information", "", &NoInformation},
    {"undetermined", "", &Undetermined},
    {"large_sigma", "", &LargeSigma},
    {"implausible_refined_camera", "", &ImplausibleRefinedCamera},
    {"not_converged", "the refinement did not converge: {message}"},
    {"chain_not_converged", "did not converge: {message}"},
    {"poses_not_converged", "the refinement of the poses did not converge"},
    {"few_coordinates",
     "{coordinates} measured coordinates for {unknowns} unknowns are too few; take more captures or hold the "
     "intrinsics"},
    {"points_contradict", "nearly all points contradict the estimate; check that images and poses belong together"},
    {"no_error_model", "no model of the errors could be fitted"},
    {"of_fold", "fold {fold}: {cause}"},
    {"hidden_held_out", "a held-out target lies behind the camera"},
    {"no_held_out_pose", "no held-out image of it determines a pose of a target"},
    // Several cameras, targets and arms.
    {"of_camera", "camera {camera}: {cause}"},
    {"ambiguous_part",
     "the images allow {poses} poses of {part}, because target {target} looks the same in {symmetries} orientations "
     "and no other images distinguish them; use a target without symmetry, or record images of another target that "
     "join {part} to the rest"},
    {"arm_carries_nothing",
     "arm {arm} carries no camera and no target, so that no image joins it to the rest; give one the mount "
     "{mount}{arms?|, or leave the arm out}"},
    {"pair_without_pose",
     "camera {camera} and target {target} ({images} {images?image|images}): no image shows enough points for the pose "
     "of the target, and no other images join {part} to the rest"},
    {"pair_failed",
     "camera {camera} and target {target} ({images} {images?image|images}) could not be calibrated, and no other "
     "images join them to the rest: {cause}"},
    {"on_two_arms", "they are on two arms; each needs images with something else, for example a fixed target"},
    {"not_joined", "", &NotJoined},
    {"camera_without_target", "", &CameraWithoutTarget},
    {"unseen_target", "no camera saw target {target} in any image"},
    {"no_target_in_view", "no camera sees a target"},
    {"shifted_images", "", &ShiftedImages},
    // The errors of arms.
    {"few_planned",
     "{found} poses were found from which the camera sees the target, but {wanted} are needed; of {drawn} that were "
     "drawn, {outside} lie outside of the workspace or where the robot must not be, in {unseen} the target is not seen "
     "for certain, and {unreached} are out of the reach of the arm or of its joints; check hand_eye and board, or make "
     "the workspace larger, the uncertainty smaller or the target smaller"},
    {"no_planned_depth",
     "the target fits into the image, and its points lie far enough apart, at depths from {from_mm} to {to_mm} mm, "
     "none of "
     "which is within plan.lens.depth_of_field; use another lens or a target of another size"},
    {"no_planned_place", "the camera sees a target at none of the positions of evaluate.require"},
    {"few_captures_of_arm", "the captures are too few to distinguish the errors of the arm from those of its poses"},
    {"no_better_than_noise",
     "'{errors}' is not significantly better than the noise of the poses alone (log-likelihood higher by {gain:2} with "
     "{parameters} more parameters)"},
    {"no_better_model",
     "'{model}' is not significantly better than '{chosen}' (log-likelihood higher by {gain:2} with {parameters} more "
     "parameters)"},
    {"held_arm_noise",
     "the errors of an arm are estimated beside the noise of its poses, which <refine.robot_noise holds|is held>"},
    {"idle_arm", "the arm moves no target against a camera"},
    {"no_configuration_fits", "the errors of the arm could be fitted in none of its configurations"},
    {"arm_refinement_failed", "the refinement with the arm's errors failed: {cause}"},
    {"tool_scatter",
     "the recorded joints of capture {capture} put the tool {apart_mm:3} mm and {apart_deg:3} deg from where those of "
     "the others do; check <robot.model, joint_angle, and >that joints and poses belong together<; heba doctor says "
     "which>"},
    {"tool_not_explained",
     "the tool that the recorded joints imply scatters by {scatter_mm:2} mm, which errors of the arm {arm} do not "
     "explain "
     "({unexplained_mm:2} mm remain): another arm, or joints that belong to other poses<; heba doctor says which>"},
    {"little_explained",
     "they explain little: the noise of the poses falls only from {before_mm:2} mm and {before_deg:2} deg to "
     "{after_mm:2} "
     "mm and {after_deg:2} deg"},
    {"no_posture_near", "no posture near <joints_near|the given joints> continues to the poses of all captures"},
    {"near_out_of_reach",
     "the arm {arm} does not reach the pose of the first capture in the configuration of <robot.joints_near|the given "
     "joints>"},
    {"out_of_reach",
     "the arm {arm} does not reach the pose of capture {capture} ({cause}): another arm, a base frame that is not the "
     "arm's, or a tool that <robot.tool does not state; heba doctor says which|is not stated>"},
    {"nameless_configurations",
     "the configurations of the arm {arm} have no names, so that poses do not determine its joints; record them< "
     "(captures.joints)>, or state those of the first capture< (robot.joints_near)>"},
    {"no_masses", "the masses of the arm's links are not known, which the compliance of its joints needs"},
    {"kinematics_not_wanted", "<refine.kinematics is none|they are not wanted>"},
    {"record_joints",
     "{cause}; if the captures are in several configurations, record their joints< (captures.joints)>"},
    // The location of targets and pixels.
    {"no_target", "no target was detected in these images"},
    {"few_detected", "{why}"},
    {"no_pose", "", &NoPose},
    {"not_finite", "the position or its uncertainty is not a finite number; do not use this result"},
    {"of_pixel", "", &OfPixel},
    {"no_ray", "no ray belongs to this pixel"},
    {"camera_without_ray", "camera {camera} has no ray at this pixel"},
    {"ray_beside_plane", "its ray does not meet the plane"},
    {"plane_behind", "its ray does not meet the plane in front of the camera"},
    {"one_camera", "a point needs its pixels in at least two cameras"},
    {"parallel_rays", "the rays of the pixels are parallel: they do not determine a point"},
    {"rays_behind", "the rays of the pixels do not meet in front of the cameras"},
    // The check of a later session.
    {"no_part_told",
     "the images do not tell whether anything has moved; more images, at other orientations of the gripper, do"},
    // The detection.
    {"all_left_out", "{notes}"},
    {"nothing_detected", "", &NothingDetected},
};

constexpr const CodeWords* WordsOf(std::string_view code) {
  for (const CodeWords& entry : kWords) {
    if (entry.code == code) return &entry;
  }
  return nullptr;
}

constexpr bool EachCodeHasWords() {
  for (const std::string_view code : kFailureCodes) {
    const CodeWords* const entry = WordsOf(code);
    if (entry == nullptr || (entry->text.empty() && entry->words == nullptr)) return false;
  }
  return true;
}
static_assert(EachCodeHasWords() && std::size(kWords) == std::size(kFailureCodes));

}  // namespace

std::string UnknownText(std::string_view name) {
  for (const OwnerWords& owner : kOwners) {
    if (!owner.alone.empty() && name.starts_with(owner.alone)) {
      return std::string(owner.plain_alone) + " " + ParameterText(name.substr(owner.alone.size()), owner.frame);
    }
    const size_t end = name.find(owner.after);
    if (!name.starts_with(owner.before) || end == std::string_view::npos) continue;
    return std::string(owner.plain_kind) + " " +
           std::string(name.substr(owner.before.size(), end - owner.before.size())) + "'s " +
           ParameterText(name.substr(end + owner.after.size()), owner.frame);
  }
  return std::string(name);
}

std::string FailureText(const Failure& failure, ConfigKeys keys) {
  const CodeWords* entry = failure.text.empty() ? WordsOf(failure.code) : nullptr;
  if (entry == nullptr) return failure.ToString();
  return entry->words != nullptr ? entry->words(failure, keys) : Fill(entry->text, failure, keys);
}

}  // namespace heba
