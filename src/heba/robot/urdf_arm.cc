#include "heba/robot/urdf_arm.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

KDL::Vector ToKdl(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

KDL::Frame ToKdl(const urdf::Pose& pose) {
  return {KDL::Rotation::Quaternion(pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w),
          ToKdl(pose.position)};
}

bool IsTurningJoint(const urdf::Joint& joint) {
  return joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
}

// Converts a joint to KDL's convention: the motion about an axis in the parent's frame, then the pose of the child.
KDL::Segment ToKdl(const urdf::Joint& joint) {
  const KDL::Frame origin = ToKdl(joint.parent_to_joint_origin_transform);
  const KDL::Vector axis = origin.M * ToKdl(joint.axis);
  KDL::Joint::JointType type = KDL::Joint::None;
  if (IsTurningJoint(joint)) type = KDL::Joint::RotAxis;
  if (joint.type == urdf::Joint::PRISMATIC) type = KDL::Joint::TransAxis;
  const KDL::Joint moving =
      type == KDL::Joint::None ? KDL::Joint(joint.name, type) : KDL::Joint(joint.name, origin.p, axis, type);
  return KDL::Segment(joint.child_link_name, moving, origin);
}

Rigid3d FromKdl(const KDL::Frame& frame) {
  Eigen::Quaterniond rotation;
  frame.M.GetQuaternion(rotation.x(), rotation.y(), rotation.z(), rotation.w());
  return Rigid3d(rotation, Eigen::Vector3d(frame.p.x(), frame.p.y(), frame.p.z()));
}

// The limits of a joint that has none.
constexpr JointLimits kWithoutEnd = {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};

class KdlArm final : public UrdfArm {
 public:
  // `links_in_base` are the bodies that move with each joint; empty if their masses are not known.
  KdlArm(const KDL::Chain& chain, std::vector<std::string> names, std::vector<bool> turns,
         std::vector<JointLimits> limits, std::vector<PointMass> links_in_base)
      : chain_(chain),
        names_(std::move(names)),
        turns_(std::move(turns)),
        limits_(std::move(limits)),
        links_in_base_(std::move(links_in_base)) {}

  const std::vector<std::string>& joint_names() const override { return names_; }
  bool IsTurning(size_t i) const override { return turns_[i]; }

  Rigid3d BaseFromTip(std::span<const double> joints) const override {
    CHECK_EQ(joints.size(), names_.size());
    KDL::JntArray array(static_cast<unsigned>(joints.size()));
    for (size_t i = 0; i < joints.size(); ++i) array(static_cast<unsigned>(i)) = joints[i];
    KDL::ChainFkSolverPos_recursive solver(chain_);
    KDL::Frame frame;
    CHECK_EQ(solver.JntToCart(array, frame), 0);
    return FromKdl(frame);
  }

  Arm Kinematics() const override {
    std::vector<ArmAxis> axes;
    KDL::Frame base_from_link = KDL::Frame::Identity();
    for (unsigned i = 0; i < chain_.getNrOfSegments(); ++i) {
      const KDL::Segment& segment = chain_.getSegment(i);
      const KDL::Joint& joint = segment.getJoint();
      if (joint.getType() != KDL::Joint::None) {
        const KDL::Vector axis = base_from_link.M * joint.JointAxis();
        const KDL::Vector point = base_from_link * joint.JointOrigin();
        axes.push_back({Eigen::Vector3d(axis.x(), axis.y(), axis.z()).normalized(),
                        Eigen::Vector3d(point.x(), point.y(), point.z()), turns_[axes.size()]});
      }
      base_from_link = base_from_link * segment.pose(0);
    }
    Arm arm = ArmFromAxes("", axes, FromKdl(base_from_link));
    arm.limits = limits_;
    return links_in_base_.empty() ? arm : WithLinksInBase(arm, links_in_base_);
  }

 private:
  KDL::Chain chain_;
  std::vector<std::string> names_;
  std::vector<bool> turns_;
  std::vector<JointLimits> limits_;
  std::vector<PointMass> links_in_base_;
};

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
      const urdf::Vector3& at = link->inertial->origin.position;
      const double mass_kg = link->inertial->mass;
      const Eigen::Vector3d centre_m = base_from_link * Eigen::Vector3d(at.x, at.y, at.z);
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
      waiting.emplace_back(*child, base_from_link * FromKdl(ToKdl(joint->parent_to_joint_origin_transform)));
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
    base_from_link = base_from_link * FromKdl(ToKdl(joints[i]->parent_to_joint_origin_transform));
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
  const urdf::Vector3& axis = joint.axis;
  const urdf::Vector3& origin = joint.parent_to_joint_origin_transform.position;
  const double axis_length = std::hypot(axis.x, axis.y, axis.z);
  const double distance_m = std::hypot(origin.x, origin.y, origin.z);
  constexpr double kFarthestM = 1e6;
  if (!(distance_m < kFarthestM) || (joint.type != urdf::Joint::FIXED && !(axis_length > 1e-6 && axis_length < 1e6))) {
    throw InputError(path.string() + ": joint " + Quoted(joint.name) +
                     " has no axis, or its origin is absurdly far away");
  }
}

}  // namespace

std::shared_ptr<const UrdfArm> UrdfArm::Read(const std::filesystem::path& path, const std::string& base_link,
                                             const std::string& tip_link) {
  const urdf::ModelInterfaceSharedPtr model = ParseModel(path);
  const LinkRings rings{model};
  if (!model || !model->getRoot()) throw InputError(path.string() + ": is not a URDF; xacro must be expanded first");
  const std::string base = base_link.empty() ? model->getRoot()->name : base_link;
  const std::string tip = tip_link.empty() ? FindTip(*model, path) : tip_link;
  for (const std::string& name : {base, tip}) CheckLink(*model, name, path);
  const std::vector<urdf::JointConstSharedPtr> joints = JointsBetween(*model, base, tip, path);
  KDL::Chain chain;
  std::vector<std::string> moving;
  std::vector<bool> turns;
  std::vector<JointLimits> limits;
  for (const urdf::JointConstSharedPtr& joint : joints) {
    CheckJoint(*joint, path);
    chain.addSegment(ToKdl(*joint));
    if (joint->type == urdf::Joint::FIXED) continue;
    moving.push_back(joint->name);
    turns.push_back(IsTurningJoint(*joint));
    // Files that state no positions have zero for both.
    const bool has_limits =
        joint->type != urdf::Joint::CONTINUOUS && joint->limits && joint->limits->lower < joint->limits->upper;
    limits.push_back(has_limits ? JointLimits{joint->limits->lower, joint->limits->upper} : kWithoutEnd);
  }
  if (moving.empty()) {
    throw InputError(path.string() + ": no joint moves between " + Quoted(base) + " and " + Quoted(tip));
  }
  return std::make_shared<KdlArm>(std::move(chain), std::move(moving), std::move(turns), std::move(limits),
                                  BodiesOf(*model, joints, path));
}

}  // namespace heba
