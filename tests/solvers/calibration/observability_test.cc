#include "solvers/calibration/observability.h"

#include <cmath>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "heba/calibration.h"
#include "solvers/cell/outliers.h"
#include "solvers/refine/fit.h"
#include "solvers/residuals/inliers.h"
#include "tests/support/cell_scenes.h"

namespace heba {
namespace {

Calibration Calibrated(const CellScene& scene) {
  CalibrationOptions options;
  options.has_camera.assign(scene.problem.cameras.size(), true);
  options.choose_target_shape = false;
  options.smooth = SmoothPoseErrors::kNone;
  Outcome<Calibration> calibration = Calibrate(scene.problem, options);
  CHECK(calibration.ok()) << calibration.reason();
  CHECK(calibration->refined.ok()) << calibration->refined.reason();
  return *calibration;
}

// A poor arm, so that sigmas exceed what a robot cell usually needs.
CellSceneSetting PoorArm() { return {30, 0.2, {2e-3, DegToRad(0.4), 0}}; }

const Finding* PartOf(const Finding& finding, const std::string& code) {
  for (const Finding& part : finding.parts) {
    if (part.code == code) return &part;
  }
  return nullptr;
}

// The covariance of the captures in use together with more captures, from all their linearised images.
Eigen::MatrixXd CovarianceWith(const Problem& used, const Solution& solution, const CandidateCaptures& candidate) {
  Fit fit;
  Problem problem = WeightedAs(solution, used);
  fit.state = StateOf(solution);
  for (const ProblemCapture& capture : candidate.captures) {
    problem.captures.push_back(capture);
    fit.state.corrections.emplace_back(problem.robots.size());
  }
  fit.groups = GroupByRobotPoses(problem);
  fit.noise = NoiseOf(solution);
  fit.problem = std::make_shared<const Problem>(std::move(problem));
  return InvertInformation(*FitInformation(fit, LossOf(LossKind::kNone), 1), 1.0).matrix;
}

TEST(Observability, NamesTheWeakDirectionsOfEachCamera) {
  const CellScene scene = MixedCell(31, PoorArm());
  const Calibration calibration = Calibrated(scene);
  const Solution& solution = *calibration.refined;
  const std::vector<Finding> findings = DiagnoseWeakDirectionsOf(calibration);
  ASSERT_EQ(findings.size(), 3U);
  int num_weak = 0;
  for (size_t c = 0; c < findings.size(); ++c) {
    EXPECT_EQ(findings[c].code, "weak_direction");
    EXPECT_EQ(findings[c].Name("of_camera"), scene.problem.cameras[c].name);
    const Finding* const worst = PartOf(findings[c], "weak_direction_of");
    ASSERT_NE(worst, nullptr);
    num_weak += findings[c].grade == Grade::kDoubtful ? 1 : 0;
    // No unit vector in the camera's pose is less certain than the direction that is named.
    const UnknownBlock block = solution.covariance.layout.Block(CameraPoseBlock(scene.problem.cameras[c]));
    const std::vector<WeakDirection> directions = DirectionsOfCamera(calibration.problem, solution, c);
    for (const WeakDirection& direction : directions) {
      const bool is_position = direction.name.find("position along") != std::string::npos;
      const bool is_orientation = direction.name.find("orientation about") != std::string::npos;
      if (!is_position && !is_orientation) continue;
      const Eigen::Matrix3d part = solution.covariance.matrix.block<3, 3>(block.first + (is_position ? 0 : 3),
                                                                          block.first + (is_position ? 0 : 3));
      EXPECT_NEAR(direction.sigma, std::sqrt(part.operatorNorm()), 1e-9 * direction.sigma);
    }
    EXPECT_NEAR(*worst->Number("sigma"), directions.front().sigma / directions.front().unit_size, 1e-9);
  }
  EXPECT_GT(num_weak, 0);
}

TEST(Observability, ACertainCellHasNoWeakDirection) {
  for (const Finding& finding : DiagnoseWeakDirectionsOf(Calibrated(FourCameraCell(32)))) {
    EXPECT_EQ(finding.grade, Grade::kGood);
    EXPECT_NE(PartOf(finding, "weak_direction_of"), nullptr);
  }
}

// The sigma that a suggestion states is that of the whole adjustment with these captures, for all of the rig's cameras.
TEST(Observability, StatesTheSigmaOfTheLargerAdjustment) {
  for (const CellScene& scene : {MixedCell(33, PoorArm()), TwoArmCell(34, PoorArm())}) {
    const Calibration calibration = Calibrated(scene);
    const Solution& solution = *calibration.refined;
    const Problem used = WithoutRejected(calibration.problem, solution);
    std::vector<WeakDirection> directions;
    for (size_t c = 0; c < used.cameras.size(); ++c) {
      directions.push_back(DirectionsOfCamera(used, solution, c).front());
    }
    const std::vector<CandidateCaptures> candidates = FindCandidates(used, solution);
    ASSERT_GE(candidates.size(), 6U);
    double most_help = 0;
    for (size_t k = 0; k < candidates.size(); k += 5) {
      const std::optional<std::vector<double>> sigmas = SigmasWith(used, solution, candidates[k], directions);
      ASSERT_TRUE(sigmas.has_value());
      const Eigen::MatrixXd covariance = CovarianceWith(used, solution, candidates[k]);
      for (size_t c = 0; c < directions.size(); ++c) {
        const Eigen::VectorXd& direction = directions[c].direction;
        EXPECT_NEAR((*sigmas)[c], std::sqrt(direction.dot(covariance * direction)), 1e-3 * directions[c].sigma);
        // Captures that a camera has no part in may tell nothing about it.
        EXPECT_LE((*sigmas)[c], (1 + 1e-12) * directions[c].sigma);
        most_help = std::max(most_help, 1 - (*sigmas)[c] / directions[c].sigma);
      }
    }
    EXPECT_GT(most_help, 0.02);
  }
}

// The best candidate for a camera is suggested, with what the cameras see there.
TEST(Observability, SuggestsTheCapturesThatHelpACameraMost) {
  const CellScene scene = MixedCell(33, PoorArm());
  const Calibration calibration = Calibrated(scene);
  const Solution& solution = *calibration.refined;
  const Problem used = WithoutRejected(calibration.problem, solution);
  const std::vector<CandidateCaptures> candidates = FindCandidates(used, solution);
  int num_suggested = 0;
  const std::vector<Finding> findings = DiagnoseWeakDirectionsOf(calibration);
  for (size_t c = 0; c < findings.size(); ++c) {
    const Finding* const suggested = PartOf(findings[c], "suggested_captures");
    if (suggested == nullptr) continue;
    ++num_suggested;
    const WeakDirection worst = DirectionsOfCamera(used, solution, c).front();
    double least = worst.sigma;
    for (const CandidateCaptures& candidate : candidates) {
      least = std::min(least, SigmasWith(used, solution, candidate, {worst})->front());
    }
    EXPECT_NEAR(*suggested->Number("sigma"), least / worst.unit_size, 1e-9);
    EXPECT_NEAR(*suggested->Number("helps_percent"), 100 * (1 - least / worst.sigma), 1e-6);
    EXPECT_LT(least, kHelps * worst.sigma);
    EXPECT_NE(suggested->Name("seen")->find(*suggested->Name("view_of_camera") + " sees "), std::string::npos);
  }
  EXPECT_GT(num_suggested, 0);
}

// In a candidate, the cameras see what they would see at these poses of the arms, inside their images.
TEST(Observability, CandidatesHaveTheImagesOfAllCameras) {
  const CellScene scene = FourCameraCell(36, PoorArm());
  const Calibration calibration = Calibrated(scene);
  const Solution& solution = *calibration.refined;
  const Problem used = WithoutRejected(calibration.problem, solution);
  std::set<size_t> most_cameras;
  for (const CandidateCaptures& candidate : FindCandidates(used, solution)) {
    EXPECT_EQ(candidate.captures.size(), 2U);
    for (size_t side = 0; side < candidate.captures.size(); ++side) {
      const ProblemCapture& capture = candidate.captures[side];
      std::set<size_t> cameras;
      for (const ProblemImage& image : capture.images) {
        cameras.insert(image.camera);
        const Camera& camera = solution.cameras[image.camera];
        EXPECT_EQ(image.observations.size(), 48);
        EXPECT_GE(image.observations.pixels.minCoeff(), 0);
        EXPECT_LE(image.observations.pixels.row(0).maxCoeff(), camera.width_px);
        EXPECT_LE(image.observations.pixels.row(1).maxCoeff(), camera.height_px);
        const Rigid3d pose =
            CameraFromTarget(used, solution.poses, image.camera, image.target, capture.base_from_gripper);
        if (image.camera == candidate.camera && image.target == candidate.target) {
          EXPECT_LT(DistanceM(pose, candidate.motion.camera_from_target[side]), 1e-9);
          EXPECT_LT(AngleRad(pose, candidate.motion.camera_from_target[side]), 1e-7);
        }
      }
      EXPECT_TRUE(cameras.contains(candidate.camera));
      if (cameras.size() > most_cameras.size()) most_cameras = cameras;
    }
  }
  EXPECT_EQ(most_cameras.size(), 4U);
}

}  // namespace
}  // namespace heba
