// The first page of a report, which serves as a stand-alone record: the setup and its data, the quality of the
// calibration, the result in the formats that users copy, and the recommended next steps.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/pages/page.h"
#include "tools/pages/report_data.h"
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

// A constant pose of the result.
struct ShownPose {
  std::string what;  // In words: "camera left in world".
  std::string name;  // The name as a transform: "world_from_left".
  Rigid3d pose;
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  std::optional<PoseError> truth;
};
// Returns the poses of the cameras, of the targets and of the bases but the first.
std::vector<ShownPose> PosesOf(const RunResult& result);
// Returns poses and intrinsics with the sigma of each number, in the notations that users copy.
std::string PoseParts(const std::vector<ShownPose>& poses, const std::string& intrinsics);

// Returns the table of the intrinsics of each camera: each parameter with its sigma, or "held", and with its error if
// the true camera is known.
std::string IntrinsicsTables(const ReportData& data);

// Returns the title of the page: the name of the run or, of a config that is called config, that of its folder.
std::string TitleOf(const ReportData& data, const ReportContext& context);
// Returns markup, with `beside` beside the verdict and its figures where there is room.
std::string RecordSection(const ReportData& data, const ReportContext& context, const std::string& beside);

}  // namespace heba
