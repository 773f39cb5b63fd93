// The first page of a report, which serves as a record by itself: what was calibrated, from what, how good it is, the
// result in the forms that people copy, and what to do next.
#pragma once

#include <filesystem>
#include <string>

#include "heba/evaluation/evaluation.h"

namespace heba {

// The facts about the run that a report has beside its result.
struct ReportContext {
  std::string made;              // When, as text.
  std::filesystem::path config;  // The file of the run's config.
  std::string config_used;       // With every default, as YAML.
  std::filesystem::path output;  // The run's folder.
};

// The time now in UTC, to the minute; SOURCE_DATE_EPOCH in the environment counts more.
std::string TimeNow();

// Markup. A result without a refined estimate has the pose of its last one.
std::string RecordSection(const RunResult& result, const ReportContext& context);

}  // namespace heba
