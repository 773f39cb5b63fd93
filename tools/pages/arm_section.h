// The sections of the report on the estimated kinematics of the arms.
#pragma once

#include <string>

#include "heba/evaluation/evaluation.h"
#include "tools/pages/report_data.h"

namespace heba {

// Returns the markup of a section for each arm whose errors were estimated: the parameters, the noise without and with
// them, and maps of the correction and of its uncertainty.
std::string ArmSections(const ReportData& data);

// States in a sentence that the kinematics of an arm were estimated, or the reason why not.
std::string EstimateText(const RobotSummary& robot);

}  // namespace heba
