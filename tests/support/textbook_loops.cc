#include "tests/support/textbook_loops.h"

#include <cmath>
#include <memory>

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

namespace heba {
namespace {

template <class T>
struct Pose {
  Eigen::Matrix<T, 3, 3> rotation = Eigen::Matrix<T, 3, 3>::Identity();
  Eigen::Matrix<T, 3, 1> translation = Eigen::Matrix<T, 3, 1>::Zero();

  Pose operator*(const Pose& right) const {
    return {rotation * right.rotation, rotation * right.translation + translation};
  }
  Pose Inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
};

template <class T>
Pose<T> Constant(const Rigid3d& pose) {
  return {pose.RotationMatrix().cast<T>(), pose.translation.cast<T>()};
}

// Returns [Exp(w), v] for the tangent (v, w).
template <class T>
Pose<T> FromTangent(const Eigen::Matrix<T, 6, 1>& tangent) {
  Pose<T> pose;
  ceres::AngleAxisToRotationMatrix(tangent.data() + 3, pose.rotation.data());
  pose.translation = tangent.template head<3>();
  return pose;
}

template <class T>
Eigen::Matrix<T, 2, 1> Project(bool is_fisheye, const T* c, const Eigen::Matrix<T, 3, 1>& point) {
  T x = point.x() / point.z();
  T y = point.y() / point.z();
  const T r2 = x * x + y * y;
  if (is_fisheye) {
    using std::atan;
    using std::sqrt;
    const T r = sqrt(r2);
    const T angle = atan(r);
    const T a2 = angle * angle;
    const T ratio = angle * (T(1) + a2 * (c[4] + a2 * (c[5] + a2 * (c[6] + a2 * c[7])))) / r;
    return {c[0] * ratio * x + c[2], c[1] * ratio * y + c[3]};
  }
  const T radial = T(1) + r2 * (c[4] + r2 * (c[5] + r2 * c[8]));
  const T u = x * radial + T(2) * c[6] * x * y + c[7] * (r2 + T(2) * x * x);
  const T v = y * radial + c[6] * (r2 + T(2) * y * y) + T(2) * c[7] * x * y;
  return {c[0] * u + c[2], c[1] * v + c[3]};
}

// The places of the parameters of a residual among its blocks: a block of six for each pose, which is the tangent at
// its reference; effects; camera; shape.
struct BlockPlaces {
  std::vector<int> of_factor;  // One for each factor of the loop; -1 if it is known.
  std::vector<Rigid3d> references;
  int camera = 0;
  int shape = -1;
};

struct PointResidual {
  std::vector<LoopFactor> factors;
  BlockPlaces places;
  TargetShape shape;
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;
  double weight;
  bool is_fisheye;

  template <class T>
  bool operator()(T const* const* blocks, T* residual) const {
    Pose<T> camera_from_target;
    for (size_t j = 0; j < factors.size(); ++j) {
      Pose<T> pose = Constant<T>(factors[j].known);
      if (factors[j].kind == LoopFactor::Kind::kEffect) {
        // The derivative at zero is the matrix of a linear effect.
        Matrix6X g;
        const auto size = EffectSize(factors[j]);
        factors[j].effect->Evaluate(Eigen::VectorXd::Zero(size), &g);
        Eigen::Matrix<T, 6, 1> tangent = Eigen::Matrix<T, 6, 1>::Zero();
        for (Eigen::Index k = 0; k < size; ++k) tangent += g.col(k).cast<T>() * blocks[places.of_factor[j]][k];
        pose = FromTangent<T>(tangent);
      } else if (places.of_factor[j] >= 0) {
        const Eigen::Map<const Eigen::Matrix<T, 6, 1>> tangent(blocks[places.of_factor[j]]);
        pose = Constant<T>(places.references[j]) * FromTangent<T>(tangent);
      }
      camera_from_target = camera_from_target * (factors[j].is_inverted ? pose.Inverse() : pose);
    }
    Eigen::Matrix<T, 3, 1> actual = point.cast<T>();
    if (places.shape >= 0) {
      const T* const s = blocks[places.shape];
      const double a = (point.x() - shape.middle_m.x()) / shape.half_size_m.x();
      const double b = (point.y() - shape.middle_m.y()) / shape.half_size_m.y();
      const double over_a = 1 - a * a;
      const double over_b = 1 - b * b;
      const T height = s[2] * over_a + s[3] * over_b + s[4] * (a * b) + s[5] * (a * over_a) + s[6] * (b * over_a) +
                       s[7] * (a * over_b) + s[8] * (b * over_b);
      actual = {s[0] * point.x(), s[1] * point.y(), height + point.z()};
    }
    const Eigen::Matrix<T, 3, 1> in_camera = camera_from_target.rotation * actual + camera_from_target.translation;
    const Eigen::Matrix<T, 2, 1> projected = Project<T>(is_fisheye, blocks[places.camera], in_camera);
    residual[0] = weight * (projected.x() - pixel.x());
    residual[1] = weight * (projected.y() - pixel.y());
    return true;
  }

