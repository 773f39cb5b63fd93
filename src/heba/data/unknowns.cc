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
  return blocks_.emplace_back(UnknownBlock{owner, std::string(name), size(), 0});
}

void UnknownLayout::AddPose(std::string_view name, std::string_view plain_name, std::string_view plain_frame) {
  AddBlock(UnknownOwner::kPose, name).size = kPoseSize;
  for (size_t i = 0; i < kTangentNames.size(); ++i) {
    const bool is_translation = i < 3;
    constexpr std::string_view kAxes = "xyz";
    unknowns_.push_back({std::string(name) + "." + std::string(kTangentNames[i]),
                         std::string(plain_name) + (is_translation ? " translation along " : " rotation about ") +
                             std::string(plain_frame) + " " + kAxes[i % 3],
                         is_translation ? UnknownGroup::kTranslation : UnknownGroup::kRotation, static_cast<int>(i)});
  }
}

void UnknownLayout::AddEffects(std::string_view name, std::string_view plain_name, int size) {
  AddBlock(UnknownOwner::kEffects, name).size = size;
  for (int i = 0; i < size; ++i) {
    unknowns_.push_back({std::string(name) + "." + std::to_string(i), std::string(plain_name) + " " + std::to_string(i),
                         UnknownGroup::kEffect, i});
  }
}

void UnknownLayout::AddCamera(std::string_view name, const CameraModel& model, const std::vector<bool>& free) {
  CHECK_EQ(free.size(), static_cast<size_t>(NumParams(model)));
  UnknownBlock& block = AddBlock(UnknownOwner::kCamera, name);
  for (size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) continue;
    const std::string& param = model.param_names()[i];
    unknowns_.push_back({std::string(name) + "." + param, "the " + std::string(name) + "'s " + param,
                         GroupOfCameraParam(static_cast<int>(i)), static_cast<int>(i)});
    ++block.size;
  }
}

void UnknownLayout::AddTarget(std::string_view name, const std::vector<bool>& free) {
  constexpr std::string_view kPlainNames[] = {"scale along x", "scale along y", "bend along x", "bend along y"};
  static_assert(std::size(kPlainNames) == TargetShape::kNumParams);
  CHECK(free.empty() || free.size() == TargetShape::kNumParams);
  UnknownBlock& block = AddBlock(UnknownOwner::kTarget, name);
  for (size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) continue;
    unknowns_.push_back(
        {std::string(name) + "." + std::string(kTargetShapeParamNames[i]),
         "the " + std::string(name) + "'s " + std::string(kPlainNames[i]),
         ShapeGroupOf(static_cast<int>(i)) == TargetShapeGroup::kScale ? UnknownGroup::kScale : UnknownGroup::kBend,
         static_cast<int>(i)});
    ++block.size;
  }
}

std::vector<std::string> UnknownLayout::Names() const {
  std::vector<std::string> names;
  for (const Unknown& unknown : unknowns_) names.push_back(unknown.name);
  return names;
}

UnknownBlock UnknownLayout::Block(std::string_view name) const {
  const auto found =
      std::find_if(blocks_.begin(), blocks_.end(), [&](const UnknownBlock& block) { return block.name == name; });
  return found == blocks_.end() ? UnknownBlock{UnknownOwner::kPose, std::string(name), size(), 0} : *found;
}

const UnknownBlock& UnknownLayout::BlockAt(Eigen::Index place) const {
  const auto found = std::find_if(blocks_.begin(), blocks_.end(), [&](const UnknownBlock& block) {
    return block.first <= place && place < block.end();
  });
  CHECK(found != blocks_.end());
  return *found;
}

std::optional<Eigen::Index> UnknownLayout::Place(std::string_view name) const {
  const auto found =
      std::find_if(unknowns_.begin(), unknowns_.end(), [&](const Unknown& unknown) { return unknown.name == name; });
  if (found == unknowns_.end()) return std::nullopt;
  return found - unknowns_.begin();
}

UnknownLayout HandEyePoses() {
  UnknownLayout layout;
  layout.AddPose(kHandEyeBlock, "the hand-eye", "the camera's");
  layout.AddPose(kBoardBlock, "the board's", "the target's");
  return layout;
}

UnknownLayout HandEyeUnknowns(const CameraModel& model, const std::vector<bool>& free) {
  UnknownLayout layout = HandEyePoses();
  const auto end_of_camera = free.begin() + NumParams(model);
  layout.AddCamera(kCameraBlock, model, {free.begin(), end_of_camera});
  layout.AddTarget(kTargetBlock, {end_of_camera, free.end()});
  return layout;
}

}  // namespace heba
