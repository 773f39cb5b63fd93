#include "heba/location.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <Eigen/LU>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "heba/data/prediction.h"
#include "heba/data/target_shape.h"
#include "heba/evaluation/metrics.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/initial/target_pose.h"
#include "solvers/residuals/capture_loops.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The poses of the grippers, corrected by the estimated errors of the arms, and the roots of the covariances of their
// corrections (Tangent6): one of each for each arm.
struct PlacedArms {
  std::vector<PoseByUnknowns> grippers;
  std::vector<Matrix6> roots;
};

// Returns a root of the covariance of an arm's correction at a pose: zero for an exact arm. The errors at other poses
// than those of the captures are not known unless the pose has been corrected by them: those that are smooth are noise,
// too.
Matrix6 CorrectionRoot(const Problem& rig, const Solution& solution, size_t robot, const StatedPose& stated) {
  if (!solution.robot_noise[robot]) return Matrix6::Zero();
  const bool is_corrected = EffectsOf(rig, robot) != nullptr && stated.effect != nullptr;
  const RobotNoise noise = is_corrected ? *solution.robot_noise[robot] : NoiseElsewhere(solution, robot);
  Tangent6 sigmas;
  sigmas << Eigen::Vector3d::Constant(noise.translation_m), Eigen::Vector3d::Constant(noise.rotation_rad);
  if (stated.gripper_by_joints.cols() == 0 || noise.joint_rad == 0) return sigmas.asDiagonal();
  constexpr double kExact = 1e-9;
  sigmas = sigmas.cwiseMax(kExact);
  const Matrix6X by_joints = noise.joint_rad * sigmas.cwiseInverse().asDiagonal() * stated.gripper_by_joints;
  const Matrix6 lower = CholeskyFactor<6>::OfIdentityPlusSquare(by_joints).lower().triangularView<Eigen::Lower>();
  return sigmas.asDiagonal() * lower;
}

PlacedArms PlaceArms(const Problem& rig, const Solution& solution, const std::vector<StatedPose>& base_from_gripper) {
  PlacedArms arms;
  for (size_t r = 0; r < base_from_gripper.size(); ++r) {
    CorrectedPose corrected = Correct(rig, solution, r, base_from_gripper[r]);
    arms.grippers.push_back({corrected.base_from_mount, std::move(corrected.by_unknowns)});
    arms.roots.push_back(CorrectionRoot(rig, solution, r, base_from_gripper[r]));
  }
  return arms;
}

// The pose of a camera in the world, with its derivatives by the unknowns of the calibration and by the corrections of
// the arms in units of their sigmas (six columns each).
struct PlacedCamera {
  PoseByUnknowns world_from_camera;
  Matrix6X by_corrections;
};

PlacedCamera PlaceCamera(const Problem& rig, const Solution& solution, size_t camera, const PlacedArms& arms) {
  const UnknownLayout& layout = solution.covariance.layout;
  const Mount& mount = rig.cameras[camera].mount;
  const PoseByUnknowns mount_from_camera =
      UnknownPose(solution.poses.mount_from_camera[camera], layout, CameraPoseBlock(rig.cameras[camera]));
  PoseByUnknowns world_from_mount =
      UnknownPose(solution.poses.world_from_base[mount.robot], layout, BaseBlock(rig.robots[mount.robot]));
  Matrix6X by_corrections = Matrix6X::Zero(6, 6 * static_cast<Eigen::Index>(rig.robots.size()));
  if (mount.part == Mount::Part::kGripper) {
    world_from_mount = world_from_mount * arms.grippers[mount.robot];
    // The correction multiplies the pose of the gripper on the right.
    by_corrections.middleCols<6>(6 * static_cast<Eigen::Index>(mount.robot)) =
        Adjoint(Inverse(mount_from_camera.pose)) * arms.roots[mount.robot];
  }
  return {world_from_mount * mount_from_camera, std::move(by_corrections)};
}

// Returns the uncertainty of a camera's pose, without any of an image.
PoseUncertainty UncertaintyOf(const PlacedCamera& camera) {
  const Matrix6 adjoint = Adjoint(camera.world_from_camera.pose);
  return {adjoint * camera.world_from_camera.by_unknowns, Matrix6::Zero(), adjoint * camera.by_corrections};
}

// The whitened rows of one camera: residuals, and their derivatives by the left perturbation of what the camera sees
// (m, rad, in the camera's frame) and by the parameters of the camera.
struct CameraRows {
  Eigen::MatrixXd by_motion;
  Eigen::MatrixXd by_params;
  Eigen::VectorXd residual;
};

