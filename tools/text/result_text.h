// Texts and figures for tables and messages about results.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"

namespace heba {

// Returns each reason once, with the names that have it, separated by commas. `named`: each name and its reason, such
// as a method and why it has no result.
using NamedReason = std::pair<std::string, std::string>;
std::vector<std::pair<std::string, std::string>> GroupedByReason(const std::vector<NamedReason>& named);
// Groups the methods of a result that have no estimate. A method for a motion that was not made is left out unless it
// is one of `asked_for`.
std::vector<std::pair<std::string, std::string>> MethodsWithoutResult(const RunResult& result,
                                                                      const std::vector<std::string>& asked_for = {});

// Returns how many images of a camera were used, and how many there are.
std::pair<int, int> CountImages(const RunResult& result, const std::string& camera);
// Returns the largest sigma of a pose along and about its axes: m and rad.
std::pair<double, double> LargestSigmas(const Eigen::Matrix<double, 6, 6>& covariance);

// Returns "errors that no arm has: ...", with the parameters, for an arm that is estimated with such errors
// (ImplausibleErrors); empty for others.
std::string ImplausibleArmText(const RobotSummary& robot);

// Formats a pose as "[x, y, z] mm, quaternion xyzw [...]" with w not negative. The sigmas of position and rotation
// determine the number of decimals.
std::string PoseText(const Rigid3d& pose, double sigma_mm = 0.01, double sigma_rad = 1e-5);
// Formats a figure with three significant digits, or "-".
std::string FigureText(const std::optional<double>& value);

// Formats a figure for a column of `width`, which begins with a space. The number of digits is reduced until it fits.
std::string FigureCell(const std::optional<double>& value, int digits, size_t width);

enum class Colour { kPlain, kAnsi };
// Returns the grade, then the findings that keep it from being good, each with its action.
std::string VerdictLines(const Verdict& verdict, Colour colour);

// Describes the noise of a robot's poses: "0.3 mm and 0.02 deg", and that of the joints and the smooth errors if they
// are modelled.
std::string RobotNoiseText(const RobotNoise& noise, const std::optional<RobotNoise>& smooth_noise);

// Returns the error message of a run that --fail-on fails.
std::string VerdictFailure(const Verdict& verdict);

// Quotes a field of a CSV file by RFC 4180. A text that a spreadsheet would read as a formula gets a leading
// apostrophe.
std::string CsvField(const std::string& text);

}  // namespace heba
