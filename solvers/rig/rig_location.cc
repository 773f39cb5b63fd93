#include "heba/rig_location.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "heba/data/prediction.h"
#include "heba/evaluation/metrics.h"
#include "solvers/initial/target_pose.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/rig/rig_loops.h"

namespace heba {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// The pose of a camera in the world, with its derivatives by the unknowns of the calibration and by the corrections of
// the arms (six columns each).
struct PlacedCamera {
  PoseByUnknowns world_from_camera;
  Matrix6X by_corrections;
};

PlacedCamera PlaceCamera(const RigProblem& rig, const RigSolution& solution, size_t camera,
                         const std::vector<Rigid3d>& base_from_gripper) {
  const UnknownLayout& layout = solution.covariance.layout;
  const Mount& mount = rig.cameras[camera].mount;
  const PoseByUnknowns mount_from_camera =
      UnknownPose(solution.poses.mount_from_camera[camera], layout, CameraPoseBlock(rig.cameras[camera]));
  PoseByUnknowns world_from_mount =
      UnknownPose(solution.poses.world_from_base[mount.robot], layout, BaseBlock(rig.robots[mount.robot]));
  Matrix6X by_corrections = Matrix6X::Zero(6, 6 * static_cast<Eigen::Index>(rig.robots.size()));
  if (mount.part == Mount::Part::kGripper) {
    const PoseByUnknowns stated{base_from_gripper[mount.robot], Matrix6X::Zero(6, layout.size())};
    world_from_mount = world_from_mount * stated;
    // The correction multiplies the pose of the gripper on the right.
    by_corrections.middleCols<6>(6 * static_cast<Eigen::Index>(mount.robot)) = Adjoint(Inverse(mount_from_camera.pose));
  }
  return {world_from_mount * mount_from_camera, std::move(by_corrections)};
}

// Returns one sigma of each coordinate of the corrections of all arms; zero for exact arms.
Eigen::VectorXd CorrectionSigmas(const RigSolution& solution) {
  Eigen::VectorXd sigmas = Eigen::VectorXd::Zero(6 * static_cast<Eigen::Index>(solution.robot_noise.size()));
  for (size_t r = 0; r < solution.robot_noise.size(); ++r) {
    if (!solution.robot_noise[r]) continue;
    const Eigen::Index first = 6 * static_cast<Eigen::Index>(r);
    // The errors at other poses than those of the captures are not known: those that are smooth are noise, too.
    const RobotNoise smooth = SmoothNoiseOf(solution, r).value_or(RobotNoise{});
    sigmas.segment<3>(first).setConstant(std::hypot(solution.robot_noise[r]->translation_m, smooth.translation_m));
    sigmas.segment<3>(first + 3).setConstant(std::hypot(solution.robot_noise[r]->rotation_rad, smooth.rotation_rad));
  }
  return sigmas;
}

// The whitened rows of one camera: residuals, and their derivatives by the left perturbation of what the camera sees
// (m, rad, in the camera's frame) and by the parameters of the camera.
struct CameraRows {
  Eigen::MatrixXd by_motion;
  Eigen::MatrixXd by_params;
  Eigen::VectorXd residual;
};

std::optional<CameraRows> RowsOf(const RigSolution& solution, size_t camera, const Observations& observations,
                                 const Rigid3d& camera_from_target) {
  const Camera& of_camera = solution.cameras[camera];
  Points2 predicted;
  ProjectionJacobian jacobian;
  if (!Predict(of_camera.Model(), of_camera.params.data(), camera_from_target, observations, &predicted, &jacobian)) {
    return std::nullopt;
  }
  const Eigen::Index num_params = NumParams(of_camera.Model());
  const Eigen::Index num_points = predicted.cols();
  const double weight = 1 / solution.pixel_sigmas_px[camera];
  Eigen::MatrixXd rows(2 * num_points, 6 + num_params + 1);
  for (Eigen::Index i = 0; i < num_points; ++i) {
    rows.block(2 * i, 0, 1, 6 + num_params) = weight * jacobian.u.col(i).transpose();
    rows.block(2 * i + 1, 0, 1, 6 + num_params) = weight * jacobian.v.col(i).transpose();
    rows.block<2, 1>(2 * i, 6 + num_params) = weight * (predicted.col(i) - observations.pixels.col(i));
  }
  return CameraRows{rows.leftCols(6), rows.middleCols(6, num_params), rows.col(6 + num_params)};
}

// A pose of which some coordinates of the tangent are estimated, and their covariances by source.
struct LocatedFrame {
  Rigid3d world_from_frame;
  Eigen::MatrixXd by_calibration;
  Eigen::MatrixXd by_image;
  Eigen::MatrixXd by_robot;
  double squares = 0;  // Sum of the squared whitened residuals, those of the corrections included.
  std::vector<Rigid3d> corrections;
};

// The unknowns of a location: the frame, and the corrections of the arms' poses, in units of their sigmas.
struct FrameState {
  Rigid3d world_from_frame;
  Eigen::VectorXd corrections;
};

// The normal equations of the frame's coordinates, followed by the corrections; nothing if a point has no image.
struct FrameEquations {
  Eigen::MatrixXd of_images;  // The normal matrix without the prior of the corrections.
  Eigen::VectorXd gradient;
  Eigen::MatrixXd by_unknowns;  // Of the gradient.
  double squares = 0;
};

// Locates a frame that the points of all observations are in, from an initial guess. The corrections of the arms that
// carry cameras are unknowns with the arms' noise as their prior, so that a camera on a noisy arm counts for less.
class FrameLocation {
 public:
  FrameLocation(const RigProblem& rig, const RigSolution& solution, const std::vector<CameraObservations>& seen,
                const std::vector<Rigid3d>& base_from_gripper, Eigen::Index num_coordinates)
      : rig_(rig),
        solution_(solution),
        seen_(seen),
        base_from_gripper_(base_from_gripper),
        num_coordinates_(num_coordinates),
        sigmas_(CorrectionSigmas(solution)) {}

