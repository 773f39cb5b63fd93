#include "tools/config/run_folder.h"

#include <system_error>

#include "heba/base/error.h"
#include "heba/io/result_file.h"

namespace heba {

std::filesystem::path RunFolderOf(const std::filesystem::path& run) {
  std::error_code error;
  const bool is_result = run.filename() == "result.json" && std::filesystem::is_regular_file(run, error);
  if (!is_result) return run;
  return run.has_parent_path() ? run.parent_path() : std::filesystem::path(".");
}

RunResult ReadRefinedResult(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "result.json";
  RunResult result = ReadRunResult(file);
  if (!IsShort(result) || FindRefined(result) != nullptr) return result;
  throw InputError(folder.string() + ": contains no refined estimate; a calibration from images or corners is needed");
}

}  // namespace heba
