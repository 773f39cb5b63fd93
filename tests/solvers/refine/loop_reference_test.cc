// The fast cost, its gradient, its solution and the covariance agree with those of a textbook's adjustment, for random
// problems of every kind of loop.
#include <cmath>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/rng.h"
#include "heba/data/prediction.h"
#include "heba/geometry/pose_block.h"
#include "solvers/refine/captures_cost.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/robot_noise.h"
#include "solvers/uncertainty/variance_components.h"
#include "tests/support/scenes.h"
#include "tests/support/textbook_loops.h"

namespace heba {
namespace {

constexpr double kPixelPx = 0.3;
constexpr RobotNoise kRobot = {5e-4, 1e-3};
constexpr double kEffectSigma = 2e-3;

Rigid3d RandomPose(Rng& rng, double most_m, double most_rad) {
  Tangent6 tangent;
  tangent << most_m * rng.NormalVector3(), most_rad * rng.NormalVector3();
  return Retract(Rigid3d(), tangent);
}

// A pose of a target about 0.6 m in front of a camera, tilted and turned.
Rigid3d RandomViewpoint(Rng& rng) {
  const Eigen::Vector3d tilt = 0.35 * rng.NormalVector3();
  const Eigen::Quaterniond facing(Eigen::AngleAxisd(EIGEN_PI, Eigen::Vector3d::UnitX()));
  Eigen::Vector3d place = 0.05 * rng.NormalVector3();
  place.z() += 0.6;
  return {ExpRotation(tilt) * facing, place};
}

// A random problem with its true values.
struct RandomProblem {
  LoopProblem loops;
  TextbookValues truth;
  TextbookOptions textbook;
  std::deque<Observations> observations;  // Does not move its elements.
};

// Describes one kind of problem.
struct Kind {
  std::string name;
  int num_poses = 2;
  int num_effects = 0;
  std::vector<std::string> lenses = {"brown5"};
  int num_targets = 1;
  bool has_free_shape = false;
  bool has_free_camera = true;
  int num_own_poses = 0;
  bool own_poses_have_priors = true;
  bool has_camera_prior = false;
  // Returns the loops of a capture's images, given the first camera_from_target. `poses` are the true shared poses,
  // `errors` the true nuisance poses of the capture.
  struct Image {
    std::vector<LoopFactor> factors;
    int camera = 0;
    int target = 0;
  };
  std::function<std::vector<Image>(const std::vector<Rigid3d>& poses, const std::vector<Rigid3d>& errors,
                                   const std::vector<Eigen::VectorXd>& effects, const Rigid3d& camera_from_target,
                                   Rng& rng)>
      images;
};

// Returns M such that left * M * right is camera_from_target.
Rigid3d Between(const Rigid3d& left, const Rigid3d& camera_from_target, const Rigid3d& right) {
  return Inverse(left) * camera_from_target * Inverse(right);
}

Observations ObservationsOf(int num_points) {
  Observations observations;
  observations.points_in_target = GridPoints(num_points / 4, 4, 0.03);
  // A board that is not flat makes every shape parameter matter.
  for (int i = 0; i < num_points; ++i) {
    observations.points_in_target(2, i) = 0.004 * (i % 3);
    observations.ids.push_back(i);
  }
  observations.pixels.resize(2, num_points);
  return observations;
}

RandomProblem MakeProblem(const Kind& kind, uint64_t seed) {
  Rng rng(seed);
  RandomProblem random;
  LoopProblem& loops = random.loops;
  LoopValues& shared = random.truth.shared;
  for (int k = 0; k < kind.num_poses; ++k) {
    loops.layout.AddPose("pose_" + std::to_string(k));
    shared.poses.push_back(RandomPose(rng, 0.3, 0.8));
  }
  if (kind.num_effects > 0) {
    std::vector<std::string> names;
    for (int e = 0; e < kind.num_effects; ++e) names.push_back(std::to_string(e));
    loops.layout.AddEffects("effects", names);
    shared.effects.emplace_back(kind.num_effects);
    for (double& effect : shared.effects.back()) effect = kEffectSigma * rng.Normal();
    random.textbook.effect_sigmas = {kEffectSigma};
  }
  for (size_t c = 0; c < kind.lenses.size(); ++c) {
    const Camera camera = TestCamera(kind.lenses[c]);
    FreeParameters free(camera.params.size(), kind.has_free_camera);
    if (c > 0) free[3] = false;  // One parameter of the second camera is held.
    loops.layout.AddCamera("camera_" + std::to_string(c), camera.Model(), free);
    loops.cameras.push_back(&camera.Model());
    shared.cameras.push_back(camera.params);
  }
  const TargetShape designed = DesignedShape(ObservationsOf(32).points_in_target);
  for (int t = 0; t < kind.num_targets; ++t) {
    FreeParameters free;
    if (kind.has_free_shape) free = {true, t == 0, true, true, true, t == 0, true, true, t == 0};
    loops.layout.AddTarget("target_" + std::to_string(t), free);
    loops.targets.push_back(designed);
    shared.targets.push_back(designed);
    if (kind.has_free_shape)
      shared.targets.back().params = {1.001, t == 0 ? 0.999 : 1.0, 5e-4, -3e-4, 2e-4, t == 0 ? 1e-4 : 0.0, -1e-4,
                                      2e-4,  t == 0 ? -2e-4 : 0.0};
  }
  loops.priors = {CorrectionPrior(kRobot)};
  random.textbook.pixel_sigma_px = kPixelPx;
  if (kind.has_camera_prior) {
    random.textbook.camera_prior = shared.cameras.front();
    for (size_t i = 0; i < shared.cameras.front().size(); ++i) {
      random.textbook.camera_prior[i] += i < 4 ? 2.0 : 1e-3;
      random.textbook.camera_prior_weights.push_back(i < 4 ? 1 / 3.0 : 1 / 2e-3);
    }
  }
  constexpr int kNumCaptures = 22;
  for (int i = 0; i < kNumCaptures; ++i) {
    const Rigid3d camera_from_target = RandomViewpoint(rng);
    std::vector<Rigid3d> errors;
    for (int j = 0; j < kind.num_own_poses; ++j) {
      Tangent6 error;
      error << kRobot.translation_m * rng.NormalVector3(), kRobot.rotation_rad * rng.NormalVector3();
      errors.push_back(kind.own_poses_have_priors ? Retract(Rigid3d(), error) : camera_from_target);
    }
    LoopCapture& capture = loops.captures.emplace_back();
    for (const Rigid3d& error : errors) {
      capture.nuisance_poses.push_back(
          {error, kind.own_poses_have_priors ? std::optional<size_t>(0) : std::optional<size_t>()});
    }
    for (const Kind::Image& image : kind.images(shared.poses, errors, shared.effects, camera_from_target, rng)) {
      Observations observations = ObservationsOf(i % 3 == 0 ? 12 : 32);
      const KinematicLoop loop(image.factors);
      const Rigid3d actual = loop.Evaluate({shared.poses, shared.effects, errors}, nullptr);
      const auto target = static_cast<size_t>(image.target);
      const Observations shaped = kind.has_free_shape ? ApplyShape(observations, shared.targets[target]) : observations;
      const auto camera = static_cast<size_t>(image.camera);
      for (Eigen::Index k = 0; k < observations.pixels.cols(); ++k) {
        Points2 pixel;
        const Points3 point = actual * Eigen::Vector3d(shaped.points_in_target.col(k));
        CHECK(loops.cameras[camera]->Project(shared.cameras[camera].data(), point, &pixel, nullptr));
        observations.pixels.col(k) = pixel.col(0) + kPixelPx * Eigen::Vector2d{rng.Normal(), rng.Normal()};
      }
      random.observations.push_back(std::move(observations));
      capture.views.push_back({&random.observations.back(), loop, image.camera, image.target});
    }
    random.truth.nuisance_poses.push_back(errors);
  }
  return random;
}

// Returns shared values that differ from the truth by small errors.
LoopValues Disturbed(const LoopProblem& loops, LoopValues values, uint64_t seed) {
  Rng rng(seed);
  for (Rigid3d& pose : values.poses) pose = pose * RandomPose(rng, 1e-3, 1e-3);
  for (Eigen::VectorXd& effects : values.effects) {
    for (double& effect : effects) effect += 1e-3 * rng.Normal();
  }
  size_t camera = 0;
  for (const UnknownBlock& block : loops.layout.BlocksOf(UnknownOwner::kCamera)) {
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const bool is_linear = loops.layout[i].index < 4;
      values.cameras[camera][static_cast<size_t>(loops.layout[i].index)] += (is_linear ? 1.0 : 1e-3) * rng.Normal();
    }
    ++camera;
  }
  return values;
}

Kind::Image Image(std::vector<LoopFactor> factors, int camera = 0, int target = 0) {
  return {std::move(factors), camera, target};
}

std::vector<Kind> Kinds() {
  using Poses = const std::vector<Rigid3d>&;
  using Effects = const std::vector<Eigen::VectorXd>&;
  std::vector<Kind> kinds;
  const auto exact = [](Poses p, Poses /*e*/, Effects /*t*/, const Rigid3d& seen, Rng& /*rng*/) {
    const Rigid3d measured = Between(Inverse(p[0]), seen, p[1]);
    return std::vector<Kind::Image>{Image({Inverse(SharedFactor(0)), KnownFactor(measured), SharedFactor(1)})};
  };
  kinds.push_back({.name = "exact_robot", .images = exact});
  kinds.push_back({.name = "known_camera", .has_free_camera = false, .images = exact});
  kinds.push_back({.name = "fisheye", .lenses = {"kannala_brandt4"}, .images = exact});
  kinds.push_back({.name = "target_shape", .has_free_shape = true, .has_free_camera = false, .images = exact});
  kinds.push_back({.name = "camera_prior", .has_camera_prior = true, .images = exact});
  kinds.push_back(
      {.name = "eye_to_hand", .num_own_poses = 1, .images = [](Poses p, Poses e, Effects, const Rigid3d& seen, Rng&) {
         const Rigid3d measured = Between(Inverse(p[0]), seen, e[0] * p[1]);
         return std::vector<Kind::Image>{
             Image({Inverse(SharedFactor(0)), KnownFactor(measured), OwnFactor(0), SharedFactor(1)})};
       }});
  kinds.push_back({.name = "eye_in_hand",
                   .has_free_shape = true,
                   .has_free_camera = false,
                   .num_own_poses = 1,
                   .images = [](Poses p, Poses e, Effects, const Rigid3d& seen, Rng&) {
                     const Rigid3d base_from_gripper = Inverse(Between(Inverse(p[0]) * Inverse(e[0]), seen, p[1]));
                     return std::vector<Kind::Image>{Image({Inverse(SharedFactor(0)), Inverse(OwnFactor(0)),
                                                            Inverse(KnownFactor(base_from_gripper)), SharedFactor(1)})};
                   }});
  kinds.push_back({.name = "intrinsics_only",
                   .num_poses = 0,
                   .num_own_poses = 1,
                   .own_poses_have_priors = false,
                   .images = [](Poses, Poses, Effects, const Rigid3d&, Rng&) {
                     return std::vector<Kind::Image>{Image({OwnFactor(0)})};
                   }});
  kinds.push_back(
      {.name = "repeated_pose",
       .num_own_poses = 1,
       .images = [](Poses p, Poses e, Effects, const Rigid3d& seen, Rng& rng) {
         // The robot reports slightly different poses for the three images.
         std::vector<Kind::Image> images;
         for (int v = 0; v < 3; ++v) {
           const Rigid3d measured = Between(Inverse(p[0]), seen, e[0] * p[1]) * RandomPose(rng, 2e-5, 2e-5);
           images.push_back(Image({Inverse(SharedFactor(0)), KnownFactor(measured), OwnFactor(0), SharedFactor(1)}));
         }
         return images;
       }});
  kinds.push_back({.name = "two_cameras",
                   .num_poses = 3,
                   .lenses = {"brown5", "kannala_brandt4"},
                   .num_own_poses = 1,
                   .images = [](Poses p, Poses e, Effects, const Rigid3d& seen, Rng& rng) {
                     const Rigid3d measured = Between(Inverse(p[0]), seen, e[0] * p[1]);
                     std::vector<Kind::Image> images = {
                         Image({Inverse(SharedFactor(0)), KnownFactor(measured), OwnFactor(0), SharedFactor(1)})};
                     // The second camera is placed relative to the first one, and does not see every capture.
                     const std::vector<LoopFactor> factors = {Inverse(SharedFactor(2)), Inverse(SharedFactor(0)),
                                                              KnownFactor(measured), OwnFactor(0), SharedFactor(1)};
                     if (rng.Uniform(0, 1) < 0.8) images.push_back(Image(factors, 1));
                     return images;
                   }});
  kinds.push_back(
      {.name = "two_targets",
       .num_poses = 3,
       .num_targets = 2,
       .has_free_shape = true,
       .has_free_camera = false,
       .num_own_poses = 1,
       .images = [](Poses p, Poses e, Effects, const Rigid3d& seen, Rng& rng) {
         const int target = rng.Uniform(0, 1) < 0.5 ? 0 : 1;
         const Rigid3d measured = Between(Inverse(p[0]), seen, e[0] * p[static_cast<size_t>(1 + target)]);
         return std::vector<Kind::Image>{Image(
             {Inverse(SharedFactor(0)), KnownFactor(measured), OwnFactor(0), SharedFactor(1 + target)}, 0, target)};
       }});
  kinds.push_back({.name = "two_arms",
                   .num_poses = 3,
                   .num_own_poses = 2,
                   .images = [](Poses p, Poses e, Effects, const Rigid3d& seen, Rng& rng) {
                     // The camera is on the first arm, the target on the second: p[1] is the pose of its base.
                     const Rigid3d first = RandomPose(rng, 0.3, 0.8);
                     const Rigid3d left = Inverse(p[0]) * Inverse(e[0]) * Inverse(first) * p[1];
                     const Rigid3d second = Between(left, seen, e[1] * p[2]);
                     return std::vector<Kind::Image>{
                         Image({Inverse(SharedFactor(0)), Inverse(OwnFactor(0)), Inverse(KnownFactor(first)),
                                SharedFactor(1), KnownFactor(second), OwnFactor(1), SharedFactor(2)})};
                   }});
  const auto with_effects = [](bool has_corrections) {
    return [has_corrections](Poses p, Poses e, Effects t, const Rigid3d& seen, Rng& rng) {
      Matrix6X g(6, t[0].size());
      for (Eigen::Index k = 0; k < g.cols(); ++k) g.col(k) << 0.4 * rng.NormalVector3(), rng.NormalVector3();
      const std::shared_ptr<const PoseEffect> effect = MakeLinearEffect(g);
      const Rigid3d shift = effect->Evaluate(t[0], nullptr);
      const Rigid3d right = has_corrections ? shift * e[0] * p[1] : shift * p[1];
      std::vector<LoopFactor> factors = {Inverse(SharedFactor(0)), KnownFactor(Between(Inverse(p[0]), seen, right)),
                                         EffectFactor(0, effect)};
      if (has_corrections) factors.push_back(OwnFactor(0));
      factors.push_back(SharedFactor(1));
      return std::vector<Kind::Image>{Image(factors)};
    };
  };
  kinds.push_back(
      {.name = "shared_effects", .num_effects = 3, .has_free_camera = false, .images = with_effects(false)});
  kinds.push_back(
      {.name = "shared_effects_and_corrections", .num_effects = 5, .num_own_poses = 1, .images = with_effects(true)});
  return kinds;
}

class LoopReferenceTest : public testing::TestWithParam<Kind> {};

CapturesCostOptions CostOptions() {
  CapturesCostOptions options;
  options.pixel_sigma_px = kPixelPx;
  options.loss = &LossOf(LossKind::kNone);
  return options;
}

// Returns the priors of the shared unknowns as information and pull: J^T J and J^T r.
std::pair<Eigen::MatrixXd, Eigen::VectorXd> PriorsOf(const RandomProblem& random, const LoopValues& at) {
  const UnknownLayout& layout = random.loops.layout;
  Eigen::VectorXd information = Eigen::VectorXd::Zero(layout.size());
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(layout.size());
  for (const UnknownBlock& block : layout.blocks()) {
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const auto k = static_cast<size_t>(layout[i].index);
      if (block.owner == UnknownOwner::kEffects) {
        information[i] = 1 / (kEffectSigma * kEffectSigma);
        pull[i] = information[i] * at.effects[0][layout[i].index];
      }
      if (block.owner == UnknownOwner::kCamera && !random.textbook.camera_prior.empty()) {
        information[i] = std::pow(random.textbook.camera_prior_weights[k], 2);
        pull[i] = information[i] * (at.cameras[0][k] - random.textbook.camera_prior[k]);
      }
    }
  }
  return {information.asDiagonal(), pull};
}

