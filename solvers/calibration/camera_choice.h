// Chooses the camera model that the lens needs, from the captures alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/pair_calibration_types.h"

namespace heba {

struct CameraChoice {
  Camera camera;
  std::vector<CameraAlternative> alternatives;  // Ordered as they were tried.
  // The estimated cameras of all models that could be estimated, in the same order: each polynomial model contains
  // those before it.
  std::vector<Camera> candidates = {};
};

// How much better the larger one of two camera models explains the captures.
struct LensComparison {
  double gain = 0;    // Difference of the log-likelihoods.
  double p = 1;       // Probability of so large a gain by chance.
  double sigmas = 0;  // Vuong's statistic: the gain corrected for the number of parameters, in sigmas over captures.

  // Returns whether the captures reject the smaller model: by the chi-square test at 1 %, and by one sigma with the
  // captures as independent samples (Vuong 1989), because errors within a capture are not independent.
  bool RejectsSmaller() const;
};

// Compares two camera models by the log-likelihoods that each capture gains with the larger one, which has `num_more`
// parameters more. `dof`: degrees of freedom of the noise by which the likelihoods are computed.
LensComparison CompareLenses(const std::vector<double>& gain_of_capture, double num_more, double dof);

// Returns why `camera` is not taken beside a larger model that could be estimated, whatever the captures say: it has no
// distortion. Captures that cannot tell it from a larger model would lend the result a certainty that comes from the
// choice alone. The text is empty for every other model (CameraAlternative::reason).
Failure WhyNotBesideLarger(const Camera& camera);

// Returns the number of parameters by which two models are compared, at least 1.
double NumMoreParams(const Camera& smaller, const Camera& larger);

// Returns the models to which one steps down if the captures do not determine it, each with fewer parameters than the
// one before.
std::vector<std::string> SmallerCameraModels(const std::string& model);

// Estimates pinhole, brown4, brown5 and rational8 (EstimateIntrinsics) and chooses the smallest model that the
// residuals do not reject (LensComparison), pinhole only if no other one can be estimated. The target counts as flat
// and as designed, and every view has its own pose: the choice is a start for that of ChooseModel
// (solvers/calibration/model_choice.h). If points lie more than 50 deg off the axis, or if no polynomial model could be
// estimated, kannala_brandt4 is tried too and chosen if it is more likely. Returns a Failure if no model could be
// estimated.
Outcome<CameraChoice> ChooseCameraModel(const std::vector<View>& views, int width_px, int height_px);

}  // namespace heba