  Rigid3d WorldFromCamera(size_t view, const std::vector<Rigid3d>& corrections = {}) const {
    return PlaceCamera(rig_, solution_, seen_[view].camera, Corrected(base_from_gripper_, corrections))
        .world_from_camera.pose;
  }

  // Returns nothing if a point has no image, or if the points do not determine the frame.
  std::optional<LocatedFrame> From(const Rigid3d& world_from_frame) const {
    constexpr int kMaxSteps = 50;
    FrameState state{world_from_frame, Eigen::VectorXd::Zero(sigmas_.size())};
    std::optional<FrameEquations> at = EquationsAt(state);
    for (int step = 0; at && step < kMaxSteps; ++step) {
      const Eigen::LDLT<Eigen::MatrixXd> factor(WithPrior(at->of_images));
      constexpr double kLeast = 1e-12;  // Of the largest pivot of the frame.
      const Eigen::LDLT<Eigen::MatrixXd> of_frame(at->of_images.topLeftCorner(num_coordinates_, num_coordinates_));
      if (!(of_frame.vectorD().minCoeff() > kLeast * of_frame.vectorD().maxCoeff())) return std::nullopt;
      Eigen::VectorXd tangent = -factor.solve(at->gradient);
      // A step that does not reduce the cost is halved.
      std::optional<FrameEquations> next;
      FrameState moved;
      for (int halving = 0; halving < 20; ++halving, tangent *= 0.5) {
        Tangent6 of_pose = Tangent6::Zero();
        of_pose.head(num_coordinates_) = tangent.head(num_coordinates_);
        moved = {Retract(state.world_from_frame, of_pose), state.corrections + tangent.tail(sigmas_.size())};
        next = EquationsAt(moved);
        if (next && next->squares <= at->squares) break;
        next.reset();
      }
      if (!next) break;
      const bool is_done = at->squares - next->squares <= 1e-12 * (1 + at->squares);
      state = moved;
      at = std::move(next);
      if (is_done) break;
    }
    if (!at) return std::nullopt;
    const Eigen::MatrixXd inverse = WithPrior(at->of_images).inverse();
    const auto of_frame = inverse.topRows(num_coordinates_);
    const Eigen::MatrixXd by_unknowns = of_frame * at->by_unknowns;
    const Eigen::MatrixXd by_prior = of_frame.rightCols(sigmas_.size());
    return LocatedFrame{state.world_from_frame,
                        by_unknowns * solution_.covariance.matrix * by_unknowns.transpose(),
                        of_frame * at->of_images * of_frame.transpose(),
                        by_prior * by_prior.transpose(),
                        at->squares,
                        CorrectionsOf(state)};
  }

