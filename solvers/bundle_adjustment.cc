#include "solvers/bundle_adjustment.h"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/metrics.h"
#include "heba/geometry/pose_block.h"
#include "solvers/information.h"
#include "solvers/motion_analysis.h"
#include "solvers/noise_scale.h"
#include "solvers/reprojection_cost.h"
#include "solvers/reprojection_problem.h"
#include "solvers/view_reduction.h"

namespace heba {
namespace {

// Squared distances of all points, whitened; nothing, with the view's name in `bad_view`, if a point has no image.
std::optional<std::vector<double>> SquaredDistances(const Problem& problem, const HandEye& hand_eye,
                                                    std::string* bad_view) {
  std::vector<double> distances;
  for (const View& view : problem.views) {
    const std::optional<std::vector<double>> squares =
        WhitenedSquares(problem.camera.Model(), problem.camera.params.data(),
                        CameraFromTarget(hand_eye, view.camera_mount_from_target_mount), view.observations);
    if (!squares) {
      *bad_view = view.name;
      return std::nullopt;
    }
    distances.insert(distances.end(), squares->begin(), squares->end());
  }
  return distances;
}

double Cost(const std::vector<double>& squared_distances, double sigma_px, const Loss& loss) {
  double sum = 0;
  for (const double d2 : squared_distances) sum += loss.rho(d2 / (sigma_px * sigma_px));
  return 0.5 * sum;
}

struct State {
  HandEye hand_eye;
  Camera camera;
};

// One run of Ceres at a fixed sigma.
ceres::Solver::Summary Minimise(const Problem& problem, const FreeParameters& free, double sigma_px, const Loss& loss,
                                int max_iterations, State* state) {
  const CameraModel& model = problem.camera.Model();
  PoseBlock hand_eye = ToBlock(state->hand_eye.camera_mount_from_camera);
  PoseBlock board = ToBlock(state->hand_eye.target_mount_from_target);
  std::vector<double> params = state->camera.params;
  ceres::Problem ceres_problem;
  ceres_problem.AddParameterBlock(hand_eye.data(), 7, new PoseManifold);
  ceres_problem.AddParameterBlock(board.data(), 7, new PoseManifold);
  AddCameraBlock(free, params.data(), &ceres_problem);
  for (const View& view : problem.views) {
    ceres_problem.AddResidualBlock(MakeReprojectionCost(model, view.observations, sigma_px, loss,
                                                        MakeHandEyeChain(view.camera_mount_from_target_mount))
                                       .release(),
                                   nullptr, hand_eye.data(), board.data(), params.data());
  }
  ceres::Solver::Summary summary;
  ceres::Solve(ReprojectionSolverOptions(max_iterations), &ceres_problem, &summary);
  state->hand_eye = {FromBlock(hand_eye.data()), FromBlock(board.data())};
  state->camera.params = params;
  return summary;
}

// A result that its own sigma makes worthless.
std::optional<Failure> CheckUncertainty(const Covariance& covariance, const Camera& camera) {
  constexpr double kMaxTranslationM = 0.1;
  constexpr double kMaxRotationRad = 0.1;
  constexpr double kMaxFocalRatio = 0.05;
  constexpr double kMaxCentreRatio = 0.1;  // Of the image's width.
  for (size_t i = 0; i < covariance.names.size(); ++i) {
    const std::string& name = covariance.names[i];
    const double sigma = std::sqrt(covariance.matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)));
    const std::string part = name.substr(name.find('.') + 1);
    const bool is_camera = name.starts_with("camera.");
    if (!is_camera && part[0] == 't' && !(sigma < kMaxTranslationM)) {
      return Failure{PlainName(name) + " is known to " + Significant(1000 * sigma, 2) +
                     " mm only; more captures with larger turns about different axes are needed"};
    }
    if (!is_camera && part[0] == 'r' && !(sigma < kMaxRotationRad)) {
      return Failure{PlainName(name) + " is known to " + Significant(RadToDeg(sigma), 2) +
                     " deg only; more captures with larger turns about different axes are needed"};
    }
    if (part == "fx" || part == "fy") {
      const double focal = camera.params[part == "fx" ? 0 : 1];
      if (!(sigma < kMaxFocalRatio * focal)) {
        return Failure{
            PlainName(name) + " is known to " + Significant(sigma, 2) +
            " px only: the captures cannot tell focal length from distance; move the target through more depth "
            "and tilt, or hold it with a camera file and refine.intrinsics"};
      }
    }
    if ((part == "cx" || part == "cy") && !(sigma < kMaxCentreRatio * camera.width_px)) {
      return Failure{
          PlainName(name) + " is known to " + Significant(sigma, 2) +
          " px only: the captures cannot tell it from the camera's pointing; tilt the target more, or hold it "
          "with a camera file and refine.intrinsics"};
    }
  }
  return std::nullopt;
}

}  // namespace

