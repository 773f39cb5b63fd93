#include "heba/robot/urdf_arm.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

Eigen::Vector3d VectorOf(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

// Returns the pose of the frame that follows a joint at zero, in the link before it.
Rigid3d LinkFromJoint(const urdf::Joint& joint) {
  const urdf::Pose& pose = joint.parent_to_joint_origin_transform;
  const Eigen::Quaterniond rotation(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  return Rigid3d(rotation.normalized(), VectorOf(pose.position));
}

bool IsTurningJoint(const urdf::Joint& joint) {
  return joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
}

// The limits of a joint that has none.
constexpr JointLimits kWithoutEnd = {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};

// Returns a body with the mass of a link and of all links beyond it, but for `next`. The joints beyond it are at zero.
PointMass WithUrdfLinks(PointMass body, const urdf::LinkConstSharedPtr& first, const Rigid3d& base_from_first,
                        const urdf::LinkConstSharedPtr& next, const std::filesystem::path& path) {
  std::vector<std::pair<urdf::LinkConstSharedPtr, Rigid3d>> waiting = {{first, base_from_first}};
  // Links whose joints form a loop would be visited for ever.
  std::set<const urdf::Link*> visited;
  while (!waiting.empty()) {
    const auto [link, base_from_link] = waiting.back();
    waiting.pop_back();
    if (link == next || !visited.insert(link.get()).second) continue;
    if (link->inertial) {
      const double mass_kg = link->inertial->mass;
      const Eigen::Vector3d centre_m = base_from_link * VectorOf(link->inertial->origin.position);
      constexpr double kLargest = 1e4;  // kg and m.
      if (!(mass_kg >= 0 && mass_kg < kLargest) || !(centre_m.norm() < kLargest)) {
        throw InputError(path.string() + ": link " + Quoted(link->name) + " has an impossible mass or centre of mass");
      }
      const double all_kg = body.mass_kg + mass_kg;
      if (all_kg > 0) body.centre_m = (body.mass_kg * body.centre_m + mass_kg * centre_m) / all_kg;
      body.mass_kg = all_kg;
    }
    for (const urdf::JointSharedPtr& joint : link->child_joints) {
      const auto child = std::find_if(link->child_links.begin(), link->child_links.end(),
                                      [&](const auto& other) { return other->name == joint->child_link_name; });
      if (child == link->child_links.end()) continue;
      waiting.emplace_back(*child, base_from_link * LinkFromJoint(*joint));
    }
  }
  return body;
}

// Returns the bodies that move with each moving joint of a chain, in the base when all joints are at zero; nothing if
// none of them has a mass.
std::vector<PointMass> BodiesOf(const urdf::ModelInterface& model, const std::vector<urdf::JointConstSharedPtr>& joints,
                                const std::filesystem::path& path) {
  std::vector<PointMass> bodies;
  Rigid3d base_from_link;
  for (size_t i = 0; i < joints.size(); ++i) {
    if (joints[i]->type != urdf::Joint::FIXED) bodies.emplace_back();
    base_from_link = base_from_link * LinkFromJoint(*joints[i]);
    if (bodies.empty()) continue;
    const urdf::LinkConstSharedPtr next =
        i + 1 < joints.size() ? model.getLink(joints[i + 1]->child_link_name) : nullptr;
    bodies.back() = WithUrdfLinks(bodies.back(), model.getLink(joints[i]->child_link_name), base_from_link, next, path);
  }
  const bool is_known =
      std::any_of(bodies.begin(), bodies.end(), [](const PointMass& body) { return body.mass_kg > 0; });
  return is_known ? bodies : std::vector<PointMass>();
}

std::string FindTip(const urdf::ModelInterface& model, const std::filesystem::path& path) {
  std::vector<std::string> leaves;
  for (const auto& [name, link] : model.links_) {
    if (link->child_links.empty()) leaves.push_back(name);
  }
  if (leaves.size() != 1) {
    throw InputError(path.string() + ": has " + std::to_string(leaves.size()) +
                     " links without a child; name the flange (tip_link), one of: " + Join(leaves, ", "));
  }
  return leaves.front();
}

// Returns the largest nesting depth of the elements of an XML text.
int DepthOf(std::string_view text) {
  int depth = 0;
  int deepest = 0;
  for (size_t i = 0; i + 1 < text.size(); ++i) {
    const char next = text[i + 1];
    const bool ends = (text[i] == '<' && next == '/') || (text[i] == '/' && next == '>');
    if (ends) {
      --depth;
    } else if (text[i] == '<' && next != '!' && next != '?') {
      deepest = std::max(deepest, ++depth);
    }
  }
  return deepest;
}

// Frees a model at the end of a scope, also if its joints form a loop: links own their children, so that a loop of them
// would never be freed.
struct LinkRings {
  urdf::ModelInterfaceSharedPtr model;
  explicit LinkRings(urdf::ModelInterfaceSharedPtr model_in) : model(std::move(model_in)) {}
  LinkRings(const LinkRings&) = delete;
  LinkRings& operator=(const LinkRings&) = delete;
  ~LinkRings() {
    if (!model) return;
    for (const auto& entry : model->links_) entry.second->child_links.clear();
  }
};

// Throws InputError for text on which the XML parser would fail: it reads beyond the end of truncated UTF-8 characters,
// and its recursion is as deep as the elements are nested.
void CheckXml(const std::filesystem::path& path, const std::string& text) {
  constexpr int kMaxDepth = 100;
  if (!IsUtf8(text) || text.find('\0') != std::string::npos)
    throw InputError(path.string() + ": is not a URDF: not UTF-8");
  if (DepthOf(text) > kMaxDepth) throw InputError(path.string() + ": is not a URDF: elements are nested too deeply");
}

// Returns the model of a file; it may be null or have no root.
urdf::ModelInterfaceSharedPtr ParseModel(const std::filesystem::path& path) {
  constexpr size_t kMaxBytes = size_t{16} << 20;
  const std::string text = ReadTextFile(path, kMaxBytes);
  CheckXml(path, text);
  // The parser would otherwise print messages to the terminal.
  console_bridge::noOutputHandler();
  try {
    return urdf::parseURDF(text);
  } catch (const std::exception& error) {
    throw InputError(path.string() + ": is not a URDF: " + Quoted(error.what()));
  }
}

void CheckLink(const urdf::ModelInterface& model, const std::string& name, const std::filesystem::path& path) {
  if (model.getLink(name)) return;
  std::vector<std::string> names;
  for (const auto& entry : model.links_) names.push_back(entry.first);
  throw InputError(path.string() + ": has no link " + Quoted(name) + DidYouMean(name, names));
}

// Returns the joints that lead from one link to another, in their order.
std::vector<urdf::JointConstSharedPtr> JointsBetween(const urdf::ModelInterface& model, const std::string& base,
                                                     const std::string& tip, const std::filesystem::path& path) {
  std::vector<urdf::JointConstSharedPtr> joints;
  for (urdf::LinkConstSharedPtr link = model.getLink(tip); link->name != base; link = link->getParent()) {
    if (!link->parent_joint) {
      throw InputError(path.string() + ": link " + Quoted(tip) + " is not connected to " + Quoted(base));
    }
    if (joints.size() == model.joints_.size()) {
      throw InputError(path.string() + ": the joints that lead to link " + Quoted(tip) + " form a loop");
    }
    joints.push_back(link->parent_joint);
  }
  std::reverse(joints.begin(), joints.end());
  return joints;
}

// Throws InputError for a joint whose motion is not known.
void CheckJoint(const urdf::Joint& joint, const std::filesystem::path& path) {
  const bool is_sliding = joint.type == urdf::Joint::PRISMATIC;
  if (!IsTurningJoint(joint) && !is_sliding && joint.type != urdf::Joint::FIXED) {
    throw InputError(path.string() + ": joint " + Quoted(joint.name) +
                     " is neither revolute, continuous, prismatic nor fixed");
  }
  if (joint.mimic) {
    throw InputError(path.string() + ": joint " + Quoted(joint.name) + " mimics another joint, which is not supported");
  }
  const double axis_length = VectorOf(joint.axis).norm();
  const double distance_m = VectorOf(joint.parent_to_joint_origin_transform.position).norm();
  constexpr double kFarthestM = 1e6;
  if (!(distance_m < kFarthestM) || (joint.type != urdf::Joint::FIXED && !(axis_length > 1e-6 && axis_length < 1e6))) {
    throw InputError(path.string() + ": joint " + Quoted(joint.name) +
                     " has no axis, or its origin is absurdly far away");
  }
}

}  // namespace

UrdfArm ReadUrdfArm(const std::filesystem::path& path, const std::string& base_link, const std::string& tip_link) {
  const urdf::ModelInterfaceSharedPtr model = ParseModel(path);
  const LinkRings rings{model};
  if (!model || !model->getRoot()) throw InputError(path.string() + ": is not a URDF; xacro must be expanded first");
  const std::string base = base_link.empty() ? model->getRoot()->name : base_link;
  const std::string tip = tip_link.empty() ? FindTip(*model, path) : tip_link;
  for (const std::string& name : {base, tip}) CheckLink(*model, name, path);
  const std::vector<urdf::JointConstSharedPtr> joints = JointsBetween(*model, base, tip, path);
  UrdfArm urdf;
  std::vector<ArmAxis> axes;
  std::vector<JointLimits> limits;
  Rigid3d base_from_link;
  for (const urdf::JointConstSharedPtr& joint : joints) {
    CheckJoint(*joint, path);
    base_from_link = base_from_link * LinkFromJoint(*joint);
    if (joint->type == urdf::Joint::FIXED) continue;
    urdf.joint_names.push_back(joint->name);
    axes.push_back({base_from_link.rotation * VectorOf(joint->axis).normalized(), base_from_link.translation,
                    IsTurningJoint(*joint)});
    // Files that state no positions have zero for both.
    const bool has_limits =
        joint->type != urdf::Joint::CONTINUOUS && joint->limits && joint->limits->lower < joint->limits->upper;
    limits.push_back(has_limits ? JointLimits{joint->limits->lower, joint->limits->upper} : kWithoutEnd);
  }
  constexpr size_t kMostJoints = 100;
  if (axes.size() > kMostJoints) {
    throw InputError(path.string() + ": " + std::to_string(axes.size()) + " joints move between " + Quoted(base) +
                     " and " + Quoted(tip) + "; at most " + std::to_string(kMostJoints) + " can");
  }
  if (axes.empty()) {
    throw InputError(path.string() + ": no joint moves between " + Quoted(base) + " and " + Quoted(tip));
  }
  urdf.arm = ArmFromAxes("", axes, base_from_link);
  urdf.arm.limits = std::move(limits);
  std::vector<PointMass> bodies = BodiesOf(*model, joints, path);
  if (!bodies.empty()) urdf.arm = WithLinksInBase(std::move(urdf.arm), std::move(bodies));
  return urdf;
}

}  // namespace heba
