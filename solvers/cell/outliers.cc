#include "solvers/cell/outliers.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Variances below this, in units of those of the pixels, are round-off.
constexpr double kNothing = 1e-9;

// What is needed to test images: the posterior of each capture's corrections.
class ImageTest {
 public:
  ImageTest(const Problem& used, const Solution& solution)
      : solution_(solution),
        state_(StateOf(solution)),
        moving_(MovingRobots(used)),
        variances_(CorrectionVariances(NoiseOf(solution), NoisyJointsOf(used, moving_))) {}

  Eigen::VectorXd CorrectionsOf(size_t capture) const { return CorrectionTangents(state_, capture, moving_); }

  CorrectionPosterior Posterior(const std::vector<const LinearisedView*>& views) const {
    return PosteriorOf(views, variances_, solution_.covariance.layout.size());
  }

  // Returns the p-value of an image. `is_used`: whether the estimate and the posterior contain it.
  double PValueOfImage(const Problem& problem, const ImageIndex& index, const LinearisedView& view,
                       const CorrectionPosterior& posterior, const Eigen::VectorXd& corrections, bool is_used) const {
    const ProblemImage& image = problem.captures[index.capture].images[index.image];
    if (view.offset.size() < 6) return 1;
    // The part of the rows that another pose of the target would explain.
    const Eigen::MatrixXd basis = PosePartOf(problem, image, view);
    const Tangent6 residual = basis.transpose() * ResidualOf(problem, state_, view, corrections);
    const Matrix6 predicted =
        basis.transpose() * PredictionCovariance(view, posterior, solution_.covariance.matrix) * basis;
    const double floor =
        PoseErrorVariance(kUnmodelledPx, solution_.pixel_sigmas_px[image.camera], image.observations.size()) /
        PoseVarianceRatio(NoiseOf(solution_), image);
    Matrix6 covariance = is_used ? Matrix6(Matrix6::Identity() - predicted) : Matrix6(Matrix6::Identity() + predicted);
    // A direction in which the image alone determines the estimate has no variance, and is not tested.
    if (!is_used) {
      covariance.diagonal().array() += floor;
      return PValueOf(residual, covariance, kNothing, solution_.covariance_dof);
    }
    // The floor belongs to the rows before the estimate takes up its part.
    covariance += floor * covariance * covariance;
    return PValueOf(residual, covariance, kNothing, solution_.covariance_dof);
  }

  // Returns the p-value of the correction of one moving arm.
  double PValueOfCorrection(size_t moving, const CorrectionPosterior& posterior,
                            const Eigen::VectorXd& corrections) const {
    const Eigen::Index first = 6 * static_cast<Eigen::Index>(moving);
    const Tangent6 sigmas = variances_.segment<6>(first).cwiseSqrt();
    if (sigmas.minCoeff() <= 0) return 1;
    const Eigen::MatrixXd& by_unknowns = posterior.by_unknowns;
    const Matrix6 known =
        posterior.inverse_normal.block<6, 6>(first, first) +
        by_unknowns.middleRows(first, 6) * solution_.covariance.matrix * by_unknowns.middleRows(first, 6).transpose();
    // In units of the prior's sigmas: the estimated correction varies by what the images tell about it.
    const Matrix6 scaled = sigmas.cwiseInverse().asDiagonal() * known * sigmas.cwiseInverse().asDiagonal();
    constexpr double kLeast = 1e-3;
    return PValueOf(corrections.segment<6>(first).cwiseQuotient(sigmas), Matrix6::Identity() - scaled, kLeast,
                    solution_.covariance_dof);
  }

  // Returns whether the solution has the noise of all arms that move the image's target against its camera.
  bool KnowsArmsOf(const Problem& problem, const ProblemImage& image) const {
    for (size_t r = 0; r < problem.robots.size(); ++r) {
      const bool moves = IsMovedBy(problem.cameras[image.camera].mount, problem.targets[image.target].mount, r);
      if (moves && std::find(moving_.begin(), moving_.end(), r) == moving_.end()) return false;
    }
    return true;
  }