  // Returns the RMS of the distances of all points.
  double RmsPx(const LocatedFrame& located) const {
    SquaredErrors sum;
    for (size_t v = 0; v < seen_.size(); ++v) {
      const std::optional<SquaredErrors> errors = ViewErrors(
          solution_.cameras[seen_[v].camera],
          Inverse(WorldFromCamera(v, located.corrections)) * located.world_from_frame, seen_[v].observations);
      if (errors) sum.Add(*errors);
    }
    return sum.RmsPx().value_or(0);
  }

 private:
  std::vector<Rigid3d> CorrectionsOf(const FrameState& state) const {
    std::vector<Rigid3d> corrections;
    for (size_t r = 0; r < rig_.robots.size(); ++r) {
      const Eigen::Index first = 6 * static_cast<Eigen::Index>(r);
      const Tangent6 tangent = state.corrections.segment<6>(first).cwiseProduct(sigmas_.segment<6>(first));
      corrections.push_back(Retract(Rigid3d(), tangent));
    }
    return corrections;
  }

  Eigen::MatrixXd WithPrior(Eigen::MatrixXd normal) const {
    normal.diagonal().tail(sigmas_.size()).array() += 1;
    return normal;
  }

  std::optional<FrameEquations> EquationsAt(const FrameState& state) const {
    const UnknownLayout& layout = solution_.covariance.layout;
    const Eigen::Index size = num_coordinates_ + sigmas_.size();
    FrameEquations sum;
    sum.of_images = Eigen::MatrixXd::Zero(size, size);
    sum.gradient = Eigen::VectorXd::Zero(size);
    sum.gradient.tail(sigmas_.size()) = state.corrections;
    sum.by_unknowns = Eigen::MatrixXd::Zero(size, layout.size());
    sum.squares = state.corrections.squaredNorm();
    const RigNoise noise{solution_.pixel_sigmas_px, solution_.image_sigmas_px, {}};
    const std::vector<Rigid3d> grippers = Corrected(base_from_gripper_, CorrectionsOf(state));
    for (const CameraObservations& view : seen_) {
      const size_t camera = view.camera;
      const PlacedCamera placed = PlaceCamera(rig_, solution_, camera, grippers);
      const Rigid3d camera_from_frame = Inverse(placed.world_from_camera.pose) * state.world_from_frame;
      const std::optional<CameraRows> rows = RowsOf(solution_, camera, view.observations, camera_from_frame);
      if (!rows) return std::nullopt;
      Eigen::MatrixXd all(rows->residual.size(), rows->by_motion.cols() + rows->by_params.cols() + 1);
      all << rows->by_motion, rows->by_params, rows->residual;
      WeighPoseRows(PoseVarianceRatio(noise, {camera, 0, view.observations}), &all);
      const auto by_motion = all.leftCols<6>();
      // Another pose of the camera moves what it sees the other way.
      Eigen::MatrixXd by_state(all.rows(), size);
      by_state << (by_motion * Adjoint(camera_from_frame)).leftCols(num_coordinates_),
          -by_motion * placed.by_corrections * sigmas_.asDiagonal();
      Eigen::MatrixXd by_unknowns = -by_motion * placed.world_from_camera.by_unknowns;
      const UnknownBlock block = layout.Block(CameraBlock(rig_.cameras[camera]));
      for (Eigen::Index i = block.first; i < block.end(); ++i) by_unknowns.col(i) += all.col(6 + layout[i].index);
      sum.of_images += by_state.transpose() * by_state;
      sum.gradient += by_state.transpose() * all.rightCols<1>();
      sum.by_unknowns += by_state.transpose() * by_unknowns;
      sum.squares += all.rightCols<1>().squaredNorm();
    }
    return sum;
  }

