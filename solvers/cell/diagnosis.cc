#include "solvers/cell/diagnosis.h"

#include <algorithm>
#include <limits>
#include <set>

#include "solvers/calibration/observability.h"
#include "solvers/cell/start.h"
#include "solvers/residuals/inliers.h"

namespace heba {
namespace {

// Fewer images cannot tell a fault of the camera from wrong images.
constexpr int kFewest = 6;

// Returns the number of captures that contradict the others, left out or not.
int NumContradicting(const CalibratedPair& pair) {
  return static_cast<int>(pair.calibration->unused.size()) + pair.calibration->num_kept_against_test;
}

bool IsCalibrated(const CalibratedPair& pair) { return pair.calibration && pair.calibration->refined; }

// Returns the least pixel noise that a pair was found to have; infinity if none was calibrated.
double LeastNoisePx(const std::vector<CalibratedPair>& pairs) {
  double least_px = std::numeric_limits<double>::infinity();
  for (const CalibratedPair& pair : pairs) {
    if (IsCalibrated(pair)) least_px = std::min(least_px, pair.calibration->refined->pixel_sigma_px);
  }
  return least_px;
}

// Returns whether a pair fits far worse than the best one: if no capture agrees with another, none contradicts them.
bool IsFarWorse(const CalibratedPair& pair, double least_noise_px) {
  constexpr double kFar = 10;
  return !IsCalibrated(pair) || pair.calibration->refined->pixel_sigma_px > kFar * least_noise_px;
}

bool IsSuspicious(const CalibratedPair& pair, double least_noise_px) {
  constexpr double kManyUnused = 0.25;
  if (!pair.robot || pair.num_images < kFewest) return false;
  return IsFarWorse(pair, least_noise_px) || NumContradicting(pair) > kManyUnused * pair.num_images;
}

// Returns whether the residuals of a pair are clearly smaller than those of the same pair among `others`: without
// limits of what a result may be, poses of other captures have one too.
bool FitsBetter(const CalibratedPair& pair, const std::vector<CalibratedPair>& others) {
  constexpr double kClearly = 0.5;
  const auto other = std::find_if(others.begin(), others.end(), [&](const CalibratedPair& candidate) {
    return candidate.camera == pair.camera && candidate.target == pair.target;
  });
  if (other == others.end() || !IsCalibrated(*other)) return true;
  return pair.calibration->refined->pixel_sigma_px < kClearly * other->calibration->refined->pixel_sigma_px;
}

// Returns the problem with the images of one camera only, each moved to the capture `shift` places later.
Problem Shifted(const Problem& problem, size_t camera, int shift) {
  Problem shifted = problem;
  for (ProblemCapture& capture : shifted.captures) capture.images.clear();
  const auto num_captures = static_cast<int>(problem.captures.size());
  for (int i = 0; i < num_captures; ++i) {
    const int to = i + shift;
    if (to < 0 || to >= num_captures) continue;
    for (const ProblemImage& image : problem.captures[static_cast<size_t>(i)].images) {
      if (image.camera == camera) shifted.captures[static_cast<size_t>(to)].images.push_back(image);
    }
  }
  return shifted;
}

}  // namespace

std::optional<ShiftedCamera> FindShiftedCamera(const Problem& problem, const std::vector<CalibratedPair>& pairs,
                                               const CalibrationOptions& options) {
  const double least_noise_px = LeastNoisePx(pairs);
  std::set<size_t> cameras;
  for (const CalibratedPair& pair : pairs) {
    if (IsSuspicious(pair, least_noise_px)) cameras.insert(pair.camera);
  }
  for (const size_t camera : cameras) {
    for (const int shift : {-1, 1, -2, 2}) {
      int num_images = 0;
      int num_unused = 0;
      for (const CalibratedPair& pair : CalibratePairs(Shifted(problem, camera, shift), options)) {
        if (!pair.robot) continue;
        num_images += pair.num_images;
        const bool is_as_good = !IsFarWorse(pair, least_noise_px) && FitsBetter(pair, pairs);
        num_unused += is_as_good ? NumContradicting(pair) : pair.num_images;
      }
      constexpr double kFewUnused = 0.1;
      if (num_images >= kFewest && num_unused <= kFewUnused * num_images) return ShiftedCamera{camera, shift};
    }
  }
  return std::nullopt;
}

std::vector<Finding> DiagnoseWeakDirectionsOf(const Calibration& calibration) {
  CHECK(calibration.refined.ok());
  return DiagnoseDirections(WithoutRejected(calibration.problem, *calibration.refined), *calibration.refined);
}

}  // namespace heba
