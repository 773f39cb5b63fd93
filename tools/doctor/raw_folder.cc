#include "tools/doctor/raw_folder.h"

#include <stdlib.h>

#include <algorithm>
#include <limits>
#include <map>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/data/setup.h"
#include "heba/io/camera_file.h"
#include "heba/io/export_format.h"
#include "heba/io/import_text.h"
#include "heba/io/pose_source.h"
#include "heba/target.h"
#include "tools/config/commented_config.h"
#include "tools/config/run_config.h"
#include "tools/doctor/pose_guess.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the entries of a folder, sorted by name.
std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) entries.push_back(entry.path());
  std::sort(entries.begin(), entries.end());
  return entries;
}

bool Reads(const fs::path& file, void (*read)(const fs::path& file)) {
  try {
    read(file);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

bool IsCamera(const fs::path& file) {
  return Reads(file, [](const fs::path& path) { ReadCameraFile(path); });
}

bool IsTarget(const fs::path& file) {
  return Reads(file, [](const fs::path& path) {
    MapReader reader(ReadYamlFile(path));
    CreateTarget(reader);
  });
}

std::string ConfigText(const RawFolder& raw, const PoseFormat& format, const std::optional<Setup>& setup,
                       const fs::path& config, const std::vector<std::string>& remarks) {
  const auto path = [&](const fs::path& file) {
    return QuotedForYaml(
        fs::weakly_canonical(file).lexically_proximate(fs::weakly_canonical(config.parent_path())).string());
  };
  std::map<std::string, std::string> values = {{"captures.images", path(raw.images)},
                                               {"captures.poses", path(raw.poses)},
                                               {"captures.pose_format", PoseFormatText(format)}};
  if (setup) values["setup"] = SetupName(*setup);
  if (raw.target) values["target"] = path(*raw.target);
  if (raw.camera) values["camera.intrinsics"] = path(*raw.camera);
  return CommentedConfig(values, remarks);
}

// Returns the format with a name that reads the file as `format` does, or `format` itself if none does.
PoseFormat NamedFormat(const PoseFormat& format, const fs::path& poses) {
  for (const PoseFormat& known : PoseFormats()) {
    if (known.translation_unit != format.translation_unit || known.rotation != format.rotation ||
        known.angle_unit != format.angle_unit || known.columns.size() != format.columns.size()) {
      continue;
    }
    try {
      ReadPoses(poses, known);
      return known;
    } catch (const InputError&) {
      // The file has other names for its columns, or none.
    }
  }
  return format;
}

struct Trial {
  Setup setup = Setup::kEyeToHand;
  PoseFormat format;
  double misfit_m = 0;
  std::string misfit;
};

std::string TrialInWords(const Trial& trial) {
  return std::string(SetupName(trial.setup)) + ": robot and images differ by " + trial.misfit;
}

// A temporary folder for a trial config.
class TrialFolder {
 public:
  TrialFolder() {
    std::string name = (fs::temp_directory_path() / "heba_trial_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw OutputError(name + ": the temporary folder cannot be created");
    path_ = name;
  }
  ~TrialFolder() {
    std::error_code error;
    fs::remove_all(path_, error);
  }
  TrialFolder(const TrialFolder&) = delete;
  TrialFolder& operator=(const TrialFolder&) = delete;
  fs::path config() const { return path_ / "config.yaml"; }

 private:
  fs::path path_;
};

// Explains why no reading fits in either setup: by the config's fault, if it has one.
std::string WhyNoReading(const fs::path& trial) {
  try {
    ReadRunConfig(trial);
  } catch (const InputError& fault) {
    return std::string("the data set cannot be read: ") + fault.what();
  }
  return "no format that was tried fits the images; set setup in the config and run 'heba doctor' on it to learn "
         "more";
}

}  // namespace

RawFolder FindRawFiles(const fs::path& folder, const RawFolder& given) {
  RawFolder raw = given;
  std::vector<fs::path> folders = {folder};
  std::error_code error;
  for (const fs::path& entry : EntriesOf(folder)) {
    if (fs::is_directory(entry, error)) folders.push_back(entry);
  }
  for (const fs::path& candidate : raw.images.empty() ? folders : std::vector<fs::path>{raw.images}) {
    const size_t count = ImagesOf(candidate).size();
    if (count > raw.num_images) {
      raw.images = candidate;
      raw.num_images = count;
    }
  }
  // A table takes precedence over files of one pose each.
  std::vector<fs::path> sources;
  for (const fs::path& place : {folder, raw.images}) {
    for (const fs::path& entry : EntriesOf(place)) {
      if (!fs::is_regular_file(entry, error) || HasImageSuffix(entry)) continue;
      sources.push_back(entry);
      if (!raw.camera && IsCamera(entry)) raw.camera = entry;
      if (!raw.target && IsTarget(entry)) raw.target = entry;
    }
  }
  for (const fs::path& candidate : folders) {
    if (PoseFilesOf(candidate).size() > 2) sources.push_back(candidate);
  }
  if (!given.poses.empty()) sources = {given.poses};
  // The source whose number of rows is closest to the number of images is chosen.
  size_t best_difference = std::numeric_limits<size_t>::max();
  for (const fs::path& source : sources) {
    if (source == raw.camera || source == raw.target) continue;
    const GuessedTable table = GuessPoseFormats(source);
    if (table.formats.empty()) continue;
    const size_t difference = std::max(table.num_rows, raw.num_images) - std::min(table.num_rows, raw.num_images);
    if (difference >= best_difference) continue;
    best_difference = difference;
    raw.poses = source;
    raw.format = table.formats.front();
  }
  return raw;
}

std::optional<RawFolder> FindRawFolder(const fs::path& folder) {
  const RawFolder raw = FindRawFiles(folder, {});
  if (raw.num_images == 0 || raw.poses.empty()) return std::nullopt;
  return raw;
}

RawConfig ConfigOf(const RawFolder& raw, const fs::path& config, int num_threads) {
  const std::optional<fs::path>& target = raw.target;
  if (target) {
    // A fault of the target is reported before the poses are tried.
    MapReader reader(ReadYamlFile(*target));
    CreateTarget(reader);
  }
  RawConfig made;
  const TrialFolder folder;
  const fs::path trial = folder.config();
  std::vector<Trial> trials;
  for (const Setup setup : {Setup::kEyeToHand, Setup::kEyeInHand}) {
    if (!target || (raw.setup && setup != *raw.setup)) continue;
    WriteFileAtomically(trial, ConfigText(raw, raw.format, setup, trial, {}));
    const std::optional<GuessedReading> reading = GuessReading(trial, {}, num_threads, Verbosity::kQuiet);
    if (!reading || !reading->fits) continue;
    const PoseFit& fit = *reading->diagnosis.pose_fit;
    trials.push_back({setup, reading->format, fit.misfit_m, fit.misfit});
  }
  std::sort(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) { return a.misfit_m < b.misfit_m; });
  // Two setups with similar misfits are not distinguished.
  constexpr double kDecidedly = 2.5;
  const bool is_decided =
      trials.size() == 1 || (trials.size() > 1 && trials[1].misfit_m > kDecidedly * trials[0].misfit_m);
  std::optional<Setup> setup = raw.setup;
  PoseFormat format = raw.format;
  if (trials.empty()) {
    made.remarks.push_back(
        "the poses contain " + ReadingInWords(raw.format) + ", guessed from the size of the numbers: " +
        (target ? WhyNoReading(trial)
                : "name the target and the setup in the config, and 'heba doctor' compares every reading with "
                  "the images; or import with --target FILE"));
  } else {
    if (is_decided) setup = trials.front().setup;
    format = trials.front().format;
    made.remarks.push_back("the poses contain " + ReadingInWords(format) + ", which fits the images; " +
                           TrialInWords(trials.front()) +
                           (trials.size() > 1 ? ", and " + TrialInWords(trials.back()) : ""));
    if (!setup) made.remarks.emplace_back("both setups fit equally well: set setup in the config");
    if (!raw.setup)
      made.remarks.emplace_back(
          "poses are assumed to be those of the gripper in the base; if they are the inverse, the setup is the other "
          "one");
  }
  made.text = ConfigText(raw, NamedFormat(format, raw.poses), setup, config, made.remarks);
  return made;
}

}  // namespace heba
