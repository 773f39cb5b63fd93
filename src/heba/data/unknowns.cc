#include "heba/data/unknowns.h"

#include <algorithm>

#include "heba/base/error.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

constexpr Eigen::Index kPoseSize = static_cast<Eigen::Index>(kTangentNames.size());

UnknownGroup GroupOfCameraParam(int param) {
  switch (GroupOf(param)) {
    case ParameterGroup::kFocal:
      return UnknownGroup::kFocal;
    case ParameterGroup::kPrincipalPoint:
      return UnknownGroup::kPrincipalPoint;
    case ParameterGroup::kDistortion:
      break;
  }
  return UnknownGroup::kDistortion;
}

}  // namespace

UnknownBlock& UnknownLayout::AddBlock(UnknownOwner owner, std::string_view name) {
  UnknownBlock& block = blocks_.emplace_back();
  block.owner = owner;
  block.name = name;
  block.first = size();
  return block;
}

void UnknownLayout::AddPose(std::string_view name) {
  UnknownBlock& block = AddBlock(UnknownOwner::kPose, name);
  block.size = kPoseSize;
  for (int i = 0; i < kPoseSize; ++i) {
    unknowns_.push_back({i < 3 ? UnknownGroup::kTranslation : UnknownGroup::kRotation, i});
  }
}

void UnknownLayout::AddEffects(std::string_view name, const std::vector<std::string>& effects) {
  UnknownBlock& block = AddBlock(UnknownOwner::kEffects, name);
  block.effects = effects;
  block.size = static_cast<Eigen::Index>(effects.size());
  for (int i = 0; i < block.size; ++i) unknowns_.push_back({UnknownGroup::kEffect, i});
}

void UnknownLayout::AddCamera(std::string_view name, const CameraModel& model, const std::vector<bool>& free) {
  CHECK_EQ(free.size(), static_cast<size_t>(NumParams(model)));
  UnknownBlock& block = AddBlock(UnknownOwner::kCamera, name);
  block.model = &model;
  for (int i = 0; i < NumParams(model); ++i) {
    if (free[static_cast<size_t>(i)]) unknowns_.push_back({GroupOfCameraParam(i), i});
  }
  block.size = size() - block.first;
}

void UnknownLayout::AddTarget(std::string_view name, const std::vector<bool>& free) {
  CHECK(free.empty() || free.size() == TargetShape::kNumParams);
  UnknownBlock& block = AddBlock(UnknownOwner::kTarget, name);
  for (size_t i = 0; i < free.size(); ++i) {
    const auto param = static_cast<int>(i);
    const bool is_scale = ShapeGroupOf(param) == TargetShapeGroup::kScale;
    if (free[i]) unknowns_.push_back({is_scale ? UnknownGroup::kScale : UnknownGroup::kBend, param});
  }
  block.size = size() - block.first;
}

std::string UnknownLayout::Name(Eigen::Index place) const {
  const UnknownBlock& block = BlockAt(place);
  const auto index = static_cast<size_t>((*this)[place].index);
  const std::string owner = block.name + ".";
  switch (block.owner) {
    case UnknownOwner::kPose:
      return owner + std::string(kTangentNames[index]);
    case UnknownOwner::kEffects:
      return owner + block.effects[index];
    case UnknownOwner::kCamera:
      return owner + block.model->param_names()[index];
    case UnknownOwner::kTarget:
      break;
  }
  return owner + std::string(kTargetShapeParamNames[index]);
}

std::vector<std::string> UnknownLayout::Names() const {
  std::vector<std::string> names;
  for (Eigen::Index i = 0; i < size(); ++i) names.push_back(Name(i));
  return names;
}

std::vector<UnknownBlock> UnknownLayout::BlocksOf(UnknownOwner owner) const {
  std::vector<UnknownBlock> blocks;
  for (const UnknownBlock& block : blocks_) {
    if (block.owner == owner) blocks.push_back(block);
  }
  return blocks;
}

UnknownBlock UnknownLayout::Block(std::string_view name) const {
  const auto found =
      std::find_if(blocks_.begin(), blocks_.end(), [&](const UnknownBlock& block) { return block.name == name; });
  if (found != blocks_.end()) return *found;
  UnknownBlock none;
  none.name = name;
  none.first = size();
  return none;
}

const UnknownBlock& UnknownLayout::BlockAt(Eigen::Index place) const {
  const auto found = std::find_if(blocks_.begin(), blocks_.end(), [&](const UnknownBlock& block) {
    return block.first <= place && place < block.end();
  });
  CHECK(found != blocks_.end());
  return *found;
}

std::optional<Eigen::Index> UnknownLayout::Place(std::string_view name) const {
  for (Eigen::Index i = 0; i < size(); ++i) {
    if (Name(i) == name) return i;
  }
  return std::nullopt;
}

UnknownLayout HandEyePoses() {
  UnknownLayout layout;
  layout.AddPose(kHandEyeBlock);
  layout.AddPose(kBoardBlock);
  return layout;
}

UnknownLayout HandEyeUnknowns(const CameraModel& model, const FreeUnknowns& free) {
  UnknownLayout layout = HandEyePoses();
  if (free.effects != nullptr) layout.AddEffects(kRobotBlock, free.effects->Names());
  const auto end_of_camera = free.params.begin() + NumParams(model);
  layout.AddCamera(kCameraBlock, model, {free.params.begin(), end_of_camera});
  layout.AddTarget(kTargetBlock, {end_of_camera, free.params.end()});
  return layout;
}

}  // namespace heba
