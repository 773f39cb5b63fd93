// The search for the model of a problem: its lenses, the shapes of its targets, and the errors of its arms. A model is
// fitted, or it fails and has lost; the simplest that the captures do not reject is taken (model_choice.h), and the
// images that contradict the others are judged under it, until both stand.
#pragma once

#include <optional>
#include <vector>

#include "heba/robot_errors.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// A problem with the parts of its model that were chosen so far, and its adjustment.
struct SearchedModel {
  Problem problem;  // Its cameras have their initial intrinsics.
  AdjustmentOptions options;
  JudgedProblem judged;
  bool is_fitted = true;  // Whether the adjustment is that of the problem with these options; otherwise it is a start.
  ProblemModel model = {};                                  // The last choice; empty before the first.
  std::vector<ProblemAlternative> alternatives = {};        // The models that were compared in it.
  std::vector<std::vector<CameraAlternative>> lenses = {};  // ProblemChoice::lenses of it.
};

// Chooses the parts of `space`, adjusts with them and judges the images, and chooses again if that leaves out others.
// Returns the Failure if no model can be fitted.
Outcome<SearchedModel> WithChosenParts(const SearchedModel& model, const ModelSpace& space, const Judge& judge);

// Chooses the twists of these targets (ModelSpace::twists) with all else as it is: the images are not judged again. A
// twist resembles errors of an arm, and images that show either must not be left out for the other. It also resembles
// what a lens leaves over, which the likelihood takes for a shape because many points of each image share it; the true
// shape brings images and arms together, so that a twist by which the noise of the arms' poses grows is not taken.
// Returns the model as it is if no such model can be fitted.
SearchedModel WithChosenTwists(const SearchedModel& model, const std::vector<bool>& twists);

// The errors of the arms that are searched for after the parts were chosen.
struct ErrorSpace {
  // The parts that are chosen again with the errors of arms; it names none. Beside smooth errors all parts stay.
  ModelSpace parts;
  std::vector<ArmErrorModels> arms;  // One for each arm, or an empty list.
  SmoothPoseErrors smooth = SmoothPoseErrors::kNone;
  // Whether smooth errors are left out unless the captures reject the model without them (kRandomErrorsRejected);
  // otherwise they are part of the model unless the captures speak against them (AreLikely).
  bool must_be_shown = false;
  double robot_scale_sigma = kRobotScaleSigma;  // CalibrationOptions::robot_scale_sigma.
};

// A model with errors of arms, and how they were chosen: one entry for each arm that has models to choose from, or the
// joints of whose captures are known.
struct ModelWithArmErrors {
  SearchedModel model;
  std::vector<ArmErrorChoice> arms;
};

// A model with smooth errors, and what was added.
struct ModelWithSmoothErrors {
  SearchedModel model;
  std::vector<AddedSmoothErrors> added;
};

// Returns the noise of an arm's poses, that of its joints included (WithJointNoise); nothing if the arm has none.
std::optional<RobotNoise> NoiseOfPoses(const Problem& problem, const Solution& solution, size_t robot);

// Returns a model with the errors of the arms if the captures require them or if they are wanted without a choice
// (ArmErrorModels); the model as it is if there are none.
//
// The configuration of an arm is that of the largest restricted likelihood with the largest model. The models of all
// arms are then chosen together, and with them the other parts.
ModelWithArmErrors WithArmErrors(const SearchedModel& model, const ErrorSpace& space, const Judge& judge);

// Returns a model with errors that vary smoothly with the pose of the arms of which no others are estimated; the model
// as it is if there are none, or if joints have noise.
//
// The lens and the shapes of the targets stay as they were chosen: smooth errors resemble what a target of another
// shape leaves, so that the captures do not tell which is true, and a scale that is free has a prior, while one that is
// held may be wrong.
ModelWithSmoothErrors WithSmoothErrors(const SearchedModel& model, const ErrorSpace& space, const Judge& judge);

}  // namespace heba