  Eigen::Index EffectSize(const LoopFactor& factor) const { return effect_sizes[static_cast<size_t>(factor.index)]; }
  std::vector<Eigen::Index> effect_sizes;
};

// W times the tangent of a nuisance pose at the identity.
struct OwnPosePrior {
  Rigid3d reference;
  Matrix6 root;

  template <class T>
  bool operator()(const T* block, T* residual) const {
    const Pose<T> pose = Constant<T>(reference) * FromTangent<T>(Eigen::Map<const Eigen::Matrix<T, 6, 1>>(block));
    Eigen::Matrix<T, 6, 1> tangent;
    tangent.template head<3>() = pose.translation;
    ceres::RotationMatrixToAngleAxis(pose.rotation.data(), tangent.data() + 3);
    Eigen::Map<Eigen::Matrix<T, 6, 1>>(residual, 6) = root.cast<T>() * tangent;
    return true;
  }
};

// Residuals weight * (x - mean).
ceres::CostFunction* DiagonalPrior(const Eigen::VectorXd& weights, const Eigen::VectorXd& mean) {
  return new ceres::NormalPrior(Eigen::MatrixXd(weights.asDiagonal()), mean);
}

// The problem for Ceres, with one block for each unknown pose, effect, camera and shape.
class Textbook {
 public:
  Textbook(const LoopProblem& problem, const TextbookValues& values, const TextbookOptions& options)
      : problem_(problem), values_(values) {
    for (size_t i = 0; i < values.shared.poses.size(); ++i) poses_.emplace_back(6, 0.0);
    for (const Eigen::VectorXd& effects : values.shared.effects) effects_.emplace_back(effects.begin(), effects.end());
    cameras_ = values.shared.cameras;
    for (const TargetShape& shape : values.shared.targets) {
      shapes_.emplace_back(shape.params.begin(), shape.params.end());
    }
    for (const std::vector<Rigid3d>& own : values.nuisance_poses) {
      own_.emplace_back(own.size(), std::vector<double>(6, 0.0));
    }
    const std::vector<UnknownBlock> target_blocks = problem.layout.BlocksOf(UnknownOwner::kTarget);
    std::vector<Eigen::Index> effect_sizes;
    for (const std::vector<double>& effects : effects_) {
      effect_sizes.push_back(static_cast<Eigen::Index>(effects.size()));
    }
    for (size_t i = 0; i < problem.captures.size(); ++i) {
      for (const LoopView& view : problem.captures[i].views) {
        const auto camera = static_cast<size_t>(view.camera);
        const auto target = static_cast<size_t>(view.target);
        const bool has_shape = target_blocks[target].size > 0;
        for (int k = 0; k < view.observations->size(); ++k) {
          std::vector<double*> blocks;
          std::vector<int> sizes;
          const auto place_of = [&](std::vector<double>* block) {
            for (size_t b = 0; b < blocks.size(); ++b) {
              if (blocks[b] == block->data()) return static_cast<int>(b);
            }
            blocks.push_back(block->data());
            sizes.push_back(static_cast<int>(block->size()));
            return static_cast<int>(blocks.size()) - 1;
          };
          BlockPlaces places;
          for (const LoopFactor& factor : view.loop.Factors()) {
            const auto index = static_cast<size_t>(factor.index);
            places.references.emplace_back();
            switch (factor.kind) {
              case LoopFactor::Kind::kKnown:
                places.of_factor.push_back(-1);
                break;
              case LoopFactor::Kind::kShared:
                places.of_factor.push_back(place_of(&poses_[index]));
                places.references.back() = values.shared.poses[index];
                break;
              case LoopFactor::Kind::kEffect:
                places.of_factor.push_back(place_of(&effects_[index]));
                break;
              case LoopFactor::Kind::kOwn:
                places.of_factor.push_back(place_of(&own_[i][index]));
                places.references.back() = values.nuisance_poses[i][index];
                break;
            }
          }
          places.camera = place_of(&cameras_[camera]);
          if (has_shape) places.shape = place_of(&shapes_[target]);
          auto* const residual = new ceres::DynamicAutoDiffCostFunction<PointResidual, 4>(new PointResidual{
              view.loop.Factors(), places, values.shared.targets[target], view.observations->points_in_target.col(k),
              view.observations->pixels.col(k), 1 / options.pixel_sigma_px,
              problem.cameras[camera]->name() == "kannala_brandt4", effect_sizes});
          for (const int size : sizes) residual->AddParameterBlock(size);
          residual->SetNumResiduals(2);
          ceres_.AddResidualBlock(residual, nullptr, blocks);
        }
      }
      for (size_t j = 0; j < problem.captures[i].nuisance_poses.size(); ++j) {
        const NuisancePose& own = problem.captures[i].nuisance_poses[j];
        if (!own.prior) continue;
        ceres_.AddResidualBlock(new ceres::AutoDiffCostFunction<OwnPosePrior, 6, 6>(
                                    new OwnPosePrior{values.nuisance_poses[i][j], problem.priors[*own.prior]}),
                                nullptr, own_[i][j].data());
      }
    }
    for (size_t e = 0; e < effects_.size(); ++e) {
      if (e >= options.effect_sigmas.size() || !options.effect_sigmas[e]) continue;
      const Eigen::Index size = effect_sizes[e];
      ceres_.AddResidualBlock(
          DiagonalPrior(Eigen::VectorXd::Constant(size, 1 / *options.effect_sigmas[e]), Eigen::VectorXd::Zero(size)),
          nullptr, effects_[e].data());
    }
    if (!options.camera_prior.empty()) {
      const auto vector = [](const std::vector<double>& numbers) {
        return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<long>(numbers.size())));
      };
      ceres_.AddResidualBlock(DiagonalPrior(vector(options.camera_prior_weights), vector(options.camera_prior)),
                              nullptr, cameras_[0].data());
    }
    HoldFixedParameters();
  }