std::optional<CameraRows> RowsOf(const Solution& solution, size_t camera, const Observations& observations,
                                 const Rigid3d& camera_from_target) {
  const Camera& of_camera = solution.cameras[camera];
  Points2 predicted;
  ProjectionJacobian jacobian;
  if (!Predict(of_camera.Model(), of_camera.params.data(), camera_from_target, observations, &predicted, &jacobian)) {
    return std::nullopt;
  }
  const Eigen::Index num_params = NumParams(of_camera.Model());
  const Eigen::Index num_points = predicted.cols();
  const double weight = 1 / std::max(kMinSigmaPx, solution.pixel_sigmas_px[camera]);
  Eigen::MatrixXd rows(2 * num_points, 6 + num_params + 1);
  for (Eigen::Index i = 0; i < num_points; ++i) {
    rows.block(2 * i, 0, 1, 6 + num_params) = weight * jacobian.u.col(i).transpose();
    rows.block(2 * i + 1, 0, 1, 6 + num_params) = weight * jacobian.v.col(i).transpose();
    rows.block<2, 1>(2 * i, 6 + num_params) = weight * (predicted.col(i) - observations.pixels.col(i));
  }
  return CameraRows{rows.leftCols(6), rows.middleCols(6, num_params), rows.col(6 + num_params)};
}

// The unknowns of a location: the frame, and the corrections of the arms' poses, in units of their sigmas.
struct FrameState {
  Rigid3d world_from_frame;
  Eigen::VectorXd corrections;
};

// A pose of which some coordinates of the tangent are estimated: their derivatives by the unknowns of the calibration
// and by the errors of the arms' poses, and their covariance that the images cause.
struct LocatedFrame {
  FrameState state;
  Eigen::MatrixXd by_unknowns;
  Eigen::MatrixXd by_image;
  Eigen::MatrixXd by_corrections;
  double squares = 0;  // Sum of the squared whitened residuals, those of the corrections included.
};

// The whitened rows of one view: residuals, and their derivatives by the coordinates of the frame followed by the
// corrections, and by the unknowns of the calibration.
struct ViewEquations {
  Eigen::MatrixXd by_state;
  Eigen::MatrixXd by_unknowns;
  Eigen::VectorXd residual;
  Eigen::MatrixXd pose_part;  // An orthonormal basis of what another pose of the target explains.
  double unmodelled = 0;      // The variance in these directions that belongs to no error of the model (kUnmodelledPx).
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
  FrameLocation(const Problem& rig, const Solution& solution, const std::vector<CameraObservations>& seen,
                const std::vector<StatedPose>& base_from_gripper, Eigen::Index num_coordinates)
      : rig_(rig),
        solution_(solution),
        seen_(seen),
        arms_(PlaceArms(rig, solution, base_from_gripper)),
        num_coordinates_(num_coordinates),
        num_corrections_(6 * static_cast<Eigen::Index>(rig.robots.size())) {}

  // Returns nothing if a point has no image, or if the points do not determine the frame.
  std::optional<LocatedFrame> From(const Rigid3d& world_from_frame) const {
    constexpr int kMaxSteps = 50;
    FrameState state{world_from_frame, Eigen::VectorXd::Zero(num_corrections_)};
    std::optional<FrameEquations> at = EquationsAt(state);
    for (int step = 0; at && step < kMaxSteps; ++step) {
      // The frame is determined if its least eigenvalue is above this share of the largest.
      constexpr double kLeast = 1e-12;
      const Eigen::VectorXd of_frame =
          EigenOfSymmetric(at->of_images.topLeftCorner(num_coordinates_, num_coordinates_)).values;
      if (!(of_frame.minCoeff() > kLeast * of_frame.maxCoeff())) return std::nullopt;
      Eigen::VectorXd tangent = -SolveSymmetric(WithPrior(at->of_images), at->gradient);
      // The decrease that the step promises is exact where that of the squares is lost in their rounding.
      constexpr double kNoDecrease = 1e-20;
      const bool is_last = -at->gradient.dot(tangent) <= kNoDecrease * (1 + at->squares);
      // A step that does not reduce the cost is halved.
      constexpr double kRounding = 1e-12;
      std::optional<FrameEquations> next;
      FrameState moved;
      for (int halving = 0; halving < 20; ++halving, tangent *= 0.5) {
        Tangent6 of_pose = Tangent6::Zero();
        of_pose.head(num_coordinates_) = tangent.head(num_coordinates_);
        moved = {Retract(state.world_from_frame, of_pose), state.corrections + tangent.tail(num_corrections_)};
        next = EquationsAt(moved);
        if (next && next->squares <= at->squares + kRounding * (1 + at->squares)) break;
        next.reset();
      }
      if (!next) break;
      state = moved;
      at = std::move(next);
      if (is_last) break;
    }
    if (!at) return std::nullopt;
    const Eigen::MatrixXd inverse = InverseOfSymmetric(WithPrior(at->of_images));
    const auto of_frame = inverse.topRows(num_coordinates_);
    return LocatedFrame{state, -of_frame * at->by_unknowns, of_frame * at->of_images * of_frame.transpose(),
                        of_frame.rightCols(num_corrections_), at->squares};
  }