// Returns the difference of the unknowns in the order of the layout.
Eigen::VectorXd DifferenceOf(const LoopProblem& loops, const LoopValues& a, const LoopValues& b) {
  Eigen::VectorXd difference(loops.layout.size());
  size_t index[4] = {};
  for (const UnknownBlock& block : loops.layout.blocks()) {
    const size_t at = index[static_cast<size_t>(block.owner)]++;
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const auto k = static_cast<size_t>(loops.layout[i].index);
      switch (block.owner) {
        case UnknownOwner::kPose:
          difference[i] = LocalCoordinates(b.poses[at], a.poses[at])[loops.layout[i].index];
          break;
        case UnknownOwner::kEffects:
          difference[i] = a.effects[at][loops.layout[i].index] - b.effects[at][loops.layout[i].index];
          break;
        case UnknownOwner::kCamera:
          difference[i] = a.cameras[at][k] - b.cameras[at][k];
          break;
        case UnknownOwner::kTarget:
          difference[i] = a.targets[at].params[k] - b.targets[at].params[k];
          break;
      }
    }
  }
  return difference;
}

double PriorCost(const RandomProblem& random, const LoopValues& at) {
  double sum = 0;
  if (!at.effects.empty()) sum += at.effects[0].squaredNorm() / (kEffectSigma * kEffectSigma);
  for (size_t i = 0; i < random.textbook.camera_prior.size(); ++i) {
    sum += std::pow(random.textbook.camera_prior_weights[i] * (at.cameras[0][i] - random.textbook.camera_prior[i]), 2);
  }
  return sum;
}

