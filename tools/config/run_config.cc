#include "tools/config/run_config.h"

#include "heba/base/error.h"
#include "heba/config/yaml_reader.h"
#include "tools/config/common_keys.h"
#include "tools/config/evaluate_section.h"
#include "tools/config/file_kind.h"
#include "tools/config/long_form.h"
#include "tools/config/long_run_config.h"
#include "tools/config/prior_section.h"
#include "tools/config/run_folder.h"
#include "tools/config/short_run_config.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

ConfigValue ReadConfigFile(const fs::path& path, const std::vector<std::string>& settings) {
  RefuseFolder(path, FileKind::kRunConfig);
  const ConfigValue file = ReadYamlFileOverBases(path, {"name", "output"});
  return settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
}

// Reads a config by the function for its form. What both forms have is read before and after that.
RunConfig ReadForm(const fs::path& path, const ConfigValue& value,
                   RunConfig (*read)(MapReader& reader, const fs::path& file)) {
  RefuseOtherKind(value, path, FileKind::kRunConfig);
  MapReader reader(value);
  const std::string name = ReadFolderName(reader, path.stem().string());
  const std::vector<std::pair<std::string, std::string>> about = ReadAbout(reader);
  RunConfig config = read(reader, path);
  config.file = path;
  config.data.name = name;
  config.data.about = about;
  const EvaluateSection evaluate = ReadEvaluate(reader, config.data.rig);
  config.options.folds = evaluate.folds;
  config.options.requirements = evaluate.requirements;
  config.truth = evaluate.truth;
  config.options.earlier = ReadPrior(reader);
  if (config.options.earlier) {
    config.data_files.push_back(RunFolderOf(config.options.earlier->name) / "result.json");
  }
  ReadWobble(reader);  // `heba check` needs it.
  config.output = ReadOutput(reader, fs::absolute(path).parent_path() / "runs" / name);
  reader.Finish();
  config.used = UsedText(reader);
  return config;
}

}  // namespace

bool IsLongConfig(const fs::path& path, const std::vector<std::string>& settings) {
  return HasLongForm(ReadConfigFile(path, settings));
}

RunConfig ReadRunConfig(const fs::path& path, const std::vector<std::string>& settings) {
  const ConfigValue value = ReadConfigFile(path, settings);
  return ReadForm(path, value, HasLongForm(value) ? ReadLongForm : ReadShortForm);
}

RunConfig ReadShortRunConfig(const fs::path& path, const std::vector<std::string>& settings) {
  const ConfigValue value = ReadConfigFile(path, settings);
  if (HasLongForm(value)) {
    throw InputError(path.string() +
                     ": is the config of a rig (cameras, targets, robots); this command needs a config of one camera "
                     "and one target");
  }
  return ReadForm(path, value, ReadShortForm);
}

}  // namespace heba
