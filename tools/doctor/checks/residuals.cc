// Checks the camera model by the residuals of single views, each under its own best pose, independently of the robot.
#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/evaluation/metrics.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"

namespace heba {
namespace {

struct ViewResiduals {
  Points2 pixels;
  Points2 residuals;  // Predicted minus observed, px.
};

std::vector<ViewResiduals> ResidualsOf(const Camera& camera, const std::vector<ExaminedView>& views) {
  std::vector<ViewResiduals> all;
  for (const ExaminedView& view : views) {
    // The pose alone explains nearly all residuals of fewer points.
    constexpr int kMinPoints = 8;
    const Observations& observations = view.view.observations;
    if (observations.size() < kMinPoints) continue;
    const std::optional<Points2> residuals = Residuals(camera, view.camera_from_target.front(), observations);
    if (residuals) all.push_back({observations.pixels, *residuals});
  }
  return all;
}

// Returns the sigma of one coordinate over all views, with six degrees of freedom per view deducted for its pose.
double SigmaPx(const std::vector<ViewResiduals>& views) {
  double sum = 0;
  double dof = 0;
  for (const ViewResiduals& view : views) {
    sum += view.residuals.squaredNorm();
    dof += 2.0 * static_cast<double>(view.residuals.cols()) - 6;
  }
  return std::sqrt(sum / dof);
}

// Reports residuals that have the same direction in the same part of the image in many views: they are due to the
// lens.
std::vector<Symptom> LensStructure(const Camera& camera, const std::vector<ViewResiduals>& views, double sigma_px) {
  constexpr int kColumns = 6;
  constexpr int kRows = 4;
  Eigen::Matrix<double, 2, Eigen::Dynamic> sums = Eigen::MatrixXd::Zero(2, kColumns * kRows);
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(kColumns * kRows);
  for (const ViewResiduals& view : views) {
    for (Eigen::Index i = 0; i < view.pixels.cols(); ++i) {
      const int column = std::clamp(static_cast<int>(kColumns * view.pixels(0, i) / camera.width_px), 0, kColumns - 1);
      const int row = std::clamp(static_cast<int>(kRows * view.pixels(1, i) / camera.height_px), 0, kRows - 1);
      sums.col(row * kColumns + column) += view.residuals.col(i);
      counts[row * kColumns + column] += 1;
    }
  }
  double chi2 = 0;
  double sum_px2 = 0;
  int num_cells = 0;
  for (Eigen::Index cell = 0; cell < counts.size(); ++cell) {
    constexpr double kMinPoints = 5;
    if (counts[cell] < kMinPoints) continue;
    const Eigen::Vector2d mean = sums.col(cell) / counts[cell];
    chi2 += counts[cell] * mean.squaredNorm() / (sigma_px * sigma_px);
    sum_px2 += mean.squaredNorm();
    ++num_cells;
  }
  constexpr int kMinCells = 6;
  if (num_cells < kMinCells) return {};
  const double mean_px = std::sqrt(sum_px2 / num_cells);
  constexpr double kBeyondChance = 5;
  constexpr double kMattersPx = 0.1;
  if (chi2 < kBeyondChance * 2 * num_cells || mean_px < kMattersPx) return {};
  return {{Severity::kRemark, "lens",
           "the residuals of single views have a pattern over the image (" + Significant(mean_px, 2) +
               " px rms of the means over its parts): the camera model, " + camera.model +
               ", or its distortion does not fit the lens",
           "free or estimate the distortion, or try another camera.model (brown5, rational8, kannala_brandt4)"}};
}

}  // namespace

Checked Check_residuals(const Examination& examination) {
  if (examination.found_wrong || !examination.camera) return {};
  const Camera& camera = *examination.camera;
  const std::vector<ViewResiduals> views = ResidualsOf(camera, examination.views);
  if (views.empty()) return {};
  const double sigma_px = SigmaPx(views);
  if (!(sigma_px > 0)) return {};
  return {LensStructure(camera, views, sigma_px)};
}

}  // namespace heba