// Returns |a - b|, in units of the size of each coordinate.
double LargestDifference(const Eigen::VectorXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& sizes) {
  return (a - b).cwiseAbs().cwiseQuotient(sizes).maxCoeff();
}

TEST_P(LoopReferenceTest, CostAndGradientAgree) {
  const RandomProblem random = MakeProblem(GetParam(), 1);
  const LoopValues at = Disturbed(random.loops, random.truth.shared, 2);
  const CapturesCost cost(random.loops, CostOptions());
  LoopUnknowns unknowns(random.loops.layout, at);
  // The Jacobians are evaluated as Ceres does, so that the eliminated poses are known; they are then fully settled.
  std::vector<double> residuals(static_cast<size_t>(cost.num_residuals()));
  std::vector<std::vector<double>> storage;
  std::vector<double*> jacobians;
  for (const int size : cost.parameter_block_sizes()) {
    storage.emplace_back(static_cast<size_t>(size) * residuals.size());
  }
  for (std::vector<double>& block : storage) jacobians.push_back(block.data());
  for (int i = 0; i < 12; ++i) {
    ASSERT_TRUE(cost.Evaluate(unknowns.blocks().data(), residuals.data(), jacobians.data()));
    if (random.loops.captures.front().nuisance_poses.empty()) break;
    // The smallest move, and back, makes the eliminated poses follow their linearisation.
    double& first = unknowns.blocks().front()[0];
    first = std::nextafter(first, i % 2 == 0 ? 1e9 : -1e9);
  }
  TextbookValues values{at, cost.EliminatedPoses()};
  if (values.nuisance_poses.empty()) values.nuisance_poses.resize(random.loops.captures.size());
  const TextbookEvaluation expected = EvaluateTextbook(random.loops, values, random.textbook, false);
  const Eigen::MatrixXd& matrix = cost.Accepted().matrix;
  const Eigen::Index n = random.loops.layout.size();
  EXPECT_NEAR(matrix(n, n) + PriorCost(random, at), expected.cost, 1e-9 * expected.cost);
  const Eigen::VectorXd sizes = matrix.diagonal().head(n).cwiseSqrt() * std::sqrt(expected.cost);
  const Eigen::VectorXd gradient = matrix.col(n).head(n) + PriorsOf(random, at).second;
  EXPECT_LT(LargestDifference(gradient, expected.gradient, sizes), 1e-8);
  if (expected.own_gradient.size() > 0) {
    // The eliminated poses are at the minimum of their captures.
    EXPECT_LT(expected.own_gradient.norm(), 1e-6 * expected.gradient.norm());
  }
}

