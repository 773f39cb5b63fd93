#include "solvers/reprojection_cost.h"

#include <algorithm>
#include <cmath>

#include <ceres/sized_cost_function.h>

#include "heba/geometry/pose_block.h"
#include "solvers/robot_noise.h"
#include "solvers/view_reduction.h"

namespace heba {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// camera_from_target = (camera_mount_from_camera Exp(xi))^-1 M target_mount_from_target Exp(eta): to first order a left
// perturbation by -xi, and by Adjoint(camera_from_target) eta.
class HandEyeChain final : public PoseChain {
 public:
  explicit HandEyeChain(const Rigid3d& camera_mount_from_target_mount)
      : camera_mount_from_target_mount_(camera_mount_from_target_mount) {}
  int num_blocks() const override { return 2; }
  Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const override {
    const HandEye hand_eye{FromBlock(pose_blocks[0]), FromBlock(pose_blocks[1])};
    const Rigid3d camera_from_target = CameraFromTarget(hand_eye, camera_mount_from_target_mount_);
    if (left_from_tangent != nullptr) *left_from_tangent = {-Matrix6::Identity(), Adjoint(camera_from_target)};
    return camera_from_target;
  }

 private:
  Rigid3d camera_mount_from_target_mount_;
};

class CorrectedChain final : public PoseChain {
 public:
  CorrectedChain(Setup setup, const Rigid3d& camera_mount_from_target_mount)
      : setup_(setup), camera_mount_from_target_mount_(camera_mount_from_target_mount) {}
  int num_blocks() const override { return 3; }
  Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const override {
    const HandEye hand_eye{FromBlock(pose_blocks[0]), FromBlock(pose_blocks[1])};
    const Rigid3d correction = FromBlock(pose_blocks[2]);
    const Rigid3d camera_from_target = CameraFromTarget(setup_, hand_eye, camera_mount_from_target_mount_, correction);
    if (left_from_tangent != nullptr) {
      *left_from_tangent = {-Matrix6::Identity(), Adjoint(camera_from_target),
                            LeftFromCorrection(setup_, hand_eye, camera_mount_from_target_mount_, correction)};
    }
    return camera_from_target;
  }

 private:
  Setup setup_;
  Rigid3d camera_mount_from_target_mount_;
};

class CorrectionPrior final : public ceres::SizedCostFunction<6, 7> {
 public:
  explicit CorrectionPrior(const RobotNoise& noise) : noise_(noise) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Rigid3d correction = FromBlock(parameters[0]);
    const Tangent6 tangent = LocalCoordinates(Rigid3d(), correction);
    Eigen::Map<Tangent6> residual(residuals);
    residual.head<3>() = tangent.head<3>() / noise_.translation_m;
    residual.tail<3>() = tangent.tail<3>() / noise_.rotation_rad;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Matrix6 by_tangent = Matrix6::Zero();
      by_tangent.topLeftCorner<3, 3>() = correction.RotationMatrix() / noise_.translation_m;
      // The inverse right Jacobian of the rotation vector, to second order: corrections are small.
      const Eigen::Matrix3d skew = Skew(tangent.tail<3>());
      by_tangent.bottomRightCorner<3, 3>() =
          (Eigen::Matrix3d::Identity() + 0.5 * skew + skew * skew / 12) / noise_.rotation_rad;
      Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> jacobian(jacobians[0]);
      jacobian = by_tangent * TangentFromBlock(parameters[0]);
    }
    return true;
  }

 private:
  RobotNoise noise_;
};

class FreePoseChain final : public PoseChain {
 public:
  int num_blocks() const override { return 1; }
  Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const override {
    const Rigid3d camera_from_target = FromBlock(pose_blocks[0]);
    if (left_from_tangent != nullptr) *left_from_tangent = {Adjoint(camera_from_target)};
    return camera_from_target;
  }
};

