#include "solvers/uncertainty/unknown_change.h"

#include "heba/base/error.h"

namespace heba {

UnknownChange::UnknownChange(const UnknownLayout& layout)
    : layout_(layout), change_(Eigen::VectorXd::Zero(layout.size())) {}

void UnknownChange::SetPose(std::string_view block, const Rigid3d& from, const Rigid3d& to) {
  const UnknownBlock pose = layout_.Block(block);
  if (pose.size == 0) return;
  CHECK_EQ(pose.size, 6) << block;
  change_.segment<6>(pose.first) = LocalCoordinates(from, to);
}

void UnknownChange::SetParams(std::string_view block, std::span<const double> from, std::span<const double> to) {
  const UnknownBlock params = layout_.Block(block);
  if (params.size == 0) return;
  CHECK_EQ(from.size(), to.size()) << block;
  for (Eigen::Index i = params.first; i < params.end(); ++i) {
    const auto k = static_cast<size_t>(layout_[i].index);
    change_[i] = to[k] - from[k];
  }
}

}  // namespace heba
