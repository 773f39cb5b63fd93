#include "tools/config/prior_section.h"

#include <filesystem>
#include <memory>

#include "tools/config/run_folder.h"

namespace heba {
namespace {

// Reads {translation, rotation}: one sigma of the motion of a camera on its mount.
ChangeOfCell ReadChange(MapReader& reader) {
  ChangeOfCell change;
  change.translation_m = reader.Length("translation", 0);
  if (change.translation_m < 0) reader.Get("translation").Fail("must not be negative");
  change.rotation_rad = reader.Angle("rotation", 0);
  if (change.rotation_rad < 0) reader.Get("rotation").Fail("must not be negative");
  reader.Finish();
  return change;
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
      earlier.change = ReadChange(drift);
      reader.Record("drift", drift.used());
    }
    earlier.change.is_target_moved = reader.Choice("target", {"in-place", "moved"}, "in-place") == "moved";
    reader.Finish();
    root.Record("prior", reader.used());
  } else {
    run = root.InputPath("prior");
  }
  earlier.name = run.string();
  earlier.result = std::make_shared<const RunResult>(ReadRefinedResult(RunFolderOf(run)));
  return earlier;
}

}  // namespace heba
