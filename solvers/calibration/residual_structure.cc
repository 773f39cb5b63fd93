#include "solvers/calibration/residual_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/data/prediction.h"
#include "heba/data/target_shape.h"
#include "solvers/refine/fit.h"

namespace heba {
namespace {

constexpr int kColumns = 8;
constexpr int kRows = 6;

struct PointSums {
  Eigen::Vector3d designed_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int num = 0;
};

struct RegionSums {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  int num = 0;
};

// Returns the matrix that whitens the residual of one point by itself. Points whose errors are correlated, such as the
// corners of a tag, share a whitening.
Eigen::Matrix2d WhiteningOf(const Observations& observations, Eigen::Index point) {
  if (observations.whitening.empty()) return Eigen::Matrix2d::Identity();
  Eigen::Index first = 0;
  for (const Eigen::MatrixXd& whitening : observations.whitening) {
    const Eigen::Index size = whitening.rows() / 2;
    if (point < first + size) {
      const Eigen::MatrixXd covariance = InverseOfSymmetric(Eigen::MatrixXd(whitening.transpose() * whitening));
      const Eigen::Matrix2d own = covariance.block<2, 2>(2 * (point - first), 2 * (point - first));
      const auto root = Cholesky(own);
      return root ? root->SolveLower(Eigen::Matrix2d(Eigen::Matrix2d::Identity())) : Eigen::Matrix2d::Identity();
    }
    first += size;
  }
  return Eigen::Matrix2d::Identity();
}

using PointsOfTargets = std::map<std::pair<size_t, int>, PointSums>;
using RegionsOfCameras = std::map<std::pair<size_t, int>, RegionSums>;

struct SumsOfResiduals {
  PointsOfTargets points;
  RegionsOfCameras regions;