  // Returns LocatedTarget::p_value, from the part of each view that another pose of the target would explain: what the
  // others do not, such as a point that was read wrongly, is no contradiction between cameras.
  double PValueOf(const LocatedFrame& located) const {
    const std::optional<std::vector<ViewEquations>> views = ViewsAt(located.state);
    if (!views) return 0;
    Eigen::Index num_rows = 0;
    for (const ViewEquations& view : *views) num_rows += view.pose_part.cols();
    const Eigen::Index dof = num_rows - num_coordinates_;
    if (dof <= 0) return 1;
    Eigen::MatrixXd by_state(num_rows, num_coordinates_ + num_corrections_);
    Eigen::MatrixXd by_unknowns(num_rows, solution_.covariance.matrix.cols());
    Eigen::VectorXd residual(num_rows);
    Eigen::VectorXd variances(num_rows);
    Eigen::Index row = 0;
    for (const ViewEquations& view : *views) {
      const Eigen::Index size = view.pose_part.cols();
      by_state.middleRows(row, size) = view.pose_part.transpose() * view.by_state;
      by_unknowns.middleRows(row, size) = view.pose_part.transpose() * view.by_unknowns;
      residual.segment(row, size) = view.pose_part.transpose() * view.residual;
      variances.segment(row, size).setConstant(1 + view.unmodelled);
      row += size;
    }
    const auto by_frame = by_state.leftCols(num_coordinates_);
    const auto by_corrections = by_state.rightCols(num_corrections_);
    residual -= by_corrections * located.state.corrections;
    Eigen::MatrixXd covariance = by_unknowns * solution_.covariance.matrix * by_unknowns.transpose() +
                                 by_corrections * by_corrections.transpose();
    covariance.diagonal() += variances;
    // The frame takes up its part of the whitened residuals.
    const auto root = Cholesky(covariance);
    if (!root) return 0;
    const Eigen::VectorXd rotated = HouseholderFactor(root->SolveLower(by_frame)).Rotated(root->SolveLower(residual));
    const auto num_left = static_cast<double>(dof);
    return FisherTail(rotated.tail(dof).squaredNorm() / num_left, num_left, solution_.covariance_dof);
  }

  // Returns the RMS of the distances of all points.
  double RmsPx(const LocatedFrame& located) const {
    SquaredErrors sum;
    const PlacedArms arms = ArmsAt(located.state);
    for (const CameraObservations& view : seen_) {
      const Rigid3d world_from_camera = PlaceCamera(rig_, solution_, view.camera, arms).world_from_camera.pose;
      const std::optional<SquaredErrors> errors =
          ViewErrors(solution_.cameras[view.camera], Inverse(world_from_camera) * located.state.world_from_frame,
                     view.observations);
      if (errors) sum.Add(*errors);
    }
    return sum.RmsPx().value_or(0);
  }

 private:
  PlacedArms ArmsAt(const FrameState& state) const {
    const Eigen::Index num_unknowns = solution_.covariance.layout.size();
    PlacedArms corrected = arms_;
    for (size_t r = 0; r < corrected.grippers.size(); ++r) {
      const Tangent6 tangent = arms_.roots[r] * state.corrections.segment<6>(6 * static_cast<Eigen::Index>(r));
      const PoseByUnknowns correction{Retract(Rigid3d(), tangent), Matrix6X::Zero(6, num_unknowns)};
      corrected.grippers[r] = corrected.grippers[r] * correction;
    }
    return corrected;
  }

  Eigen::MatrixXd WithPrior(Eigen::MatrixXd normal) const {
    normal.diagonal().tail(num_corrections_).array() += 1;
    return normal;
  }

