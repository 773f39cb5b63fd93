// The first page of a report, which serves as a stand-alone record: the setup and its data, the quality of the
// calibration, the result in the formats that users copy, and the recommended next steps.
#pragma once

#include <filesystem>
#include <string>

#include "heba/camera/camera.h"
#include "heba/data/unknowns.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

// The facts about a run that a report shows in addition to its result.
struct ReportContext {
  std::string made;              // Date and time as text.
  std::filesystem::path config;  // Config file of the run.
  std::string config_used;       // Config as YAML, including every default.
  std::filesystem::path output;  // Output folder of the run.
};

// Returns the current time in UTC, to the minute. SOURCE_DATE_EPOCH in the environment takes precedence.
std::string TimeNow();

// Returns the markup of a verdict: the causes, then their symptoms, then the findings that are good, each finding once.
std::string VerdictPart(const Verdict& verdict);

// Returns the table of a camera's intrinsics: each parameter with its sigma, by the block of the covariance that is
// called `block`, or "held" if the block does not have it, and with its error if the true camera is known. `truth` may
// be null.
std::string IntrinsicsTable(const std::string& title, const Camera& camera, const Covariance& covariance,
                            const std::string& block, const Camera* truth = nullptr);

// Returns markup. If the result has no refined estimate, the pose of the last successful estimate is shown.
std::string RecordSection(const RunResult& result, const ReportContext& context);

}  // namespace heba
