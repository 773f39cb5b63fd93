// Grades findings and orders them, for the verdicts on a single camera and on a rig.
#pragma once

#include <vector>

#include "heba/evaluation/finding.h"

namespace heba {

// Returns the grade of the errors of targets on captures that the estimate has not seen.
Grade GradeOfHeldOut(double share_of_distance, double deg);
// Returns the grade of errors that the noise does not explain. They make a result bad only if they matter at the
// target.
Grade GradeOfMisfit(double chi2_per_dof, Grade of_hold_out);

// Returns whether a finding is what errors of the model show as. It contains the others as parts, if it says most.
bool IsMisfit(const Finding& finding);

// Makes the symptoms that are no worse than a cause parts of it: its consequences. Without such a cause, the symptoms
// become parts of the one that says most: one fault is one finding.
void GatherSymptoms(std::vector<Finding>* findings);

// Sorts findings: the worst first; among equal grades, causes first.
void SortFindings(std::vector<Finding>* findings);

}  // namespace heba