  // Returns nothing if a point has no image.
  std::optional<std::vector<ViewEquations>> ViewsAt(const FrameState& state) const {
    const UnknownLayout& layout = solution_.covariance.layout;
    std::vector<ViewEquations> views;
    const FitNoise noise{solution_.pixel_sigmas_px, solution_.image_sigmas_px, {}};
    const PlacedArms arms = ArmsAt(state);
    for (const CameraObservations& view : seen_) {
      const size_t camera = view.camera;
      const PlacedCamera placed = PlaceCamera(rig_, solution_, camera, arms);
      const Rigid3d camera_from_frame = Inverse(placed.world_from_camera.pose) * state.world_from_frame;
      const std::optional<CameraRows> rows = RowsOf(solution_, camera, view.observations, camera_from_frame);
      if (!rows) return std::nullopt;
      Eigen::MatrixXd all(rows->residual.size(), rows->by_motion.cols() + rows->by_params.cols() + 1);
      all << rows->by_motion, rows->by_params, rows->residual;
      const double ratio = PoseVarianceRatio(noise, {camera, 0, view.observations});
      WeighPoseRows(ratio, &all);
      const auto by_motion = all.leftCols<6>();
      ViewEquations& equations = views.emplace_back();
      // Another pose of the camera moves what it sees the other way.
      equations.by_state.resize(all.rows(), num_coordinates_ + num_corrections_);
      equations.by_state << (by_motion * Adjoint(camera_from_frame)).leftCols(num_coordinates_),
          -by_motion * placed.by_corrections;
      equations.by_unknowns = -by_motion * placed.world_from_camera.by_unknowns;
      const UnknownBlock block = layout.Block(CameraBlock(rig_.cameras[camera]));
      for (Eigen::Index i = block.first; i < block.end(); ++i) {
        equations.by_unknowns.col(i) += all.col(6 + layout[i].index);
      }
      equations.residual = all.rightCols<1>();
      equations.pose_part = HouseholderFactor(by_motion).Basis();
      equations.unmodelled =
          PoseErrorVariance(kUnmodelledPx, solution_.pixel_sigmas_px[camera], view.observations.size()) / ratio;
    }
    return views;
  }

  std::optional<FrameEquations> EquationsAt(const FrameState& state) const {
    const std::optional<std::vector<ViewEquations>> views = ViewsAt(state);
    if (!views) return std::nullopt;
    const Eigen::Index size = num_coordinates_ + num_corrections_;
    FrameEquations sum;
    sum.of_images = Eigen::MatrixXd::Zero(size, size);
    sum.gradient = Eigen::VectorXd::Zero(size);
    sum.gradient.tail(num_corrections_) = state.corrections;
    sum.by_unknowns = Eigen::MatrixXd::Zero(size, solution_.covariance.layout.size());
    sum.squares = state.corrections.squaredNorm();
    for (const ViewEquations& view : *views) {
      sum.of_images += view.by_state.transpose() * view.by_state;
      sum.gradient += view.by_state.transpose() * view.residual;
      sum.by_unknowns += view.by_state.transpose() * view.by_unknowns;
      sum.squares += view.residual.squaredNorm();
    }
    return sum;
  }

  const Problem& rig_;
  const Solution& solution_;
  const std::vector<CameraObservations>& seen_;
  PlacedArms arms_;
  Eigen::Index num_coordinates_;
  Eigen::Index num_corrections_;
};

// The points of a camera in the orders in which they can be read, one for each symmetry of the target.
struct ReadPoints {
  size_t camera = 0;
  std::vector<Observations> orders;
};

// Returns the points in the order that a symmetry of the target leads to, as manufactured.
Observations ReadInOrder(Observations observations, const Rigid3d& symmetry, const TargetShape* shape) {
  for (Eigen::Index i = 0; i < observations.size(); ++i) {
    const Eigen::Vector3d designed = observations.points_in_target.col(i);
    observations.points_in_target.col(i) = symmetry * designed;
  }
  return shape != nullptr ? ApplyShape(observations, *shape) : observations;
}

// Returns the index of the order that fits a pose best; nothing if the points have no image from it in any order.
std::optional<size_t> FindBestOrder(const Camera& camera, const ReadPoints& points, const Rigid3d& camera_from_target) {
  std::optional<size_t> best;
  double least_px2 = std::numeric_limits<double>::infinity();
  for (size_t s = 0; s < points.orders.size(); ++s) {
    const std::optional<SquaredErrors> errors = ViewErrors(camera, camera_from_target, points.orders[s]);
    if (!errors || errors->sum_px2 >= least_px2) continue;
    least_px2 = errors->sum_px2;
    best = s;
  }
  return best;
}

// Returns the mean of the points that all cameras see, in the target's frame.
Eigen::Vector3d MiddleOf(const std::vector<CameraObservations>& seen) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Index num_points = 0;
  for (const CameraObservations& view : seen) {
    sum += view.observations.points_in_target.rowwise().sum();
    num_points += view.observations.points_in_target.cols();
  }
  return sum / static_cast<double>(std::max<Eigen::Index>(1, num_points));
}

