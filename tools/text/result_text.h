// What tables of several runs say of each.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/evaluation/evaluation.h"

namespace heba {

// One sigma of the hand-eye pose as a whole (root of the sum over the axes); nothing without a covariance.
std::optional<double> TranslationSigmaMm(const Estimate& estimate);
std::optional<double> RotationSigmaDeg(const Estimate& estimate);

// Each reason once, with the methods that give it and commas between them. `methods`: a method and its reason.
using MethodReason = std::pair<std::string, std::string>;
std::vector<std::pair<std::string, std::string>> GroupedByReason(const std::vector<MethodReason>& methods);
// The same of the methods that have no estimate.
std::vector<std::pair<std::string, std::string>> MethodsWithoutResult(const RunResult& result);

int NumUsedCaptures(const RunResult& result);

// "[x, y, z] mm, quaternion xyzw [...]", w not negative; to a micrometre, or with the digits that the largest sigmas
// of place and turn deserve.
std::string PoseText(const Rigid3d& pose, double sigma_mm = 0.01, double sigma_rad = 1e-5);
// The same with the sigmas of an estimate's hand-eye pose.
std::string HandEyePoseText(const Estimate& estimate);
// Three digits, or "-".
std::string FigureText(const std::optional<double>& value);

// Why --fail-on fails a run, as an error line says it.
std::string VerdictFailure(const Verdict& verdict);

// As RFC 4180 has it.
std::string CsvField(const std::string& text);

}  // namespace heba
