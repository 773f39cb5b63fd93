#include "solvers/uncertainty/block_prior.h"

#include <cmath>
#include <utility>

#include "heba/base/error.h"
#include "heba/data/target_shape.h"

namespace heba {
namespace {

UnknownBlock BlockOf(const BlockPrior& prior, const UnknownLayout& layout) {
  const std::vector<UnknownBlock> blocks = layout.BlocksOf(prior.owner);
  CHECK_LT(prior.index, blocks.size());
  return blocks[prior.index];
}

Eigen::VectorXd NumbersOf(const BlockPrior& prior, const LoopValues& values) {
  CHECK(prior.owner == UnknownOwner::kCamera || prior.owner == UnknownOwner::kTarget);
  const auto numbers = [&](const auto& params) {
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(params.data(), prior.weights.size()));
  };
  return prior.owner == UnknownOwner::kCamera ? numbers(values.cameras[prior.index])
                                              : numbers(values.targets[prior.index].params);
}

}  // namespace

BlockPrior PriorOfCamera(const CameraPrior& prior, const std::vector<bool>& is_free, size_t index) {
  CHECK_EQ(prior.params.size(), prior.sigmas.size());
  CHECK_LE(prior.params.size(), is_free.size());
  const auto size = static_cast<Eigen::Index>(prior.params.size());
  BlockPrior of_block{UnknownOwner::kCamera, Eigen::VectorXd::Zero(size),
                      Eigen::Map<const Eigen::VectorXd>(prior.params.data(), size), index};
  for (size_t i = 0; i < prior.params.size(); ++i) {
    if (is_free[i]) of_block.weights[static_cast<Eigen::Index>(i)] = 1 / prior.sigmas[i];
  }
  return of_block;
}

BlockPrior PriorOfEffects(Eigen::VectorXd weights, size_t index) {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(weights.size());
  return {UnknownOwner::kEffects, std::move(weights), std::move(mean), index};
}

BlockPrior PriorOfScales(double sigma, size_t index) {
  BlockPrior prior{UnknownOwner::kTarget, Eigen::VectorXd::Zero(TargetShape::kNumParams),
                   Eigen::VectorXd::Zero(TargetShape::kNumParams), index};
  for (int param = 0; param < TargetShape::kNumParams; ++param) {
    if (ShapeGroupOf(param) != TargetShapeGroup::kScale) continue;
    prior.weights[param] = 1 / sigma;
    prior.mean[param] = TargetShape().params[static_cast<size_t>(param)];
  }
  return prior;
}

LinearisedView PriorView(const BlockPrior& prior, const UnknownLayout& layout, const LoopValues& values,
                         double row_variance, Eigen::Index num_effects) {
  const Eigen::VectorXd weights = std::sqrt(row_variance) * prior.weights;
  const Eigen::VectorXd offsets = weights.cwiseProduct(NumbersOf(prior, values) - prior.mean);
  const UnknownBlock block = BlockOf(prior, layout);
  const Eigen::Index num_rows = (weights.array() > 0).count();
  LinearisedView view;
  view.by_unknowns = Eigen::MatrixXd::Zero(num_rows, layout.size());
  view.by_effects = Eigen::MatrixXd::Zero(num_rows, num_effects);
  view.offset.resize(num_rows);
  view.num_rows_without_effects = num_rows;
  Eigen::Index row = 0;
  for (Eigen::Index param = 0; param < weights.size(); ++param) {
    if (!(weights[param] > 0)) continue;
    view.offset[row] = offsets[param];
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      if (layout[i].index == param) view.by_unknowns(row, i) = -weights[param];
    }
    ++row;
  }
  return view;
}

Information WithPrior(Information information, const BlockPrior& prior) {
  const UnknownBlock block = BlockOf(prior, information.layout);
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    const double weight = prior.weights[information.layout[i].index];
    information.matrix(i, i) += weight * weight;
  }
  return information;
}

}  // namespace heba