LocatedTarget TargetOf(const Solution& solution, const FrameLocation& location, const LocatedFrame& found,
                       const Eigen::Vector3d& middle_in_target) {
  LocatedTarget located;
  located.world_from_target = found.state.world_from_frame;
  located.rms_px = location.RmsPx(found);
  located.p_value = location.PValueOf(found);
  const Matrix6 adjoint = Adjoint(located.world_from_target);
  located.uncertainty = {adjoint * found.by_unknowns, adjoint * found.by_image * adjoint.transpose(),
                         adjoint * found.by_corrections};
  located.pose_covariance = {found.by_unknowns * solution.covariance.matrix * found.by_unknowns.transpose(),
                             found.by_image, found.by_corrections * found.by_corrections.transpose()};
  located.covariance =
      CovarianceOfPoint(solution.covariance, located.uncertainty, located.world_from_target * middle_in_target);
  return located;
}

// Locates a target for each of its symmetries. `shape`: that of the target, null if the points are as manufactured.
Outcome<std::vector<LocatedTarget>> LocateInEachOrder(const Problem& rig, const Solution& solution,
                                                      const std::vector<CameraObservations>& seen,
                                                      const std::vector<Rigid3d>& symmetries, const TargetShape* shape,
                                                      const std::vector<StatedPose>& base_from_gripper) {
  CHECK(!symmetries.empty());
  Failure failure{FailureCode("no_pose")};
  if (seen.size() == 1) failure.numbers = {{"points", seen.front().observations.size()}};
  std::vector<ReadPoints> read;
  for (const CameraObservations& view : seen) {
    ReadPoints& points = read.emplace_back(ReadPoints{view.camera, {}});
    for (const Rigid3d& symmetry : symmetries) {
      points.orders.push_back(ReadInOrder(view.observations, symmetry, shape));
    }
  }
  const PlacedArms arms = PlaceArms(rig, solution, base_from_gripper);
  const auto world_from = [&](size_t camera) {
    return PlaceCamera(rig, solution, camera, arms).world_from_camera.pose;
  };
  // Each camera has up to two poses; the best for all of them is found from one of these, with the points of the other
  // cameras in the order that fits it best.
  struct Best {
    LocatedFrame found;
    std::vector<CameraObservations> views;  // The points have their places in the design.
  };
  std::optional<Best> best;
  for (size_t v = 0; v < read.size(); ++v) {
    const Camera& of_start = solution.cameras[read[v].camera];
    for (const TargetPose& pose : EstimateTargetPose(of_start, read[v].orders.front())) {
      const Rigid3d world_from_target = world_from(read[v].camera) * pose.camera_from_target;
      std::vector<CameraObservations> views;
      std::vector<CameraObservations> as_designed;
      for (size_t w = 0; w < read.size(); ++w) {
        const size_t camera = read[w].camera;
        std::optional<size_t> order = 0;
        if (w != v) {
          order = FindBestOrder(solution.cameras[camera], read[w], Inverse(world_from(camera)) * world_from_target);
        }
        if (!order) break;
        views.push_back({camera, read[w].orders[*order]});
        as_designed.push_back({camera, ReadInOrder(seen[w].observations, symmetries[*order], nullptr)});
      }
      if (views.size() < read.size()) continue;
      std::optional<LocatedFrame> found =
          FrameLocation(rig, solution, views, base_from_gripper, 6).From(world_from_target);
      if (found && (!best || found->squares < best->found.squares)) best = {std::move(*found), std::move(as_designed)};
    }
  }
  if (!best) return failure;
  std::vector<LocatedTarget> possible;
  for (const Rigid3d& symmetry : symmetries) {
    // The target as manufactured need not have the symmetries of its design, so each order is located by itself.
    std::vector<CameraObservations> views;
    for (const CameraObservations& view : best->views) {
      views.push_back({view.camera, ReadInOrder(view.observations, symmetry, shape)});
    }
    const FrameLocation location(rig, solution, views, base_from_gripper, 6);
    const std::optional<LocatedFrame> found = location.From(best->found.state.world_from_frame * Inverse(symmetry));
    if (!found) return failure;
    possible.push_back(TargetOf(solution, location, *found, MiddleOf(views)));
  }
  const auto along_x = [](const LocatedTarget& located) {
    return (located.world_from_target.rotation * Eigen::Vector3d::UnitX()).x();
  };
  std::sort(possible.begin(), possible.end(),
            [&](const LocatedTarget& a, const LocatedTarget& b) { return along_x(a) > along_x(b); });
  return possible;
}

