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

// Returns the text of a config. Paths in it are relative to `config`, or absolute if that is empty.
std::string ConfigText(const RawFolder& raw, const PoseFormat& format, const std::optional<Setup>& setup,
                       const fs::path& config, const std::vector<std::string>& remarks) {
  const auto path = [&](const fs::path& file) {
    const fs::path whole = fs::weakly_canonical(file);
    return QuotedForYaml(
        (config.empty() ? whole : whole.lexically_proximate(fs::weakly_canonical(fs::absolute(config).parent_path())))
            .string());
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

// The best reading of the poses under one setup.
struct Trial {
  Setup setup = Setup::kEyeToHand;
  GuessedReading reading;

  double MisfitM() const {
    const std::optional<PoseFit>& fit = reading.diagnosis.pose_fit;
    return fit ? fit->misfit_m : std::numeric_limits<double>::infinity();
  }
  std::string InWords() const {
    return std::string(SetupName(setup)) + ": robot and images differ by " + reading.diagnosis.pose_fit->misfit;
  }
};

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

// Returns the fault of a trial config as one of the user's files: without the name of the trial config, and with paths
// as the user knows them.
std::string InPathsOfUser(const std::string& fault, const fs::path& trial, const RawFolder& raw) {
  std::string text = fault;
  if (text.starts_with(trial.string() + ":")) text = text.substr(text.find(": ") + 2);
  std::vector<fs::path> known = {raw.poses, raw.images};
  if (raw.target) known.push_back(*raw.target);
  if (raw.camera) known.push_back(*raw.camera);
  for (const fs::path& path : known) {
    const std::string whole = fs::weakly_canonical(path).string();
    for (size_t at = text.find(whole); at != std::string::npos; at = text.find(whole, at + path.string().size())) {
      text.replace(at, whole.size(), path.string());
    }
  }
  return text;
}

// Explains why the trial config cannot be read; empty if it can be.
std::string FaultOfTrial(const fs::path& trial, const RawFolder& raw) {
  try {
    ReadRunConfig(trial);
  } catch (const InputError& fault) {
    return "the data set cannot be read: " + InPathsOfUser(fault.what(), trial, raw);
  }
  return "";
}

bool IsOfTarget(const Symptom& symptom) {
  return symptom.code == SymptomCode("target") || symptom.code == SymptomCode("target_scale");
}

// Adds the faults and the counts that the best of the trials shows.
void AddSymptoms(const Diagnosis& diagnosis, RawConfig* made) {
  if (const std::string fault = FirstWrong(diagnosis); !fault.empty()) made->warnings.push_back(fault);
  for (const Symptom& symptom : diagnosis.symptoms) {
    if (symptom.code == SymptomCode("unpaired") && symptom.severity == Severity::kRemark)
      made->remarks.push_back(symptom.Text());
  }
}

// Describes trials of which none fits. `fault`: why none could be made.
void DescribeMisfit(const RawFolder& raw, const std::vector<Trial>& trials, const std::string& fault, RawConfig* made) {
  const std::string guessed =
      "the poses contain " + ReadingInWords(raw.format) + ", guessed from the size of the numbers";
  if (!raw.target) {
    made->remarks.push_back(guessed +
                            ": name the target and the setup in the config, and 'heba doctor' compares every reading "
                            "with the images; or import with --target FILE");
    return;
  }
  if (!fault.empty()) {
    made->warnings.push_back(fault);
  } else if (!trials.empty()) {
    AddSymptoms(trials.front().reading.diagnosis, made);
  }
  if (made->warnings.empty()) {
    made->warnings.push_back("no format of the poses that was tried fits the images" +
                             std::string(raw.setup ? " with setup: " + std::string(SetupName(*raw.setup)) : ""));
  }
  const bool is_compared = !trials.empty() && trials.front().reading.diagnosis.pose_fit;
  made->remarks.push_back(guessed + (is_compared ? ": no format that was tried fits the images" : "") +
                          (raw.setup ? "" : "; the setup is left open"));
}

// Describes trials that fit, the best one first.
void DescribeFit(const RawFolder& raw, const std::vector<Trial>& trials, bool is_decided, RawConfig* made) {
  const Diagnosis& diagnosis = trials.front().reading.diagnosis;
  AddSymptoms(diagnosis, made);
  const bool is_other_target = std::any_of(diagnosis.symptoms.begin(), diagnosis.symptoms.end(), IsOfTarget);
  made->remarks.push_back("the poses contain " + ReadingInWords(trials.front().reading.format) +
                          ", which fits the images" + (is_other_target ? " if the target is corrected" : "") + "; " +
                          trials.front().InWords() + (trials.size() > 1 ? ", and " + trials.back().InWords() : ""));
  if (!is_decided) made->warnings.emplace_back("both setups fit equally well: set setup in the config");
  if (!raw.setup) {
    made->remarks.emplace_back(
        "poses are assumed to be those of the gripper in the base; if they are the inverse, the setup is the other "
        "one");
  }
}

// Returns the remarks as comments of the config.
std::vector<std::string> CommentsOf(const RawConfig& made) {
  std::vector<std::string> comments;
  for (const std::string& warning : made.warnings) comments.push_back("Warning: " + warning);
  comments.insert(comments.end(), made.remarks.begin(), made.remarks.end());
  return comments;
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
  if (!raw.format.columns.empty()) return raw;
  for (const fs::path& source : sources) {
    raw.poses_fault = FaultOfDecimalCommas(source);
    if (!raw.poses_fault.empty()) break;
  }
  return raw;
}

std::optional<RawFolder> FindRawFolder(const fs::path& folder) {
  const RawFolder raw = FindRawFiles(folder, {});
  if (raw.num_images > 0 && !raw.poses_fault.empty()) throw InputError(raw.poses_fault);
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
  std::string fault;
  for (const Setup setup : {Setup::kEyeToHand, Setup::kEyeInHand}) {
    if (!target || !fault.empty() || (raw.setup && setup != *raw.setup)) continue;
    WriteFileAtomically(trial, ConfigText(raw, raw.format, setup, {}, {}));
    fault = FaultOfTrial(trial, raw);
    if (!fault.empty()) continue;
    std::optional<GuessedReading> reading = GuessReading(trial, {}, num_threads, Verbosity::kQuiet, Examine::kInputs);
    if (reading) trials.push_back({setup, std::move(*reading)});
  }
  // Trials that fit come first.
  std::stable_sort(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) {
    return std::pair(!a.reading.fits, a.MisfitM()) < std::pair(!b.reading.fits, b.MisfitM());
  });
  made.setup = raw.setup;
  PoseFormat format = raw.format;
  if (trials.empty() || !trials.front().reading.fits) {
    DescribeMisfit(raw, trials, fault, &made);
  } else {
    std::erase_if(trials, [](const Trial& one) { return !one.reading.fits; });
    // Two setups with similar misfits are not distinguished.
    constexpr double kDecidedly = 2.5;
    const bool is_decided = raw.setup || trials.size() == 1 || trials[1].MisfitM() > kDecidedly * trials[0].MisfitM();
    if (is_decided) made.setup = trials.front().setup;
    format = trials.front().reading.format;
    made.fits = is_decided;
    DescribeFit(raw, trials, is_decided, &made);
  }
  made.text = ConfigText(raw, NamedFormat(format, raw.poses), made.setup, config, CommentsOf(made));
  return made;
}

std::string RemarksText(const RawConfig& made) {
  std::string text;
  for (const std::string& warning : made.warnings) text += "warning: " + warning + "\n";
  for (const std::string& remark : made.remarks) text += "remark: " + remark + "\n";
  return text;
}

}  // namespace heba