TEST_P(LoopReferenceTest, SolutionAndCovarianceAgree) {
  const RandomProblem random = MakeProblem(GetParam(), 3);
  LoopProblem loops = random.loops;
  TextbookValues start{Disturbed(loops, random.truth.shared, 4), random.truth.nuisance_poses};
  const bool has_priors = GetParam().own_poses_have_priors;
  for (size_t i = 0; i < loops.captures.size(); ++i) {
    for (size_t j = 0; j < loops.captures[i].nuisance_poses.size(); ++j) {
      if (has_priors) start.nuisance_poses[i][j] = Rigid3d();
      loops.captures[i].nuisance_poses[j].pose = start.nuisance_poses[i][j];
    }
  }
  const TextbookValues expected = SolveTextbook(loops, start, random.textbook);

  LoopUnknowns unknowns(loops.layout, start.shared);
  std::vector<BlockPrior> priors;
  if (GetParam().num_effects > 0) {
    const Eigen::Index size = GetParam().num_effects;
    priors.push_back(
        {UnknownOwner::kEffects, Eigen::VectorXd::Constant(size, 1 / kEffectSigma), Eigen::VectorXd::Zero(size)});
  }
  if (GetParam().has_camera_prior) {
    const auto size = static_cast<Eigen::Index>(random.textbook.camera_prior.size());
    priors.push_back({UnknownOwner::kCamera,
                      Eigen::Map<const Eigen::VectorXd>(random.textbook.camera_prior_weights.data(), size),
                      Eigen::Map<const Eigen::VectorXd>(random.textbook.camera_prior.data(), size)});
  }
  CapturesCostOptions options = CostOptions();
  options.priors = priors;
  CapturesCost cost(loops, options);
  const ceres::Solver::Summary summary = SolveCaptures(ReprojectionSolverOptions(100), &cost, &unknowns);
  ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
  const LoopValues found = unknowns.Values();
  TextbookValues at{found, cost.EliminatedPoses()};
  if (at.nuisance_poses.empty()) at.nuisance_poses.resize(loops.captures.size());

  const TextbookEvaluation there = EvaluateTextbook(loops, expected, random.textbook, true);
  const Eigen::VectorXd sigmas = there.covariance.diagonal().cwiseSqrt();
  // The distance of the two minima in sigmas.
  const Eigen::VectorXd gradient_here = EvaluateTextbook(loops, at, random.textbook, false).gradient;
  EXPECT_LT((there.covariance * gradient_here).cwiseQuotient(sigmas).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_LT(DifferenceOf(loops, found, expected.shared).cwiseQuotient(sigmas).cwiseAbs().maxCoeff(), 2e-3);

  // The covariance by elimination, and by marginalisation of the linearised captures.
  const Eigen::Index n = loops.layout.size();
  const Eigen::MatrixXd prior_information = PriorsOf(random, found).first;
  const auto difference_of = [&](const Eigen::MatrixXd& information) {
    const Eigen::VectorXd scale = sigmas;
    const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
    const Eigen::MatrixXd correlation = InverseOfSymmetric(scaled);
    const Eigen::MatrixXd expected_correlation =
        sigmas.cwiseInverse().asDiagonal() * there.covariance * sigmas.cwiseInverse().asDiagonal();
    return (correlation - expected_correlation).cwiseAbs().maxCoeff();
  };
  EXPECT_LT(difference_of(cost.Accepted().matrix.topLeftCorner(n, n)), 1e-3);
  if (!has_priors) return;
  for (size_t i = 0; i < loops.captures.size(); ++i) {
    for (size_t j = 0; j < loops.captures[i].nuisance_poses.size(); ++j) {
      loops.captures[i].nuisance_poses[j].pose = at.nuisance_poses[i][j];
    }
  }
  const std::optional<std::vector<LinearisedView>> views =
      LineariseCaptures(loops, found, kPixelPx, LossOf(LossKind::kNone));
  ASSERT_TRUE(views.has_value());
  Eigen::VectorXd variances(6 * GetParam().num_own_poses);
  for (int j = 0; j < GetParam().num_own_poses; ++j) variances.segment<6>(6 * j) = CorrectionVariances(kRobot);
  EXPECT_LT(difference_of(MarginalInformation(*views, variances, 1.0) + prior_information), 1e-3);
}

INSTANTIATE_TEST_SUITE_P(, LoopReferenceTest, testing::ValuesIn(Kinds()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace heba
