// Proposes a target for a paper, a camera and a distance.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/camera/camera.h"
#include "targets/render/papers.h"

namespace heba {

struct SuggestionOptions {
  std::string type = "coded_board";  // One of SuggestedTypes().
  Paper paper;
  double distance_m = 0;  // From the camera to the target's middle.
  Camera camera;
  // Returns the violated constraints, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// The position and rotation of the target as one image determines them, in the worst direction; one sigma.
struct PoseSigma {
  double position_m = 0;
  double rotation_rad = 0;
};

struct Suggestion {
  std::string config;                                    // The target's YAML, one key a line.
  Eigen::Vector2d drawing_mm = Eigen::Vector2d::Zero();  // Width and height of the target with its border.
  Eigen::Vector2d page_mm = Eigen::Vector2d::Zero();     // The paper, as it lies.
  std::string feature;                                   // The smallest part that must be resolved, such as "a dot".
  double feature_px = 0;
  double height_share = 0;  // The share of the image's height that the target covers.
  double width_share = 0;   // The share of its width.
  size_t num_points = 0;
  double information = 0;  // On the target's pose, to compare suggestions of one type.
  // Results in a rendered image of the target, with its middle on the optical axis at the distance.
  size_t num_found = 0;
  PoseSigma sigma;
};

// The rendered image in which a suggestion is tried.
inline constexpr double kTrialTiltDeg = 30;
inline constexpr double kTrialBlurPx = 0.7;
inline constexpr double kTrialNoiseGrey = 2;

// Returns the types of targets for which there are suggestions: those of targets.def.
std::vector<std::string> SuggestedTypes();

// Returns the target of this type with the most information on its pose that has at most kMaxSuggestedPoints points and
// - has one page of the paper, and a main length (the spacing, the side of a tag or of a square) that is a multiple of
//   5 mm;
// - takes at most half of the image's height and 0.6 of its width at the distance;
// - has parts that are detected even at 1.25 times the distance;
// - has no symmetry;
// - is found in a rendered image at the distance, at least 0.95 of its points. Of each main length only the three
//   patterns with the most information are rendered.
// Returns a Failure if none of those is found, or if there is none.
Outcome<Suggestion> SuggestTarget(const SuggestionOptions& options);
inline constexpr size_t kMaxSuggestedPoints = 160;

}  // namespace heba