  // The blocks of the layout, in its order.
  std::vector<std::vector<double>*> Blocks() {
    std::vector<std::vector<double>*> blocks;
    size_t index[4] = {};
    for (const UnknownBlock& block : problem_.layout.blocks()) {
      std::vector<std::vector<double>>* const all[] = {&poses_, &effects_, &cameras_, &shapes_};
      const auto owner = static_cast<size_t>(block.owner);
      std::vector<double>* const found = &(*all[owner])[index[owner]++];
      if (block.size > 0) blocks.push_back(found);
    }
    return blocks;
  }

  TextbookEvaluation Evaluate(bool with_covariance) {
    std::vector<double*> blocks;
    Eigen::Index num_shared = 0;
    for (std::vector<double>* block : Blocks()) {
      blocks.push_back(block->data());
      num_shared += ceres_.ParameterBlockTangentSize(block->data());
    }
    const std::vector<double*> shared = blocks;
    for (auto& own : own_) {
      for (auto& pose : own) blocks.push_back(pose.data());
    }
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = blocks;
    double half = 0;
    std::vector<double> gradient;
    CHECK(ceres_.Evaluate(options, &half, nullptr, &gradient, nullptr));
    TextbookEvaluation result;
    result.cost = 2 * half;
    const Eigen::Map<const Eigen::VectorXd> all(gradient.data(), static_cast<Eigen::Index>(gradient.size()));
    result.gradient = all.head(num_shared);
    result.own_gradient = all.tail(all.size() - num_shared);
    if (!with_covariance) return result;
    ceres::Covariance::Options covariance_options;
    covariance_options.algorithm_type = ceres::DENSE_SVD;
    covariance_options.min_reciprocal_condition_number = 1e-20;
    ceres::Covariance covariance(covariance_options);
    const std::vector<const double*> wanted(shared.begin(), shared.end());
    CHECK(covariance.Compute(wanted, &ceres_));
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> matrix(num_shared, num_shared);
    CHECK(covariance.GetCovarianceMatrixInTangentSpace(wanted, matrix.data()));
    result.covariance = matrix;
    return result;
  }

