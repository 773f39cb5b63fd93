// Tests whether a finished calibration still holds for images that were taken later: whether a camera, a target, the
// base of an arm or a lens has changed since. Equation (16) of docs/estimation.md.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/data/problem.h"
#include "heba/data/smooth_errors.h"
#include "heba/data/solution.h"

namespace heba {

// Errors of an arm that vary smoothly with its pose.
struct SmoothPrior {
  RobotNoise sigma;
  SmoothLengths lengths;
};

struct SessionOptions {
  // Whether the targets are mounted as they were for the calibration. Otherwise their poses are estimated from the
  // images, and nothing is said of them.
  bool is_target_in_place = true;
  // One sigma of what the mounts on grippers move by themselves between two sessions, along and about each axis.
  RobotNoise wobble = {0, DegToRad(0.03), 0};
  // One for each arm: its smooth errors, which are unknown at the poses of the session; an empty list: there are none.
  std::vector<std::optional<SmoothPrior>> smooth = {};
};

// A part is what may have changed. The base of the first arm is the world, in which the others stand. An exchanged
// camera has another pose and another lens; an exchanged target has the same points at other scales along x and y, and
// another pose.
enum class ChangedPart { kCamera, kTarget, kBase, kLens, kExchangedCamera, kExchangedTarget };
// Returns whether a change is one of a pose alone.
inline bool IsMoved(ChangedPart part) { return part < ChangedPart::kLens; }

struct SessionChange {
  ChangedPart part = ChangedPart::kCamera;
  size_t index = 0;  // The index is that of the camera, of the target or of the arm.
  // The estimated change if nothing else has changed, and its covariance: of a pose its tangent (m, rad, in its own
  // frame), of a lens its intrinsics, of an exchanged part what comes after its pose: intrinsics, or scales.
  Eigen::VectorXd change;
  Eigen::MatrixXd covariance;
  // The probability of images that ask for a change of this part at least as much if nothing has changed.
  double p_value = 1;
  // The translation of a pose without a rotation, and its rotation without a translation, that are seen with a
  // probability of 95 %, over random directions; of changes of a pose alone.
  std::optional<double> seen_m = {};
  std::optional<double> seen_rad = {};
  double rank = 0;  // Akaike's criterion of this change alone, up to a constant: the least is the most likely.
};

struct SessionCheck {
  // The most likely first; without the parts about which the images say nothing, and without lenses and exchanged parts
  // that have not changed beyond doubt.
  std::vector<SessionChange> changes;
  // The probability of images that ask for a change of any pose at least as much if nothing has changed, or that of a
  // changed lens or of an exchanged part.
  double p_value = 1;
  bool has_changed = false;  // Whether it is below 5 %, or a lens has changed or a part was exchanged.
  // The ratio of the scatter of the points about the best pose of the target in each image to the noise of the
  // calibration, and the probability of one at least as large. A wrong lens or target raises it.
  double scatter_ratio = 1;
  double scatter_p_value = 1;
  // The same of all residuals after the most likely change: images that belong to other poses raise it.
  double unexplained_ratio = 1;
  double unexplained_p_value = 1;
  // The capture without which the others, at least three, agree with the calibration, where all together have changed
  // at 1e-4: a wrong pose or a wrong image, or the only one that was taken after a change.
  std::optional<size_t> contradicting = {};
  int num_images = 0;
};

// Returns whether the points do not fit the target: they scatter more than twice as far as in the calibration, beyond
// doubt.
inline bool IsMisfit(const SessionCheck& check) { return check.scatter_p_value < 1e-6 && check.scatter_ratio > 2; }

// Tests the images in the captures of `problem`, whose parts are those of the calibration; `solution` is its estimate
// with covariance_repeatable, because a session has the scales of the calibration. An image is predicted up to the
// uncertainty of the calibration, the noise of the arms (white and smooth, or that of arms whose errors are estimated),
// the wobble of what grippers carry, and the noise of the pixels; a change d of a part adds J d. Each part is tested by
// the generalised least-squares estimate of its change, d^T C^-1 d, in Fisher's F; the largest of all parts is judged
// by its distribution without any change. The draws that it needs have a fixed seed. Targets that were moved are placed
// by the images first; a change that is found is fitted by Gauss-Newton steps of its part alone, because it may be
// large.
//
// Returns a Failure `no_target` if no image has points, `hidden_point` if one cannot be projected, and
// `no_part_told` if the images say nothing about any part, as one image does with a target that was moved.
Outcome<SessionCheck> CheckSession(const Problem& problem, const Solution& solution, const SessionOptions& options);

}  // namespace heba
