#include "solvers/refine/linearised_images.h"

#include <algorithm>
#include <utility>

#include "heba/base/factorisation.h"

namespace heba {

std::optional<LinearisedImages> LineariseImages(const Problem& problem, const CaptureGroups& groups,
                                                const FitState& state, const FitNoise& noise, const Loss& loss) {
  LinearisedImages result;
  std::optional<std::vector<LinearisedView>> views =
      LineariseCaptures(ImageLoops(problem, groups, state, noise, MovingRobots(problem)), ValuesOf(state), 1, loss);
  if (!views) return std::nullopt;
  result.views = std::move(*views);
  result.images = ImagesOf(problem, groups);
  size_t next = 0;
  for (const std::vector<size_t>& group : groups) {
    std::vector<size_t>& of_group = result.groups.emplace_back();
    while (next < result.images.size() &&
           std::find(group.begin(), group.end(), result.images[next].capture) != group.end()) {
      of_group.push_back(next++);
    }
  }
  return result;
}

std::optional<std::vector<LinearisedView>> LineariseEachCapture(const Problem& problem, const FitState& state,
                                                                const FitNoise& noise, const Loss& loss) {
  CaptureGroups each;
  for (const size_t i : CapturesWithPoints(problem)) each.push_back({i});
  // The linearised captures have no priors of their corrections.
  const FitNoise of_images{noise.pixel_px, noise.image_px, {}};
  std::optional<std::vector<LinearisedView>> views =
      LineariseCaptures(CaptureLoops(problem, each, state, of_images, true), ValuesOf(state), 1, loss);
  for (size_t v = 0; views && v < views->size(); ++v) {
    (*views)[v].offset = ResidualOf(problem, state, (*views)[v], Eigen::VectorXd());
  }
  return views;
}

Eigen::MatrixXd PosePartOf(const Problem& problem, const ProblemImage& image, const LinearisedView& view) {
  // Another pose of the camera is another pose of the target.
  const UnknownBlock pose = UnknownsOf(problem).Block(CameraPoseBlock(problem.cameras[image.camera]));
  return HouseholderFactor(view.by_unknowns.middleCols(pose.first, pose.size)).Basis();
}

Eigen::VectorXd CorrectionTangents(const FitState& state, size_t capture, const std::vector<size_t>& moving) {
  Eigen::VectorXd tangents = Eigen::VectorXd::Zero(6 * static_cast<Eigen::Index>(moving.size()));
  for (size_t k = 0; k < moving.size() && !state.corrections.empty(); ++k) {
    tangents.segment<6>(6 * static_cast<Eigen::Index>(k)) =
        LocalCoordinates(Rigid3d(), state.corrections[capture][moving[k]]);
  }
  return tangents;
}

Eigen::VectorXd ResidualOf(const Problem& problem, const FitState& state, const LinearisedView& view,
                           const Eigen::VectorXd& corrections) {
  // The columns of noisy joints, which come last, are combinations of those of the corrections.
  Eigen::VectorXd residual = view.offset - view.by_effects.leftCols(corrections.size()) * corrections;
  if (state.effects.empty()) return residual;
  const UnknownLayout layout = UnknownsOf(problem);
  for (size_t r = 0; r < state.effects.size(); ++r) {
    if (EffectsOf(problem, r) == nullptr) continue;
    const UnknownBlock block = layout.Block(ErrorsBlock(problem.robots[r]));
    residual -= view.by_unknowns.middleCols(block.first, block.size) * state.effects[r];
  }
  return residual;
}

CorrectionPosterior PosteriorOf(const std::vector<const LinearisedView*>& views, const Eigen::VectorXd& variances,
                                Eigen::Index num_unknowns) {
  const Eigen::Index size = variances.size();
  // In units of the prior's sigmas, because a variance may be zero.
  const Eigen::VectorXd sigmas = variances.cwiseSqrt();
  Eigen::MatrixXd by_sigmas(size, 0);  // Transposed.
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(size, num_unknowns);
  for (const LinearisedView* const view : views) {
    const Eigen::MatrixXd of_view = (view->by_effects * sigmas.asDiagonal()).transpose();
    by_sigmas.conservativeResize(Eigen::NoChange, by_sigmas.cols() + of_view.cols());
    by_sigmas.rightCols(of_view.cols()) = of_view;
    mixed += of_view * view->by_unknowns;
  }
  const auto factor = CholeskyFactor<Eigen::Dynamic>::OfIdentityPlusSquare(by_sigmas);
  CorrectionPosterior posterior;
  posterior.inverse_normal = sigmas.asDiagonal() * factor.Inverse() * sigmas.asDiagonal();
  posterior.by_unknowns = sigmas.asDiagonal() * factor.Solve(mixed);
  return posterior;
}

Eigen::MatrixXd PredictionCovariance(const LinearisedView& view, const CorrectionPosterior& posterior,
                                     const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd by_unknowns = view.by_unknowns - view.by_effects * posterior.by_unknowns;
  return by_unknowns * covariance * by_unknowns.transpose() +
         view.by_effects * posterior.inverse_normal * view.by_effects.transpose();
}

}  // namespace heba