std::string BundleOptions::Check() const {
  std::vector<std::string> faults;
  if (FindLoss(loss) == nullptr) faults.push_back("loss '" + loss + "' is unknown; one of: " + Join(LossNames(), ", "));
  if (pixel_noise_px && !(*pixel_noise_px > 0)) faults.emplace_back("pixel_noise_px must be greater than zero");
  if (max_iterations < 1) faults.emplace_back("max_iterations must be at least 1");
  return Join(faults, "\n");
}

Outcome<Solution> RefineHandEye(const Problem& problem, const HandEye& start, const BundleOptions& options) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  const Loss& loss = *FindLoss(options.loss);
  const FreeParameters free = FreeOf(problem.camera.Model(), options.free_intrinsics);

  std::vector<Rigid3d> poses;
  for (const View& view : problem.views) poses.push_back(view.camera_mount_from_target_mount);
  const std::string why_not = WhyNotObservable(AnalyseMotion(poses));
  if (!why_not.empty()) return Failure{why_not};
  std::string bad_view;
  const std::optional<std::vector<double>> start_distances = SquaredDistances(problem, start, &bad_view);
  if (!start_distances) {
    return Failure{"with the start values the target of capture " + bad_view +
                   " lies behind the camera; another seed, or a check of set-up and pose direction, is needed"};
  }
  // As many numbers as unknowns at the least, or there is nothing to average.
  const int num_unknowns = 12 + static_cast<int>(std::count(free.begin(), free.end(), true));
  if (2 * static_cast<int>(start_distances->size()) <= num_unknowns) {
    return Failure{std::to_string(2 * start_distances->size()) + " measured coordinates for " +
                   std::to_string(num_unknowns) + " unknowns are too few; take more captures or hold the intrinsics"};
  }
  const std::optional<Information> start_information = ComputeInformation(problem, start, free, 1.0, *FindLoss("none"));
  CHECK(start_information.has_value());
  if (const std::optional<Failure> failure = CheckObservable(*start_information)) return *failure;
  // What even little noise would hide, the solve would look for in vain.
  constexpr double kLittleNoisePx = 0.05;
  const double least_px = options.pixel_noise_px.value_or(kLittleNoisePx);
  if (const std::optional<Failure> failure =
          CheckUncertainty(InvertInformation(*start_information, least_px * least_px), problem.camera)) {
    return *failure;
  }

  double sigma_px = options.pixel_noise_px.value_or(SigmaFromMedian(*start_distances));
  State state{start, problem.camera};
  Convergence convergence;
  // A robust loss and the sigma that it is whitened by determine each other: a few rounds settle both.
  constexpr int kMaxRounds = 12;
  for (int round = 0; round < kMaxRounds; ++round) {
    const ceres::Solver::Summary summary = Minimise(problem, free, sigma_px, loss, options.max_iterations, &state);
    convergence.converged = summary.termination_type == ceres::CONVERGENCE;
    convergence.iterations += static_cast<int>(summary.iterations.size()) - 1;
    convergence.seconds += summary.total_time_in_seconds;
    convergence.message = summary.message;
    if (!convergence.converged) {
      // Mostly for want of information: then that is what to say.
      const std::optional<Information> weak =
          ComputeInformation({state.camera, problem.views}, state.hand_eye, free, sigma_px, loss);
      std::optional<Failure> failure = weak ? CheckObservable(*weak) : std::nullopt;
      if (weak && !failure) failure = CheckUncertainty(InvertInformation(*weak, 1.0), state.camera);
      return failure.value_or(Failure{"the refinement did not converge: " + summary.message});
    }
    if (options.pixel_noise_px) break;
    const Problem solved{state.camera, problem.views};
    const std::optional<std::vector<double>> distances = SquaredDistances(solved, state.hand_eye, &bad_view);
    CHECK(distances.has_value()) << "Ceres accepted a step that hides a point";
    const double next_px = SigmaOfFit(*distances, num_unknowns, loss, SigmaFromMedian(*distances));
    const bool settled = loss.name == "none" || std::abs(next_px - sigma_px) < 1e-6 * sigma_px;
    sigma_px = next_px;
    if (settled) break;
  }

  Solution solution;
  solution.hand_eye = state.hand_eye;
  solution.camera = state.camera;
  solution.pixel_sigma_px = sigma_px;
  const Problem solved{state.camera, problem.views};
  convergence.initial_cost = Cost(*start_distances, sigma_px, loss);
  convergence.final_cost = Cost(*SquaredDistances(solved, state.hand_eye, &bad_view), sigma_px, loss);
  solution.convergence = convergence;
  const std::optional<Information> information = ComputeInformation(solved, state.hand_eye, free, sigma_px, loss);
  CHECK(information.has_value());
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  solution.covariance = InvertInformation(*information, loss.covariance_factor());
  const std::string camera_faults = CheckCamera(solution.camera);
  if (!camera_faults.empty()) return Failure{"the refined camera makes no sense: " + camera_faults};
  if (const std::optional<Failure> failure = CheckUncertainty(solution.covariance, solution.camera)) {
    return *failure;
  }
  return solution;
}

}  // namespace heba
