#include "tools/config/prior_section.h"

#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "heba/base/error.h"
#include "heba/config/yaml_reader.h"
#include "tools/config/run_folder.h"

namespace heba {
namespace {

// Reads {translation, rotation}: one sigma of the motion of a camera on its mount.
void ReadChange(MapReader reader, ChangeOfCell* change) {
  change->translation_m = reader.Length("translation", 0);
  change->rotation_rad = reader.Angle("rotation", 0);
  for (const char* key : {"translation", "rotation"}) {
    const double sigma = key == std::string("translation") ? change->translation_m : change->rotation_rad;
    if (sigma < 0) reader.Get(key).Fail("must not be negative");
  }
  reader.Finish();
}

}  // namespace

std::optional<EarlierRun> ReadPrior(MapReader& root) {
  const std::optional<ConfigValue> value = root.Find("prior");
  if (!value) return std::nullopt;
  EarlierRun earlier;
  std::filesystem::path run;
  if (value->IsMap()) {
    MapReader reader(*value);
    run = reader.InputPath("run");
    if (reader.Has("drift")) {
      MapReader drift(reader.Get("drift"));
      ReadChange(drift, &earlier.change);
      reader.Record("drift", drift.used());
    }
    earlier.change.is_target_moved = reader.Choice("target", {"in-place", "moved"}, "in-place") == "moved";
    reader.Finish();
    root.Record("prior", reader.used());
  } else {
    run = root.InputPath("prior");
  }
  const std::filesystem::path folder = RunFolderOf(run);
  earlier.name = run.string();
  RunResult result = ReadRefinedResult(folder);
  if (result.verdict.grade == Grade::kBad) {
    throw InputError(run.string() + ": is bad, and tells nothing that a later run can build on; see its verdict");
  }
  earlier.result = std::make_shared<const RunResult>(std::move(result));
  return earlier;
}

}  // namespace heba