  const RigProblem& rig_;
  const RigSolution& solution_;
  const std::vector<CameraObservations>& seen_;
  const std::vector<Rigid3d>& base_from_gripper_;
  Eigen::Index num_coordinates_;
  Eigen::VectorXd sigmas_;
};

}  // namespace

Outcome<RigLocation> LocateInRig(const RigProblem& rig, const RigSolution& solution,
                                 const std::vector<CameraObservations>& seen,
                                 const std::vector<Rigid3d>& base_from_gripper) {
  const FrameLocation location(rig, solution, seen, base_from_gripper, 6);
  // Each camera has up to two poses; the best for all of them is found from one of these.
  std::optional<LocatedFrame> best;
  for (size_t v = 0; v < seen.size(); ++v) {
    for (const TargetPose& pose : EstimateTargetPose(solution.cameras[seen[v].camera], seen[v].observations)) {
      std::optional<LocatedFrame> found = location.From(location.WorldFromCamera(v) * pose.camera_from_target);
      if (found && (!best || found->squares < best->squares)) best = std::move(found);
    }
  }
  if (!best) return Failure{"the points that the cameras see do not determine a pose of the target"};
  RigLocation result;
  result.world_from_target = best->world_from_frame;
  result.by_calibration = best->by_calibration;
  result.by_image = best->by_image;
  result.by_robot = best->by_robot;
  result.rms_px = location.RmsPx(*best);
  return result;
}

Outcome<RigPoint> TriangulateInRig(const RigProblem& rig, const RigSolution& solution,
                                   const std::vector<CameraPixel>& pixels,
                                   const std::vector<Rigid3d>& base_from_gripper) {
  if (pixels.size() < 2) return Failure{"a point needs its pixels in at least two cameras"};
  std::vector<CameraObservations> seen;
  for (const CameraPixel& pixel : pixels) {
    CameraObservations& view = seen.emplace_back();
    view.camera = pixel.camera;
    view.observations.ids = {0};
    view.observations.points_in_target = Points3::Zero(3, 1);
    view.observations.pixels = pixel.pixel;
  }
  const FrameLocation location(rig, solution, seen, base_from_gripper, 3);
  // The initial guess is the point with the least sum of squared distances from the rays.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (size_t v = 0; v < pixels.size(); ++v) {
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(solution.cameras[pixels[v].camera], pixels[v].pixel);
    if (!ray) return Failure{"camera " + rig.cameras[pixels[v].camera].name + " has no ray at this pixel"};
    const Rigid3d world_from_camera = location.WorldFromCamera(v);
    const Eigen::Vector3d direction = world_from_camera.rotation * *ray;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    normal += across;
    right += across * world_from_camera.translation;
  }
  const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
  constexpr double kParallel = 1e-9;
  if (!(factor.vectorD().minCoeff() > kParallel)) {
    return Failure{"the rays of the pixels are parallel: they do not determine a point"};
  }
  const Eigen::Vector3d guess = factor.solve(right);
  const std::optional<LocatedFrame> found = location.From({Eigen::Quaterniond::Identity(), guess});
  if (!found) return Failure{"the rays of the pixels do not meet in front of the cameras"};
  RigPoint point;
  point.in_world = found->world_from_frame.translation;
  point.by_calibration_m2 = found->by_calibration;
  point.by_image_m2 = found->by_image;
  point.by_robot_m2 = found->by_robot;
  point.rms_px = location.RmsPx(*found);
  return point;
}

}  // namespace heba
