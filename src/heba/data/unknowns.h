// The layout of the unknowns of an adjustment: the place, the name, the unit and the group of every coordinate of a
// step, a normal matrix or a covariance. The places of unknowns are defined here and nowhere else.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/shared_effects.h"

namespace heba {

// The groups in which limits and messages are stated, and hence the units: m for kTranslation and kBend, rad for
// kRotation, px for kFocal and kPrincipalPoint; the others have no unit or one of their own (kEffect).
enum class UnknownGroup {
  kTranslation,
  kRotation,
  kEffect,
  kFocal,
  kPrincipalPoint,
  kDistortion,
  kScale,
  kBend,
};

// One unknown number.
struct Unknown {
  UnknownGroup group = UnknownGroup::kTranslation;
  int index = 0;  // Index among all parameters of its owner, free or not; for a pose, of the tangent.
};

// The kind of object that a block of unknowns belongs to.
enum class UnknownOwner { kPose, kEffects, kCamera, kTarget };

// The unknowns of one owner, at consecutive places.
struct UnknownBlock {
  UnknownOwner owner = UnknownOwner::kPose;
  std::string name;                    // In files: the part of the names before the dot.
  const CameraModel* model = nullptr;  // A camera's.
  std::vector<std::string> effects;    // The names of effects.
  Eigen::Index first = 0;
  Eigen::Index size = 0;

  Eigen::Index end() const { return first + size; }
};

// The names of the poses' and the target's owners in the adjustment of a single camera.
inline constexpr std::string_view kHandEyeBlock = "hand_eye";
inline constexpr std::string_view kBoardBlock = "board";
inline constexpr std::string_view kRobotBlock = "robot";
inline constexpr std::string_view kCameraBlock = "camera";
inline constexpr std::string_view kTargetBlock = "target";

// Unknowns in the order in which they were added. Blocks without unknowns are kept: their size is 0.
class UnknownLayout {
 public:
  // Adds the tangent (translation before rotation, in the child frame) of the pose `name`.
  void AddPose(std::string_view name);
  // Adds effects, called "<name>.<effect>".
  void AddEffects(std::string_view name, const std::vector<std::string>& effects);
  // Adds the camera's parameters whose flag is set. The model must outlive the layout.
  void AddCamera(std::string_view name, const CameraModel& model, const std::vector<bool>& free);
  // Adds the shape parameters whose flag is set (TargetShape::params); `free` may be empty.
  void AddTarget(std::string_view name, const std::vector<bool>& free);

  Eigen::Index size() const { return static_cast<Eigen::Index>(unknowns_.size()); }
  const Unknown& operator[](Eigen::Index place) const { return unknowns_[static_cast<size_t>(place)]; }
  const std::vector<UnknownBlock>& blocks() const { return blocks_; }
  // Returns the name of an unknown in files: "hand_eye.tx_m".
  std::string Name(Eigen::Index place) const;
  std::vector<std::string> Names() const;

  // Returns the block of that name; its size is 0 if there is none.
  UnknownBlock Block(std::string_view name) const;
  // Returns the blocks of a kind of owner, in their order.
  std::vector<UnknownBlock> BlocksOf(UnknownOwner owner) const;
  // Returns the owner of an unknown.
  const UnknownBlock& BlockAt(Eigen::Index place) const;
  // Returns the place of the unknown of that name, or nothing.
  std::optional<Eigen::Index> Place(std::string_view name) const;

 private:
  UnknownBlock& AddBlock(UnknownOwner owner, std::string_view name);

  std::vector<Unknown> unknowns_;
  std::vector<UnknownBlock> blocks_;
};

// The unknowns of a hand-eye calibration besides its two poses.
struct FreeUnknowns {
  // One flag per camera parameter and, only if any parameter of the target's shape is free, one per shape parameter
  // after them; true if the parameter is unknown.
  std::vector<bool> params;
  std::shared_ptr<const SharedEffects> effects;  // The robot's errors; null if there are none.

  FreeUnknowns(std::vector<bool> free_params,  // NOLINT(google-explicit-constructor): most have no effects.
               std::shared_ptr<const SharedEffects> shared_effects = nullptr)
      : params(std::move(free_params)), effects(std::move(shared_effects)) {}
};

// Returns the layout of a hand-eye calibration: hand-eye pose, board pose, the robot's errors if there are any, and the
// free parameters of the camera and of the target's shape.
UnknownLayout HandEyeUnknowns(const CameraModel& model, const FreeUnknowns& free);
// Returns the layout of the two poses alone, as of a refinement of poses.
UnknownLayout HandEyePoses();

}  // namespace heba
