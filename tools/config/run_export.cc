#include "tools/config/run_export.h"

#include <optional>

#include "heba/robot/ur_kinematics.h"
#include "tools/config/capture_section.h"

namespace heba {
namespace {

// Returns whether the poses of an arm are those of a Universal Robots controller, by the config next to the result.
bool PosesAreOfUrController(const std::filesystem::path& run_folder, const std::string& arm) {
  const std::optional<ConfigValue> section = FindPoseSection(run_folder, arm);
  if (!section) return false;
  MapReader poses(*section);
  const auto text_of = [&](const std::string& key) {
    const std::optional<ConfigValue> value = poses.Find(key);
    return value && value->IsText() ? value->AsText() : std::string();
  };
  const std::string format = text_of("pose_format");
  return format == "ur" || (format == "joints" && FindUrRobot(text_of("robot")) != nullptr);
}

}  // namespace

ExportRequests ExportRequestsOf(const std::filesystem::path& run_folder, const RunResult& result,
                                const std::string& method) {
  std::vector<bool> is_ur_controller;
  for (const std::string& arm : result.rig.robots) is_ur_controller.push_back(PosesAreOfUrController(run_folder, arm));
  return MakeExportRequests(result, method, is_ur_controller);
}

std::vector<ExportedFile> FilesToExport(const std::vector<ExportFormat>& formats, const ExportRequests& requests,
                                        Grade grade, bool is_forced, const std::string& how_to_force) {
  std::vector<ExportedFile> files;
  for (const ExportFormat& format : formats) {
    for (ExportedFile& file : ExportFiles(format, requests)) {
      if (file.content == ExportedContent::kArm && !file.text.empty() && grade == Grade::kBad && !is_forced) {
        file.text.clear();
        file.reason = "the verdict of this run is bad, and a robot would move by it; " + how_to_force;
      }
      files.push_back(std::move(file));
    }
  }
  return files;
}

}  // namespace heba