class ReprojectionCost final : public ceres::CostFunction {
 public:
  ReprojectionCost(const CameraModel& model, const Observations& observations, double pixel_sigma_px, const Loss& loss,
                   std::unique_ptr<PoseChain> chain, const std::optional<TargetShape>& shape)
      : model_(model),
        observations_(observations),
        pixel_sigma_px_(pixel_sigma_px),
        loss_(loss),
        chain_(std::move(chain)),
        shape_(shape),
        num_params_(NumParams(model) + (shape ? TargetShape::kNumParams : 0)) {
    for (int i = 0; i < chain_->num_blocks(); ++i) mutable_parameter_block_sizes()->push_back(7);
    mutable_parameter_block_sizes()->push_back(num_params_);
    // One more row holds what the loss adds to the weighted sum of squares.
    set_num_residuals(NumReducedRows(model, observations, shape.has_value()) + 1);
  }

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const int num_poses = chain_->num_blocks();
    const double* camera = parameters[num_poses];
    std::optional<TargetShape> shape = shape_;
    if (shape) std::copy_n(camera + NumParams(model_), TargetShape::kNumParams, shape->params.begin());
    std::vector<Matrix6> left_from_tangent;
    const Rigid3d camera_from_target =
        chain_->Evaluate(parameters, jacobians == nullptr ? nullptr : &left_from_tangent);
    Eigen::Map<Eigen::VectorXd> residual(residuals, num_residuals());
    residual.setZero();
    if (jacobians == nullptr) {
      Observations shaped;
      if (shape) shaped = Shaped(observations_, *shape);
      double sum_rho = 0;
      if (!ViewCost(model_, camera, camera_from_target, shape ? shaped : observations_, pixel_sigma_px_, loss_,
                    &sum_rho)) {
        return false;
      }
      residual[0] = std::sqrt(sum_rho);
      return true;
    }
    ViewReduction reduction;
    if (!ReduceView(model_, camera, camera_from_target, observations_, pixel_sigma_px_, loss_, &reduction,
                    shape ? &*shape : nullptr)) {
      return false;
    }
    const Eigen::Index rows = reduction.factor.rows();
    residual.head(rows) = reduction.factor.rightCols<1>();
    residual[num_residuals() - 1] = std::sqrt(reduction.loss_remainder);
    for (int i = 0; i < num_poses; ++i) {
      if (jacobians[i] == nullptr) continue;
      Eigen::Map<RowMajor> jacobian(jacobians[i], num_residuals(), 7);
      jacobian.setZero();
      jacobian.topRows(rows) = reduction.factor.leftCols<6>() *
                               (left_from_tangent[static_cast<size_t>(i)] * TangentFromBlock(parameters[i]));
    }
    if (jacobians[num_poses] != nullptr) {
      Eigen::Map<RowMajor> jacobian(jacobians[num_poses], num_residuals(), num_params_);
      jacobian.setZero();
      jacobian.topRows(rows) = reduction.factor.middleCols(6, num_params_);
    }
    return true;
  }

 private:
  const CameraModel& model_;
  const Observations& observations_;
  double pixel_sigma_px_;
  const Loss& loss_;
  std::unique_ptr<PoseChain> chain_;
  std::optional<TargetShape> shape_;
  int num_params_;
};

}  // namespace

std::unique_ptr<PoseChain> MakeHandEyeChain(const Rigid3d& camera_mount_from_target_mount) {
  return std::make_unique<HandEyeChain>(camera_mount_from_target_mount);
}

std::unique_ptr<PoseChain> MakeCorrectedChain(Setup setup, const Rigid3d& camera_mount_from_target_mount) {
  return std::make_unique<CorrectedChain>(setup, camera_mount_from_target_mount);
}

std::unique_ptr<ceres::CostFunction> MakeCorrectionPrior(const RobotNoise& noise) {
  return std::make_unique<CorrectionPrior>(noise);
}

std::unique_ptr<PoseChain> MakeFreePoseChain() { return std::make_unique<FreePoseChain>(); }

std::unique_ptr<ceres::CostFunction> MakeReprojectionCost(const CameraModel& model, const Observations& observations,
                                                          double pixel_sigma_px, const Loss& loss,
                                                          std::unique_ptr<PoseChain> chain,
                                                          const std::optional<TargetShape>& shape) {
  return std::make_unique<ReprojectionCost>(model, observations, pixel_sigma_px, loss, std::move(chain), shape);
}

}  // namespace heba
