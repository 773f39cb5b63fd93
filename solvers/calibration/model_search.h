// The search for the model of a problem: its lenses, the shapes of its targets, and the errors of its arms. A model is
// fitted, or it fails and has lost; the simplest that the captures do not reject is taken (model_choice.h), and the
// images that contradict the others are found under it.
#pragma once

#include <optional>
#include <vector>

#include "heba/rig_calibration.h"
#include "solvers/calibration/model_choice.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// A problem with the parts of its model that were chosen so far, and its adjustment.
struct SearchedModel {
  RigProblem problem;
  RigOptions options;
  JudgedRig judged;
  ProblemModel model;                            // The last choice; empty before the first.
  std::vector<ProblemAlternative> alternatives;  // The models that were compared in it.
};

// Chooses the parts of `space`, and adjusts with them. Returns the Failure if that fails, which changes nothing.
std::optional<Failure> ChooseParts(const ModelSpace& space, const Judge& judge, SearchedModel* model);

// Makes the errors of the arms part of a model if the captures require them or if they are wanted without a choice
// (RigArmErrors); otherwise the model stays as it is.
//
// The configuration of an arm is that of the largest restricted likelihood with the largest model. The models of all
// arms are then chosen together.
//
// Returns one entry for each arm that has models to choose from.
std::vector<RigArmChoice> AddArmErrors(const std::vector<RigArmErrors>& arms, const Judge& judge, SearchedModel* model);

// Makes errors that vary smoothly with the poses of the arms part of a model if they are asked for or if the captures
// require them (kRandomErrorsRejected), for arms of which no errors are estimated. Returns those that were added.
std::vector<RigSmoothErrors> AddSmoothErrors(SmoothPoseErrors smooth, const Judge& judge, SearchedModel* model);

}  // namespace heba
