#include "solvers/calibration/held_out.h"

#include <cmath>

#include "heba/base/factorisation.h"
#include "heba/data/target_shape.h"
#include "solvers/initial/pose_selection.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

void HeldOutErrors::Add(const HeldOutErrors& other) {
  pixels.Add(other.pixels);
  has_hidden = has_hidden || other.has_hidden;
  sum_m2 += other.sum_m2;
  sum_rad2 += other.sum_rad2;
  num_poses += other.num_poses;
  distance_m_of_capture.insert(distance_m_of_capture.end(), other.distance_m_of_capture.begin(),
                               other.distance_m_of_capture.end());
}

std::optional<double> HeldOutErrors::RmsDistanceM() const {
  if (num_poses == 0) return std::nullopt;
  return std::sqrt(sum_m2 / num_poses);
}

std::optional<double> HeldOutErrors::RmsAngleRad() const {
  if (num_poses == 0) return std::nullopt;
  return std::sqrt(sum_rad2 / num_poses);
}

void HeldOutErrors::AddImage(const Camera& camera, const Rigid3d& predicted, const Observations& points,
                             const std::vector<TargetPose>& poses, size_t capture) {
  if (const std::optional<SquaredErrors> of_image = ViewErrors(camera, predicted, points)) {
    pixels.Add(*of_image);
  } else {
    has_hidden = true;
  }
  const TargetPose* const seen = NearestPose(poses, predicted);
  if (seen == nullptr) return;
  // The distance is measured at the centre of the points.
  const Eigen::Vector3d middle = points.points_in_target.rowwise().mean();
  const double distance_m = (predicted * middle - seen->camera_from_target * middle).norm();
  sum_m2 += distance_m * distance_m;
  sum_rad2 += std::pow(AngleRad(predicted, seen->camera_from_target), 2);
  ++num_poses;
  distance_m_of_capture.emplace_back(capture, distance_m);
}

HeldOutErrors ErrorsOfUnused(const Problem& problem, const Solution& solution, const ImageSet& images, size_t camera) {
  HeldOutErrors errors;
  for (const auto& [i, k] : images) {
    const ProblemCapture& capture = problem.captures[i];
    const ProblemImage& image = capture.images[k];
    if (image.camera != camera || image.observations.size() == 0) continue;
    const Observations points = ApplyShape(image.observations, solution.shapes[image.target]);
    errors.AddImage(
        solution.cameras[camera],
        CameraFromTarget(problem, solution.poses, camera, image.target, WithErrors(capture, solution.effects)), points,
        EstimateTargetPose(solution.cameras[camera], points), i);
  }
  return errors;
}

void SumOfSquares::Add(const SumOfSquares& other) {
  squares += other.squares;
  number += other.number;
}

std::optional<double> SumOfSquares::Mean() const {
  if (number == 0) return std::nullopt;
  return squares / number;
}

SumOfSquares SquaresOf(const Problem& held_out, const Solution& solution, bool has_covariance) {
  const Problem weighted = WeightedAs(solution, held_out);
  FitState state = StateOf(solution);
  state.corrections.clear();
  const std::vector<size_t> moving = MovingRobots(weighted);
  FitNoise noise{solution.pixel_sigmas_px, solution.image_sigmas_px, {}, solution.effect_sigmas};
  for (const size_t r : moving) noise.robots.push_back(solution.robot_noise[r].value_or(RobotNoise{}));
  SumOfSquares sum;
  const std::optional<std::vector<LinearisedView>> captures =
      LineariseCaptures(CaptureLoops(weighted, GroupByRobotPoses(weighted), state, noise, true), ValuesOf(state), 1,
                        LossOf(LossKind::kNone));
  if (!captures) return sum;
  const Eigen::VectorXd variances = CorrectionVariances(noise, NoisyJointsOf(weighted, moving));
  for (const LinearisedView& capture : *captures) {
    const Eigen::VectorXd residual = ResidualOf(weighted, state, capture, Eigen::VectorXd());
    Eigen::MatrixXd covariance = MarginalCovariance(capture, 1, variances);
    if (has_covariance)
      covariance += capture.by_unknowns * solution.covariance.matrix * capture.by_unknowns.transpose();
    sum.squares += MahalanobisSquare(residual, covariance) + capture.residual_sum_of_squares;
    sum.number += static_cast<double>(residual.size() + capture.num_residual_dof);
  }
  return sum;
}

}  // namespace heba
