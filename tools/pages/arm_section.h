// The section of the report on the estimated kinematics of the arm.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/rig_evaluation.h"
#include "tools/pages/reported_capture.h"

namespace heba {

// Returns the markup of the section: the estimated parameters, and maps of the correction and of its uncertainty; empty
// if the run has not estimated the errors of an arm.
std::string ArmSection(const RunResult& result, const Estimate& refined, const std::vector<ReportedCapture>& captures);

// Returns the markup of the section on an arm of a rig whose kinematics are known: the estimated parameters, the noise
// without and with them, and maps of the correction; or the reason why they were not estimated.
std::string ArmOfRigSection(const std::string& heading, const RigResult& result, size_t robot_index);

}  // namespace heba