// Returns the smallest of the motions from a pose of one list to one of the other.
Rigid3d SmallestDifference(const std::vector<LocatedTarget>& from, const std::vector<LocatedTarget>& to) {
  const Rigid3d target_from_world = Inverse(from.front().world_from_target);
  Rigid3d smallest = target_from_world * to.front().world_from_target;
  for (const LocatedTarget& other : to) {
    const Rigid3d difference = target_from_world * other.world_from_target;
    if (AngleRad(Rigid3d(), difference) < AngleRad(Rigid3d(), smallest)) smallest = difference;
  }
  return smallest;
}

// Returns the covariance with zeros for variances that only rounding made negative: along the normal of a plane that
// stands still, a position has no variance.
Eigen::Matrix3d WithoutRounding(Eigen::Matrix3d covariance) {
  constexpr double kRounding = 1e-12;
  const double least = -kRounding * covariance.trace();
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (covariance(i, i) < 0 && covariance(i, i) >= least) covariance(i, i) = 0;
  }
  return covariance;
}

// The intersection of a ray with a plane in the camera frame, and its derivatives.
struct RayPlaneIntersection {
  Eigen::Vector3d in_camera = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 2> by_pixel;
  Eigen::Vector3d by_plane = Eigen::Vector3d::Zero();  // Derivative by a shift of the plane along its normal.
  Eigen::MatrixXd by_params;
};

Outcome<RayPlaneIntersection> IntersectRayPlane(const Camera& camera, const Eigen::Vector2d& pixel,
                                                const Eigen::Vector3d& normal, double distance_m) {
  const std::optional<Eigen::Vector3d> ray = UnprojectPixel(camera, pixel);
  if (!ray) return Failure{FailureCode("no_ray")};
  constexpr double kGrazing = 1e-3;
  const double slope = normal.dot(*ray);
  const double range_m = distance_m / slope;
  if (std::abs(slope) < kGrazing || !(range_m > 0)) return Failure{FailureCode("ray_beside_plane")};
  RayPlaneIntersection meeting;
  meeting.in_camera = range_m * *ray;
  Points3 point(3, 1);
  point = meeting.in_camera;
  Points2 image;
  ProjectionJacobian jacobian;
  if (!camera.Model().Project(camera.params.data(), point, &image, &jacobian)) {
    return Failure{FailureCode("plane_behind")};
  }
  // The point stays on its ray and on the plane: its two pixel coordinates and its distance along the normal determine
  // it.
  Eigen::Matrix3d left;
  left.row(0) = jacobian.u.topRows<3>().transpose();
  left.row(1) = jacobian.v.topRows<3>().transpose();
  left.row(2) = normal.transpose();
  const Eigen::Matrix3d inverse = left.inverse();
  meeting.by_pixel = inverse.leftCols<2>();
  meeting.by_plane = inverse.col(2);
  const Eigen::Index num_params = jacobian.u.rows() - 3;
  meeting.by_params = -meeting.by_pixel.col(0) * jacobian.u.bottomRows(num_params).transpose() -
                      meeting.by_pixel.col(1) * jacobian.v.bottomRows(num_params).transpose();
  return meeting;
}

// Intersects the ray of a pixel with a plane, which has the uncertainty of `frame`, in which it lies.
Outcome<LocatedPoint> PointOnPlane(const Problem& rig, const Solution& solution, const CameraPixel& pixel,
                                   const Plane& plane, const PoseUncertainty* frame, const PlacedArms& arms) {
  const PlacedCamera placed = PlaceCamera(rig, solution, pixel.camera, arms);
  const Rigid3d& world_from_camera = placed.world_from_camera.pose;
  const Eigen::Matrix3d rotation = world_from_camera.RotationMatrix();
  const Outcome<RayPlaneIntersection> meeting =
      IntersectRayPlane(solution.cameras[pixel.camera], pixel.pixel, rotation.transpose() * plane.normal,
                        plane.distance_m - plane.normal.dot(world_from_camera.translation));
  if (!meeting) return meeting.failure();
  LocatedPoint point;
  point.in_world = world_from_camera * meeting->in_camera;
  // A motion of the camera moves the point along, and the plane moves it back along its ray; a motion of the plane
  // moves it along its ray, too.
  const Eigen::Matrix3d by_plane = rotation * meeting->by_plane * plane.normal.transpose();
  const Eigen::Matrix<double, 3, 6> by_motion = PointByMotion(point.in_world);
  const Eigen::Matrix<double, 3, 6> by_camera = by_motion - by_plane * by_motion;
  const Eigen::Matrix<double, 3, 6> by_frame = by_plane * by_motion;
  // The intrinsics that locate the point are those of the calibration, so their errors are correlated with its poses.
  const PoseUncertainty camera = UncertaintyOf(placed);
  Eigen::MatrixXd by_unknowns = by_camera * camera.by_unknowns;
  const UnknownLayout& layout = solution.covariance.layout;
  const UnknownBlock block = layout.Block(CameraBlock(rig.cameras[pixel.camera]));
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    by_unknowns.col(i) += rotation * meeting->by_params.col(layout[i].index);
  }
  Eigen::MatrixXd by_corrections = by_camera * camera.by_corrections;
  // A pixel takes part in the error of its image as a whole.
  const double sigma_px = std::hypot(solution.pixel_sigmas_px[pixel.camera], solution.image_sigmas_px[pixel.camera]);
  const Eigen::Matrix<double, 3, 2> by_pixel = sigma_px * rotation * meeting->by_pixel;
  Eigen::Matrix3d by_image_m2 = by_pixel * by_pixel.transpose();
  if (frame != nullptr) {
    by_unknowns += by_frame * frame->by_unknowns;
    by_corrections += by_frame * frame->by_corrections;
    by_image_m2 += by_frame * frame->by_image * by_frame.transpose();
  }
  point.covariance = {WithoutRounding(by_unknowns * solution.covariance.matrix * by_unknowns.transpose()),
                      WithoutRounding(by_image_m2), WithoutRounding(by_corrections * by_corrections.transpose())};
  return point;
}

}  // namespace