  const std::vector<size_t>& moving() const { return moving_; }
  const FitState& state() const { return state_; }

 private:
  const Solution& solution_;
  FitState state_;
  std::vector<size_t> moving_;
  Eigen::VectorXd variances_;
};

}  // namespace

std::vector<ImageVerdict> TestUsedImages(const Problem& problem_in, const Solution& solution) {
  const Problem problem = WeightedAs(solution, problem_in);
  const ImageTest test(problem, solution);
  const CaptureGroups groups = GroupByRobotPoses(problem);
  const std::optional<LinearisedImages> linearised =
      LineariseImages(problem, groups, test.state(), NoiseOf(solution), LossOf(LossKind::kNone));
  std::vector<ImageVerdict> verdicts;
  if (!linearised) return verdicts;
  for (const std::vector<size_t>& group : linearised->groups) {
    std::vector<const LinearisedView*> views;
    for (const size_t v : group) views.push_back(&linearised->views[v]);
    const CorrectionPosterior posterior = test.Posterior(views);
    const ImageIndex& first = linearised->images[group.front()];
    const Eigen::VectorXd corrections = test.CorrectionsOf(first.capture);
    for (const size_t v : group) {
      const ImageIndex& index = linearised->images[v];
      verdicts.push_back({index, std::nullopt,
                          test.PValueOfImage(problem, index, linearised->views[v], posterior, corrections, true)});
    }
    for (size_t k = 0; k < test.moving().size(); ++k) {
      verdicts.push_back({first, test.moving()[k], test.PValueOfCorrection(k, posterior, corrections)});
    }
  }
  return verdicts;
}

std::vector<ImageVerdict> TestLeftOutImages(const Problem& problem_in, const Problem& used_in,
                                            const Solution& solution) {
  const Problem problem = WeightedAs(solution, problem_in);
  const Problem used = WeightedAs(solution, used_in);
  const ImageTest test(used, solution);
  std::vector<ImageVerdict> verdicts;
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    std::vector<ImageIndex> left_out;
    for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
      const ProblemImage& image = problem.captures[i].images[k];
      const bool is_used = used.captures[i].images[k].observations.size() > 0;
      if (!is_used && image.observations.size() > 0 && test.KnowsArmsOf(problem, image)) left_out.push_back({i, k});
    }
    if (left_out.empty()) continue;
    FitState state = test.state();
    if (!state.corrections.empty()) state.corrections = {state.corrections[i]};
    const auto linearise = [&](const ProblemCapture& capture) {
      const Problem one{used.robots, used.cameras, used.targets, {capture}, used.effects};
      return LineariseCaptures(ImageLoops(one, {{0}}, state, NoiseOf(solution), test.moving()), ValuesOf(state), 1,
                               LossOf(LossKind::kNone));
    };
    const std::optional<std::vector<LinearisedView>> of_used = linearise(used.captures[i]);
    std::vector<const LinearisedView*> known;
    for (size_t v = 0; of_used && v < of_used->size(); ++v) known.push_back(&(*of_used)[v]);
    const CorrectionPosterior posterior = test.Posterior(known);
    // Without other images nothing corrects the arms' poses.
    Eigen::VectorXd corrections = test.CorrectionsOf(i);
    if (known.empty()) corrections.setZero();
    for (const ImageIndex& index : left_out) {
      ProblemCapture alone = problem.captures[i];
      alone.images = {problem.captures[i].images[index.image]};
      const std::optional<std::vector<LinearisedView>> linear = linearise(alone);
      double p_value = 0;
      if (linear) p_value = test.PValueOfImage(problem, index, linear->front(), posterior, corrections, false);
      verdicts.push_back({index, std::nullopt, p_value});
    }
  }
  return verdicts;
}

}  // namespace heba
