// The results of the closed forms within a calibration.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/pair_calibration_types.h"

namespace heba {

// Runs every closed form on the pairs of a calibration, because each may be needed as a seed. The reprojection RMS is
// that of its views. `known`: results that are already available.
std::vector<MethodResult> RunMethods(const PairCalibration& calibration,
                                     const std::vector<std::optional<Outcome<HandEye>>>& known = {});

// Returns the result of a method; null if it is not among them.
const MethodResult* FindResult(const std::vector<MethodResult>& results, const std::string& name);

// Returns the results of these methods, or all if no names are given. A method that does not suit the motion is among
// them, with the reason of its failure.
std::vector<MethodResult> Reported(const std::vector<MethodResult>& results, const std::vector<std::string>& names);

}  // namespace heba
