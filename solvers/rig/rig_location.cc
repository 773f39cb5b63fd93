#include "heba/rig_location.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/data/prediction.h"
#include "heba/data/target_shape.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/initial/target_pose.h"
#include "solvers/residuals/capture_loops.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// The pose of a camera in the world, with its derivatives by the unknowns of the calibration and by the corrections of
// the arms (six columns each).
struct PlacedCamera {
  PoseByUnknowns world_from_camera;
  Matrix6X by_corrections;
};

// Returns the poses of the grippers, corrected by the estimated errors of the arms.
std::vector<PoseByUnknowns> PlaceGrippers(const RigProblem& rig, const RigSolution& solution,
                                          const std::vector<StatedPose>& base_from_gripper) {
  std::vector<PoseByUnknowns> grippers;
  for (size_t r = 0; r < base_from_gripper.size(); ++r) {
    CorrectedPose corrected = Correct(rig, solution, r, base_from_gripper[r]);
    grippers.push_back({corrected.base_from_mount, std::move(corrected.by_unknowns)});
  }
  return grippers;
}

PlacedCamera PlaceCamera(const RigProblem& rig, const RigSolution& solution, size_t camera,
                         const std::vector<PoseByUnknowns>& grippers) {
  const UnknownLayout& layout = solution.covariance.layout;
  const Mount& mount = rig.cameras[camera].mount;
  const PoseByUnknowns mount_from_camera =
      UnknownPose(solution.poses.mount_from_camera[camera], layout, CameraPoseBlock(rig.cameras[camera]));
  PoseByUnknowns world_from_mount =
      UnknownPose(solution.poses.world_from_base[mount.robot], layout, BaseBlock(rig.robots[mount.robot]));
  Matrix6X by_corrections = Matrix6X::Zero(6, 6 * static_cast<Eigen::Index>(rig.robots.size()));
  if (mount.part == Mount::Part::kGripper) {
    world_from_mount = world_from_mount * grippers[mount.robot];
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

// The unknowns of a location: the frame, and the corrections of the arms' poses, in units of their sigmas.
struct FrameState {
  Rigid3d world_from_frame;
  Eigen::VectorXd corrections;
};

// A pose of which some coordinates of the tangent are estimated, and their covariances by source.
struct LocatedFrame {
  FrameState state;
  Eigen::MatrixXd by_calibration;
  Eigen::MatrixXd by_image;
  Eigen::MatrixXd by_robot;
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
  FrameLocation(const RigProblem& rig, const RigSolution& solution, const std::vector<CameraObservations>& seen,
                const std::vector<StatedPose>& base_from_gripper, Eigen::Index num_coordinates)
      : rig_(rig),
        solution_(solution),
        seen_(seen),
        grippers_(PlaceGrippers(rig, solution, base_from_gripper)),
        num_coordinates_(num_coordinates),
        sigmas_(CorrectionSigmas(solution)) {}

  // Returns nothing if a point has no image, or if the points do not determine the frame.
  std::optional<LocatedFrame> From(const Rigid3d& world_from_frame) const {
    constexpr int kMaxSteps = 50;
    FrameState state{world_from_frame, Eigen::VectorXd::Zero(sigmas_.size())};
    std::optional<FrameEquations> at = EquationsAt(state);
    for (int step = 0; at && step < kMaxSteps; ++step) {
      // The frame is determined if its least eigenvalue is above this share of the largest.
      constexpr double kLeast = 1e-12;
      const Eigen::VectorXd of_frame =
          EigenOfSymmetric(at->of_images.topLeftCorner(num_coordinates_, num_coordinates_)).values;
      if (!(of_frame.minCoeff() > kLeast * of_frame.maxCoeff())) return std::nullopt;
      Eigen::VectorXd tangent = -SolveSymmetric(WithPrior(at->of_images), at->gradient);
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
    const Eigen::MatrixXd inverse = InverseOfSymmetric(WithPrior(at->of_images));
    const auto of_frame = inverse.topRows(num_coordinates_);
    const Eigen::MatrixXd by_unknowns = of_frame * at->by_unknowns;
    const Eigen::MatrixXd by_prior = of_frame.rightCols(sigmas_.size());
    return LocatedFrame{state, by_unknowns * solution_.covariance.matrix * by_unknowns.transpose(),
                        of_frame * at->of_images * of_frame.transpose(), by_prior * by_prior.transpose(), at->squares};
  }

  // Returns RigLocation::p_value, from the part of each view that another pose of the target would explain: what the
  // others do not, such as a point that was read wrongly, is no contradiction between cameras.
  double PValueOf(const LocatedFrame& located) const {
    const std::optional<std::vector<ViewEquations>> views = ViewsAt(located.state);
    if (!views) return 0;
    Eigen::Index num_rows = 0;
    for (const ViewEquations& view : *views) num_rows += view.pose_part.cols();
    const Eigen::Index dof = num_rows - num_coordinates_;
    if (dof <= 0) return 1;
    Eigen::MatrixXd by_state(num_rows, num_coordinates_ + sigmas_.size());
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
    const auto by_corrections = by_state.rightCols(sigmas_.size());
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
    const std::vector<PoseByUnknowns> grippers = GrippersAt(located.state);
    for (const CameraObservations& view : seen_) {
      const Rigid3d world_from_camera = PlaceCamera(rig_, solution_, view.camera, grippers).world_from_camera.pose;
      const std::optional<SquaredErrors> errors =
          ViewErrors(solution_.cameras[view.camera], Inverse(world_from_camera) * located.state.world_from_frame,
                     view.observations);
      if (errors) sum.Add(*errors);
    }
    return sum.RmsPx().value_or(0);
  }

 private:
  std::vector<PoseByUnknowns> GrippersAt(const FrameState& state) const {
    const Eigen::Index num_unknowns = solution_.covariance.layout.size();
    std::vector<PoseByUnknowns> corrected;
    for (size_t r = 0; r < rig_.robots.size(); ++r) {
      const Eigen::Index first = 6 * static_cast<Eigen::Index>(r);
      const Tangent6 tangent = state.corrections.segment<6>(first).cwiseProduct(sigmas_.segment<6>(first));
      const PoseByUnknowns correction{Retract(Rigid3d(), tangent), Matrix6X::Zero(6, num_unknowns)};
      corrected.push_back(grippers_[r] * correction);
    }
    return corrected;
  }

  Eigen::MatrixXd WithPrior(Eigen::MatrixXd normal) const {
    normal.diagonal().tail(sigmas_.size()).array() += 1;
    return normal;
  }

  // Returns nothing if a point has no image.
  std::optional<std::vector<ViewEquations>> ViewsAt(const FrameState& state) const {
    const UnknownLayout& layout = solution_.covariance.layout;
    std::vector<ViewEquations> views;
    const FitNoise noise{solution_.pixel_sigmas_px, solution_.image_sigmas_px, {}};
    const std::vector<PoseByUnknowns> grippers = GrippersAt(state);
    for (const CameraObservations& view : seen_) {
      const size_t camera = view.camera;
      const PlacedCamera placed = PlaceCamera(rig_, solution_, camera, grippers);
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
      equations.by_state.resize(all.rows(), num_coordinates_ + sigmas_.size());
      equations.by_state << (by_motion * Adjoint(camera_from_frame)).leftCols(num_coordinates_),
          -by_motion * placed.by_corrections * sigmas_.asDiagonal();
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
    const Eigen::Index size = num_coordinates_ + sigmas_.size();
    FrameEquations sum;
    sum.of_images = Eigen::MatrixXd::Zero(size, size);
    sum.gradient = Eigen::VectorXd::Zero(size);
    sum.gradient.tail(sigmas_.size()) = state.corrections;
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

  const RigProblem& rig_;
  const RigSolution& solution_;
  const std::vector<CameraObservations>& seen_;
  std::vector<PoseByUnknowns> grippers_;
  Eigen::Index num_coordinates_;
  Eigen::VectorXd sigmas_;
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

RigLocation LocationOf(const FrameLocation& location, const LocatedFrame& found) {
  RigLocation result;
  result.world_from_target = found.state.world_from_frame;
  result.by_calibration = found.by_calibration;
  result.by_image = found.by_image;
  result.by_robot = found.by_robot;
  result.rms_px = location.RmsPx(found);
  result.p_value = location.PValueOf(found);
  return result;
}

// Locates a target for each of its symmetries. `shape`: that of the target, null if the points are as manufactured.
Outcome<std::vector<RigLocation>> LocateInEachOrder(const RigProblem& rig, const RigSolution& solution,
                                                    const std::vector<CameraObservations>& seen,
                                                    const std::vector<Rigid3d>& symmetries, const TargetShape* shape,
                                                    const std::vector<StatedPose>& base_from_gripper) {
  const Failure failure{"the points that the cameras see do not determine a pose of the target"};
  std::vector<ReadPoints> read;
  for (const CameraObservations& view : seen) {
    ReadPoints& points = read.emplace_back(ReadPoints{view.camera, {}});
    for (const Rigid3d& symmetry : symmetries) {
      points.orders.push_back(ReadInOrder(view.observations, symmetry, shape));
    }
  }
  const std::vector<PoseByUnknowns> grippers = PlaceGrippers(rig, solution, base_from_gripper);
  const auto world_from = [&](size_t camera) {
    return PlaceCamera(rig, solution, camera, grippers).world_from_camera.pose;
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
  std::vector<RigLocation> possible;
  for (const Rigid3d& symmetry : symmetries) {
    // The target as manufactured need not have the symmetries of its design, so each order is located by itself.
    std::vector<CameraObservations> views;
    for (const CameraObservations& view : best->views) {
      views.push_back({view.camera, ReadInOrder(view.observations, symmetry, shape)});
    }
    const FrameLocation location(rig, solution, views, base_from_gripper, 6);
    const std::optional<LocatedFrame> found = location.From(best->found.state.world_from_frame * Inverse(symmetry));
    if (!found) return failure;
    possible.push_back(LocationOf(location, *found));
  }
  const auto along_x = [](const RigLocation& located) {
    return (located.world_from_target.rotation * Eigen::Vector3d::UnitX()).x();
  };
  std::sort(possible.begin(), possible.end(),
            [&](const RigLocation& a, const RigLocation& b) { return along_x(a) > along_x(b); });
  return possible;
}

// Returns the smallest of the motions from a pose of one list to one of the other.
Rigid3d SmallestDifference(const std::vector<RigLocation>& from, const std::vector<RigLocation>& to) {
  const Rigid3d target_from_world = Inverse(from.front().world_from_target);
  Rigid3d smallest = target_from_world * to.front().world_from_target;
  for (const RigLocation& other : to) {
    const Rigid3d difference = target_from_world * other.world_from_target;
    if (AngleRad(Rigid3d(), difference) < AngleRad(Rigid3d(), smallest)) smallest = difference;
  }
  return smallest;
}

}  // namespace

Outcome<RigLocation> LocateInRig(const RigProblem& rig, const RigSolution& solution,
                                 const std::vector<CameraObservations>& seen,
                                 const std::vector<StatedPose>& base_from_gripper) {
  Outcome<std::vector<RigLocation>> located =
      LocateInEachOrder(rig, solution, seen, {Rigid3d()}, nullptr, base_from_gripper);
  if (!located) return Failure{located.reason()};
  return std::move(located->front());
}

Outcome<std::vector<RigLocation>> LocateTargetInRig(const RigProblem& rig, const RigSolution& solution, size_t target,
                                                    const std::vector<CameraObservations>& seen,
                                                    const std::vector<StatedPose>& base_from_gripper) {
  return LocateInEachOrder(rig, solution, seen, rig.targets[target].symmetries, &solution.shapes[target],
                           base_from_gripper);
}

std::optional<RigContradiction> FindContradiction(const RigProblem& rig, const RigSolution& solution, size_t target,
                                                  const std::vector<CameraObservations>& seen,
                                                  const std::vector<StatedPose>& base_from_gripper) {
  using Located = Outcome<std::vector<RigLocation>>;
  const auto locate = [&](const std::vector<CameraObservations>& views) {
    return LocateTargetInRig(rig, solution, target, views, base_from_gripper);
  };
  const auto agree = [](const Located& located) { return located && located->front().p_value >= kContradictionPValue; };
  if (agree(locate(seen))) return std::nullopt;
  std::vector<Located> alone;
  for (const CameraObservations& view : seen) alone.push_back(locate({view}));
  if (std::count_if(alone.begin(), alone.end(), [](const Located& located) { return located.ok(); }) < 2) {
    return std::nullopt;
  }
  RigContradiction contradiction;
  if (seen.size() == 2) {
    contradiction.difference = SmallestDifference(*alone[0], *alone[1]);
    return contradiction;
  }
  std::vector<size_t> wrong;
  Located others = Failure{""};
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

Outcome<RigPoint> TriangulateInRig(const RigProblem& rig, const RigSolution& solution,
                                   const std::vector<CameraPixel>& pixels,
                                   const std::vector<StatedPose>& base_from_gripper) {
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
  const std::vector<PoseByUnknowns> grippers = PlaceGrippers(rig, solution, base_from_gripper);
  // The initial guess is the point with the least sum of squared distances from the rays.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (size_t v = 0; v < pixels.size(); ++v) {
    const std::optional<Eigen::Vector3d> ray = UnprojectPixel(solution.cameras[pixels[v].camera], pixels[v].pixel);
    if (!ray) return Failure{"camera " + rig.cameras[pixels[v].camera].name + " has no ray at this pixel"};
    const Rigid3d world_from_camera = PlaceCamera(rig, solution, pixels[v].camera, grippers).world_from_camera.pose;
    const Eigen::Vector3d direction = world_from_camera.rotation * *ray;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    normal += across;
    right += across * world_from_camera.translation;
  }
  constexpr double kParallel = 1e-9;
  if (!(EigenOfSymmetric(normal).values[0] > kParallel)) {
    return Failure{"the rays of the pixels are parallel: they do not determine a point"};
  }
  const Eigen::Vector3d guess = SolveSymmetric(normal, right);
  const std::optional<LocatedFrame> found = location.From({Eigen::Quaterniond::Identity(), guess});
  if (!found) return Failure{"the rays of the pixels do not meet in front of the cameras"};
  RigPoint point;
  point.in_world = found->state.world_from_frame.translation;
  point.by_calibration_m2 = found->by_calibration;
  point.by_image_m2 = found->by_image;
  point.by_robot_m2 = found->by_robot;
  point.rms_px = location.RmsPx(*found);
  return point;
}

}  // namespace heba