  TextbookValues Solve() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-16;
    options.gradient_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    bool has_own = false;
    // The poses of a capture depend on each other: Ceres eliminates the first of them.
    for (auto& own : own_) {
      if (own.empty()) continue;
      ordering->AddElementToGroup(own.front().data(), 0);
      has_own = true;
    }
    std::vector<double*> all;
    ceres_.GetParameterBlocks(&all);
    for (double* const block : all) {
      if (!ordering->IsMember(block)) ordering->AddElementToGroup(block, 1);
    }
    if (has_own) {
      options.linear_solver_ordering = ordering;
    } else {
      options.linear_solver_type = ceres::DENSE_QR;
    }
    ceres::Solver::Summary summary;
    ceres::Solve(options, &ceres_, &summary);
    CHECK(summary.IsSolutionUsable()) << summary.FullReport();
    TextbookValues solved = values_;
    const auto moved = [](const Rigid3d& pose, const std::vector<double>& tangent) {
      return Retract(pose, Eigen::Map<const Tangent6>(tangent.data()));
    };
    for (size_t i = 0; i < poses_.size(); ++i) solved.shared.poses[i] = moved(values_.shared.poses[i], poses_[i]);
    for (size_t e = 0; e < effects_.size(); ++e) {
      solved.shared.effects[e] =
          Eigen::Map<const Eigen::VectorXd>(effects_[e].data(), static_cast<Eigen::Index>(effects_[e].size()));
    }
    solved.shared.cameras = cameras_;
    for (size_t t = 0; t < shapes_.size(); ++t) {
      std::copy(shapes_[t].begin(), shapes_[t].end(), solved.shared.targets[t].params.begin());
    }
    for (size_t i = 0; i < own_.size(); ++i) {
      for (size_t j = 0; j < own_[i].size(); ++j) {
        solved.nuisance_poses[i][j] = moved(values_.nuisance_poses[i][j], own_[i][j]);
      }
    }
    return solved;
  }

 private:
  void HoldFixedParameters() {
    size_t camera = 0;
    size_t target = 0;
    for (const UnknownBlock& block : problem_.layout.blocks()) {
      if (block.owner != UnknownOwner::kCamera && block.owner != UnknownOwner::kTarget) continue;
      std::vector<double>& params = block.owner == UnknownOwner::kCamera ? cameras_[camera++] : shapes_[target++];
      if (!ceres_.HasParameterBlock(params.data())) continue;
      std::vector<int> held;
      for (int i = 0; i < static_cast<int>(params.size()); ++i) {
        bool is_free = false;
        for (Eigen::Index k = block.first; k < block.end(); ++k) is_free = is_free || problem_.layout[k].index == i;
        if (!is_free) held.push_back(i);
      }
      if (held.size() == params.size()) {
        ceres_.SetParameterBlockConstant(params.data());
      } else if (!held.empty()) {
        ceres_.SetManifold(params.data(), new ceres::SubsetManifold(static_cast<int>(params.size()), held));
      }
    }
  }

  const LoopProblem& problem_;
  const TextbookValues& values_;
  std::vector<std::vector<double>> poses_;
  std::vector<std::vector<double>> effects_;
  std::vector<std::vector<double>> cameras_;
  std::vector<std::vector<double>> shapes_;
  std::vector<std::vector<std::vector<double>>> own_;
  ceres::Problem ceres_;
};

}  // namespace

TextbookEvaluation EvaluateTextbook(const LoopProblem& problem, const TextbookValues& values,
                                    const TextbookOptions& options, bool with_covariance) {
  return Textbook(problem, values, options).Evaluate(with_covariance);
}

TextbookValues SolveTextbook(const LoopProblem& problem, const TextbookValues& start, const TextbookOptions& options) {
  return Textbook(problem, start, options).Solve();
}

}  // namespace heba