  void AddImage(const Problem& problem, const Solution& solution, const FitState& state, const ImageIndex& index);
};

void SumsOfResiduals::AddImage(const Problem& problem, const Solution& solution, const FitState& state,
                               const ImageIndex& index) {
  const ProblemImage& image = problem.captures[index.capture].images[index.image];
  const Camera& camera = solution.cameras[image.camera];
  const Observations shaped = ApplyShape(image.observations, solution.shapes[image.target]);
  const Rigid3d camera_from_target = PredictedPose(problem, state, index);
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(camera.Model(), camera.params.data(), camera_from_target, shaped, &pixels, &jacobian)) return;
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  const double sigma_px = solution.pixel_sigmas_px[image.camera];
  for (Eigen::Index i = 0; i < shaped.size(); ++i) {
    const auto at = static_cast<size_t>(i);
    const Eigen::Vector2d residual = image.observations.pixels.col(i) - pixels.col(i);
    Eigen::Matrix<double, 2, 3> by_point;
    by_point << jacobian.u.col(i).head<3>().transpose(), jacobian.v.col(i).head<3>().transpose();
    by_point = (by_point * rotation).eval();
    const Eigen::Matrix2d weight = WhiteningOf(image.observations, i) / sigma_px;
    const Eigen::Matrix<double, 2, 3> weighted = weight * by_point;
    PointSums& of_point = points[{image.target, shaped.ids[at]}];
    of_point.designed_m = image.observations.points_in_target.col(i);
    of_point.normal += weighted.transpose() * weighted;
    of_point.right += weighted.transpose() * (weight * residual);
    ++of_point.num;
    const auto cell = [](double pixel, int size, int cells) {
      return std::clamp(static_cast<int>(std::floor((pixel + 0.5) / size * cells)), 0, cells - 1);
    };
    const Eigen::Vector2d pixel = image.observations.pixels.col(i);
    const int column = cell(pixel.x(), camera.width_px, kColumns);
    const int row = cell(pixel.y(), camera.height_px, kRows);
    RegionSums& of_region = regions[{image.camera, row * kColumns + column}];
    of_region.normal += weight.transpose() * weight;
    of_region.right += weight.transpose() * (weight * residual);
    ++of_region.num;
  }
}

std::vector<PointDeviation> DeviationsOf(const PointsOfTargets& points) {
  constexpr int kFewestImages = 3;
  std::vector<PointDeviation> deviations;
  for (const auto& [key, sums] : points) {
    const auto factor = Cholesky(sums.normal);
    if (sums.num < kFewestImages || !factor) continue;
    PointDeviation& deviation = deviations.emplace_back();
    deviation.target = key.first;
    deviation.id = key.second;
    deviation.designed_m = sums.designed_m;
    deviation.deviation_m = factor->Solve(sums.right);
    deviation.p_value = ChiSquareTail(deviation.deviation_m.dot(sums.right), 3);
  }
  for (PointDeviation& one : deviations) {
    one.p_value = std::min(1.0, one.p_value * static_cast<double>(deviations.size()));
  }
  return deviations;
}

std::vector<RegionDeviation> DeviationsOf(const RegionsOfCameras& regions, const Solution& solution) {
  constexpr int kFewestPoints = 10;
  std::vector<RegionDeviation> deviations;
  for (const auto& [key, sums] : regions) {
    const auto factor = Cholesky(sums.normal);
    if (sums.num < kFewestPoints || !factor) continue;
    const Camera& camera = solution.cameras[key.first];
    RegionDeviation& deviation = deviations.emplace_back();
    deviation.camera = key.first;
    deviation.mean_px = factor->Solve(sums.right);
    const double column = 0.5 + key.second % kColumns;
    const double row = 0.5 + std::floor(key.second / kColumns);
    deviation.middle_px = {column * camera.width_px / kColumns - 0.5, row * camera.height_px / kRows - 0.5};
    deviation.p_value = ChiSquareTail(deviation.mean_px.dot(sums.right), 2);
  }
  for (RegionDeviation& one : deviations) {
    one.p_value = std::min(1.0, one.p_value * static_cast<double>(deviations.size()));
  }
  return deviations;
}

template <class Deviation>
struct DeviationCounts {
  int num_all = 0;
  int num_deviating = 0;
  const Deviation* largest = nullptr;  // The largest one that deviates; null if none does.
};

// Counts the deviations of one target or camera, whose index is the member `owner`.
template <class Deviation, class Mean>
DeviationCounts<Deviation> CountDeviations(const std::vector<Deviation>& all, size_t Deviation::*owner, size_t index,
                                           Mean Deviation::*mean) {
  DeviationCounts<Deviation> counts;
  for (const Deviation& one : all) {
    if (one.*owner != index) continue;
    ++counts.num_all;
    if (one.p_value >= kDeviates) continue;
    ++counts.num_deviating;
    if (counts.largest == nullptr || (one.*mean).norm() > (counts.largest->*mean).norm()) counts.largest = &one;
  }
  return counts;
}

Finding DescribePoints(const Problem& problem, size_t target, const std::vector<PointDeviation>& points) {
  Finding finding{Grade::kGood, FindingCode("target_points")};
  const auto counts = CountDeviations(points, &PointDeviation::target, target, &PointDeviation::deviation_m);
  if (counts.largest == nullptr) return {};
  finding.numbers = {{"deviating", counts.num_deviating},
                     {"points", counts.num_all},
                     {"largest_mm", 1000 * counts.largest->deviation_m.norm()},
                     {"largest_id", counts.largest->id},
                     {"p", counts.largest->p_value}};
  if (!problem.targets[target].name.empty()) finding.names = {{"of_target", problem.targets[target].name}};
  return finding;
}

Finding DescribeRegions(const Problem& problem, size_t camera, const std::vector<RegionDeviation>& regions) {
  Finding finding{Grade::kGood, FindingCode("image_regions")};
  const auto counts = CountDeviations(regions, &RegionDeviation::camera, camera, &RegionDeviation::mean_px);
  if (counts.largest == nullptr) return {};
  finding.numbers = {{"deviating", counts.num_deviating},
                     {"regions", counts.num_all},
                     {"largest_px", counts.largest->mean_px.norm()},
                     {"at_u_px", counts.largest->middle_px.x()},
                     {"at_v_px", counts.largest->middle_px.y()},
                     {"p", counts.largest->p_value}};
  if (!problem.cameras[camera].name.empty()) finding.names = {{"of_camera", problem.cameras[camera].name}};
  return finding;
}

}  // namespace

ResidualStructure FindResidualStructure(const Problem& problem, const Solution& solution) {
  const Problem weighted = WeightedAs(solution, problem);
  const FitState state = StateOf(solution);
  SumsOfResiduals sums;
  for (size_t i = 0; i < weighted.captures.size(); ++i) {
    for (size_t k = 0; k < weighted.captures[i].images.size(); ++k) {
      sums.AddImage(weighted, solution, state, {i, k});
    }
  }
  ResidualStructure structure{DeviationsOf(sums.points), DeviationsOf(sums.regions, solution), {}};
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    Finding finding = DescribePoints(problem, t, structure.points);
    if (!finding.code.empty()) structure.findings.push_back(std::move(finding));
  }
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    Finding finding = DescribeRegions(problem, c, structure.regions);
    if (!finding.code.empty()) structure.findings.push_back(std::move(finding));
  }
  return structure;
}

}  // namespace heba