PositionCovariance CovarianceOfPoint(const Covariance& covariance, const PoseUncertainty& frame,
                                     const Eigen::Vector3d& in_world) {
  const Eigen::Matrix<double, 3, 6> by_motion = PointByMotion(in_world);
  const Eigen::MatrixXd by_unknowns = by_motion * frame.by_unknowns;
  return {by_unknowns * covariance.matrix * by_unknowns.transpose(), by_motion * frame.by_image * by_motion.transpose(),
          by_motion * frame.ByRobot() * by_motion.transpose()};
}

Outcome<LocatedTarget> LocateInCell(const Problem& rig, const Solution& solution,
                                    const std::vector<CameraObservations>& seen,
                                    const std::vector<StatedPose>& base_from_gripper) {
  Outcome<std::vector<LocatedTarget>> located =
      LocateInEachOrder(rig, solution, seen, {Rigid3d()}, nullptr, base_from_gripper);
  if (!located) return located.failure();
  return std::move(located->front());
}

Outcome<std::vector<LocatedTarget>> LocateTargetInCell(const Problem& rig, const Solution& solution, size_t target,
                                                       const std::vector<CameraObservations>& seen,
                                                       const std::vector<StatedPose>& base_from_gripper) {
  return LocateInEachOrder(rig, solution, seen, rig.targets[target].symmetries, &solution.shapes[target],
                           base_from_gripper);
}

std::optional<LocationContradiction> FindContradiction(const Problem& rig, const Solution& solution, size_t target,
                                                       const std::vector<CameraObservations>& seen,
                                                       const std::vector<StatedPose>& base_from_gripper) {
  using Located = Outcome<std::vector<LocatedTarget>>;
  const auto locate = [&](const std::vector<CameraObservations>& views) {
    return LocateTargetInCell(rig, solution, target, views, base_from_gripper);
  };
  const auto agree = [](const Located& located) { return located && located->front().p_value >= kContradictionPValue; };
  if (agree(locate(seen))) return std::nullopt;
  std::vector<Located> alone;
  for (const CameraObservations& view : seen) alone.push_back(locate({view}));
  if (std::count_if(alone.begin(), alone.end(), [](const Located& located) { return located.ok(); }) < 2) {
    return std::nullopt;
  }
  LocationContradiction contradiction;
  if (seen.size() == 2) {
    contradiction.difference = SmallestDifference(*alone[0], *alone[1]);
    return contradiction;
  }
  std::vector<size_t> wrong;
  Located others;
  for (size_t v = 0; v < seen.size(); ++v) {
    std::vector<CameraObservations> views = seen;
    views.erase(views.begin() + static_cast<std::ptrdiff_t>(v));
    Located located = locate(views);
    if (!agree(located)) continue;
    wrong.push_back(v);
    others = std::move(located);
  }
  if (wrong.size() != 1) return contradiction;
  contradiction.camera = seen[wrong.front()].camera;
  if (alone[wrong.front()]) contradiction.difference = SmallestDifference(*others, *alone[wrong.front()]);
  return contradiction;
}

