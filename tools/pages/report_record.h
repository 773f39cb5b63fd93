// The first page of a report, which serves as a stand-alone record: the setup and its data, the quality of the
// calibration, the result in the formats that users copy, and the recommended next steps.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/unknowns.h"
#include "heba/evaluation/evaluation.h"
#include "tools/pages/page.h"
#include "tools/text/camera_figures.h"

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

// Quotes a text as one word of a shell command.
std::string ShellWord(const std::string& text);
// Returns the actions of the findings and the commands that use the result. `located`: the arguments of heba locate
// after the run; empty if it cannot be used.
std::string NextPart(const Verdict& verdict, const ReportContext& context, const std::string& located);
// Returns the record of a run: facts, each with its name, the remarks of the config, and what the context states.
std::string RecordPart(std::vector<std::pair<std::string, std::string>> facts,
                       const std::vector<std::pair<std::string, std::string>>& about, const ReportContext& context);
// A row of a table of figures: what stands before them, and the figures.
struct FigureLine {
  std::vector<PageCell> begin;
  CameraFigures figures;
};
// A column of such a table.
struct FigureTitle {
  const char* title;
  std::optional<double> CameraFigures::*figure;
};
// Returns a table of the errors of methods or of cameras, followed by the columns `more` and, if the truth is known of
// any, the true errors. `head`: the titles of what stands before the figures.
std::string FiguresTable(std::vector<std::string> head, const std::vector<FigureTitle>& more,
                         const std::vector<FigureLine>& lines);
// Returns the cells of the change of a result without a capture, in mm and deg, and of its probability.
std::vector<PageCell> MoveCells(const std::optional<CaptureMove>& move);

// Returns the table of a camera's intrinsics: each parameter with its sigma, by the block of the covariance that is
// called `block`, or "held" if the block does not have it, and with its error if the true camera is known. `truth` may
// be null.
std::string IntrinsicsTable(const std::string& title, const Camera& camera, const Covariance& covariance,
                            const std::string& block, const Camera* truth = nullptr);

// Returns markup. If the result has no refined estimate, the pose of the last successful estimate is shown.
std::string RecordSection(const RunResult& result, const ReportContext& context);

}  // namespace heba