Outcome<LocatedPoint> TriangulateInCell(const Problem& rig, const Solution& solution,
                                        const std::vector<CameraPixel>& pixels,
                                        const std::vector<StatedPose>& base_from_gripper) {
  if (pixels.size() < 2) return Failure{FailureCode("one_camera")};
  std::vector<CameraObservations> seen;
  for (const CameraPixel& pixel : pixels) {
    CameraObservations& view = seen.emplace_back();
    view.camera = pixel.camera;
    view.observations.ids = {0};
    view.observations.points_in_target = Points3::Zero(3, 1);
    view.observations.pixels = pixel.pixel;
  }
  const FrameLocation location(rig, solution, seen, base_from_gripper, 3);
  const PlacedArms arms = PlaceArms(rig, solution, base_from_gripper);
  // The initial guess is the point with the least sum of squared distances from the rays.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (size_t v = 0; v < pixels.size(); ++v) {
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(solution.cameras[pixels[v].camera], pixels[v].pixel);
    if (!ray) return Failure{FailureCode("camera_without_ray"), {}, {{"camera", rig.cameras[pixels[v].camera].name}}};
    const Rigid3d world_from_camera = PlaceCamera(rig, solution, pixels[v].camera, arms).world_from_camera.pose;
    const Eigen::Vector3d direction = world_from_camera.rotation * *ray;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    normal += across;
    right += across * world_from_camera.translation;
  }
  constexpr double kParallel = 1e-9;
  if (!(EigenOfSymmetric(normal).values[0] > kParallel)) {
    return Failure{FailureCode("parallel_rays")};
  }
  const Eigen::Vector3d guess = SolveSymmetric(normal, right);
  const std::optional<LocatedFrame> found = location.From({Eigen::Quaterniond::Identity(), guess});
  if (!found) return Failure{FailureCode("rays_behind")};
  LocatedPoint point;
  // The frame has the axes of the world.
  point.in_world = found->state.world_from_frame.translation;
  point.covariance = {found->by_unknowns * solution.covariance.matrix * found->by_unknowns.transpose(), found->by_image,
                      found->by_corrections * found->by_corrections.transpose()};
  point.rms_px = location.RmsPx(*found);
  return point;
}

Outcome<LocatedPoint> LocatePixelInCell(const Problem& rig, const Solution& solution, const CameraPixel& pixel,
                                        const Plane& plane, const std::vector<StatedPose>& base_from_gripper) {
  return PointOnPlane(rig, solution, pixel, plane, nullptr, PlaceArms(rig, solution, base_from_gripper));
}

Outcome<LocatedPoint> LocatePixelOnTargetInCell(const Problem& rig, const Solution& solution, const CameraPixel& pixel,
                                                const LocatedTarget& target,
                                                const std::vector<StatedPose>& base_from_gripper) {
  const Eigen::Vector3d normal = target.world_from_target.rotation * Eigen::Vector3d::UnitZ();
  const Plane plane{normal, normal.dot(target.world_from_target.translation)};
  return PointOnPlane(rig, solution, pixel, plane, &target.uncertainty, PlaceArms(rig, solution, base_from_gripper));
}

PositionCovariance CovarianceOfReachInCell(const Problem& rig, const Solution& solution, size_t robot,
                                           const LocatedTarget& located, const StatedPose& command,
                                           const Eigen::Vector3d& point_in_gripper,
                                           const Eigen::Vector3d& point_in_target) {
  CorrectedPose corrected = Correct(rig, solution, robot, command);
  const PoseByUnknowns base_from_gripper{corrected.base_from_mount, std::move(corrected.by_unknowns)};
  const PoseByUnknowns world_from_gripper =
      UnknownPose(solution.poses.world_from_base[robot], solution.covariance.layout, BaseBlock(rig.robots[robot])) *
      base_from_gripper;
  const Matrix6 adjoint = Adjoint(world_from_gripper.pose);
  const Eigen::Matrix<double, 3, 6> by_gripper = PointByMotion(world_from_gripper.pose * point_in_gripper) * adjoint;
  const Eigen::Matrix<double, 3, 6> by_target = PointByMotion(located.world_from_target * point_in_target);
  const Eigen::MatrixXd by_unknowns =
      by_gripper * world_from_gripper.by_unknowns - by_target * located.uncertainty.by_unknowns;
  const Eigen::MatrixXd by_command = by_gripper * CorrectionRoot(rig, solution, robot, command);
  return {by_unknowns * solution.covariance.matrix * by_unknowns.transpose(),
          by_target * located.uncertainty.by_image * by_target.transpose(),
          by_target * located.uncertainty.ByRobot() * by_target.transpose() + by_command * by_command.transpose()};
}

}  // namespace heba
