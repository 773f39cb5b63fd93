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
#include "heba/io/import.h"
#include "heba/io/import_text.h"
#include "heba/io/pose_folder.h"
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

// Returns a path as a value of a config: relative to `config`, or absolute if that is empty.
std::string PathInConfig(const fs::path& file, const fs::path& config) {
  const fs::path whole = fs::weakly_canonical(file);
  return QuotedForYaml(
      (config.empty() ? whole : whole.lexically_proximate(fs::weakly_canonical(fs::absolute(config).parent_path())))
          .string());
}

// Returns the text of a config. Paths in it are relative to `config`, or absolute if that is empty.
std::string ConfigText(const RawFolder& raw, const RawPoses& poses, const std::optional<Setup>& setup,
                       const fs::path& config, const std::vector<std::string>& remarks) {
  const auto path = [&](const fs::path& file) { return PathInConfig(file, config); };
  std::string source = path(poses.source);
  if (!poses.paths.pose.empty()) {
    source = "{file: " + source + ", pose: " + QuotedForYaml(poses.paths.pose) +
             (poses.paths.image.empty() ? "" : ", image: " + QuotedForYaml(poses.paths.image)) + "}";
  }
  std::map<std::string, std::string> values = {{"captures.images", path(raw.images)},
                                               {"captures.poses", source},
                                               {"captures.pose_format", PoseFormatText(poses.format)}};
  if (setup) values["setup"] = SetupName(*setup);
  if (raw.target) values["target"] = path(*raw.target);
  if (raw.camera) values["camera.intrinsics"] = path(*raw.camera);
  return CommentedConfig(values, remarks);
}

// Returns whether two readings give the same poses.
bool AreAlike(const std::vector<PoseRow>& a, const std::vector<PoseRow>& b) {
  constexpr double kRounding = 1e-9;
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const PoseRow& one, const PoseRow& other) {
    const Rigid3d difference = Inverse(one.pose) * other.pose;
    return difference.translation.norm() < kRounding && RotationAngle(difference.rotation) < kRounding;
  });
}

// Returns the poses in the format with a name that reads them as their own does, or unchanged if none does.
RawPoses WithNamedFormat(const RawPoses& poses) {
  for (const PoseFormat& known : PoseFormats()) {
    try {
      const auto read = [&](const PoseFormat& format) { return ReadPoses(poses.source, format, {}, poses.paths); };
      if (!AreAlike(read(known), read(poses.format))) continue;
      RawPoses named = poses;
      named.format = known;
      return named;
    } catch (const InputError&) {
      // The file has other names for its columns, or none.
    }
  }
  return poses;
}

std::string PlaceText(const RawPoses& poses) {
  return poses.source.string() + (poses.paths.pose.empty() ? "" : ", " + poses.paths.pose);
}

// The best reading of some poses under one setup.
struct Trial {
  RawPoses poses;
  Setup setup = Setup::kEyeToHand;
  GuessedReading reading;

  // Poses of the target in the camera fit perfectly, and say nothing.
  bool Fits() const { return reading.fits && !reading.diagnosis.pose_fit->is_of_camera; }
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
std::string InPathsOfUser(const std::string& fault, const fs::path& trial, const RawFolder& raw,
                          const RawPoses& poses) {
  std::string text = fault;
  if (text.starts_with(trial.string() + ":")) text = text.substr(text.find(": ") + 2);
  std::vector<fs::path> known = {poses.source, raw.images};
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
std::string FaultOfTrial(const fs::path& trial, const RawFolder& raw, const RawPoses& poses) {
  try {
    ReadShortRunConfig(trial);
  } catch (const InputError& fault) {
    return "the data set cannot be read: " + InPathsOfUser(fault.what(), trial, raw, poses);
  }
  return "";
}

bool IsOfTarget(const Symptom& symptom) {
  return symptom.code == SymptomCode("target") || symptom.code == SymptomCode("target_scale");
}

// Words become the warnings and remarks of a RawConfig.
struct Words {
  std::vector<std::string> warnings;
  std::vector<std::string> remarks;
};

// Returns the faults and the counts that the best of the trials shows.
Words WordsOf(const Diagnosis& diagnosis) {
  Words words;
  if (const std::string fault = FirstWrong(diagnosis); !fault.empty()) words.warnings.push_back(fault);
  for (const Symptom& symptom : diagnosis.symptoms) {
    if (symptom.code == SymptomCode("unpaired") && symptom.severity == Severity::kRemark)
      words.remarks.push_back(symptom.Text());
  }
  return words;
}

// Describes trials of which none fits. `fault`: why none could be made.
Words WordsOfMisfit(const RawFolder& raw, const std::vector<Trial>& trials, const std::string& fault) {
  const RawPoses& poses = trials.empty() ? raw.found.front() : trials.front().poses;
  const std::string guessed = "the poses (" + PlaceText(poses) + ") contain " + ReadingInWords(poses.format) +
                              ", guessed from the size of the numbers";
  if (!raw.target) {
    return {{},
            {guessed +
             ": name the target and the setup in the config, and 'heba doctor' compares every reading with the images; "
             "or import with --target FILE"}};
  }
  Words words;
  if (!trials.empty()) {
    words = WordsOf(trials.front().reading.diagnosis);
  } else if (!fault.empty()) {
    words.warnings.push_back(fault);
  }
  if (words.warnings.empty()) {
    words.warnings.push_back("no format of the poses that was tried fits the images" +
                             std::string(raw.setup ? " with setup: " + std::string(SetupName(*raw.setup)) : ""));
  }
  const bool is_compared = !trials.empty() && trials.front().reading.diagnosis.pose_fit;
  words.remarks.push_back(guessed + (is_compared ? ": no format that was tried fits the images" : "") +
                          (raw.setup ? "" : "; the setup is left open"));
  return words;
}

// Describes trials that fit, the best one first, and the poses that were not taken.
Words WordsOfFit(const RawFolder& raw, const std::vector<Trial>& trials, bool is_decided) {
  const Trial& best = trials.front();
  const Diagnosis& diagnosis = best.reading.diagnosis;
  Words words = WordsOf(diagnosis);
  const bool is_other_target = std::any_of(diagnosis.symptoms.begin(), diagnosis.symptoms.end(), IsOfTarget);
  const auto other = std::find_if(trials.begin(), trials.end(), [&](const Trial& one) {
    return one.setup != best.setup && PlaceText(one.poses) == PlaceText(best.poses);
  });
  words.remarks.push_back("the poses (" + PlaceText(best.poses) + ") contain " + ReadingInWords(best.reading.format) +
                          ", which fits the images" + (is_other_target ? " if the target is corrected" : "") + "; " +
                          best.InWords() + (other == trials.end() ? "" : ", and " + other->InWords()));
  if (!is_decided) words.warnings.emplace_back("both setups fit equally well: set setup in the config");
  if (!raw.setup) {
    words.remarks.emplace_back(
        "poses are assumed to be those of the gripper in the base; if they are the inverse, the setup is the other "
        "one");
  }
  std::vector<std::string> others;
  for (const RawPoses& poses : raw.found) {
    if (PlaceText(poses) != PlaceText(best.poses)) others.push_back(PlaceText(poses));
  }
  if (!others.empty()) words.remarks.push_back("other poses were found and not taken: " + Join(others, "; "));
  return words;
}

// Reads the text of a config again, with the reader of `heba run`, and examines it. Throws InputError unless robot and
// images agree as they did in the trial.
void CheckWritten(const RawConfig& made, const std::string& text, const fs::path& trial, const Trial& best,
                  int num_threads) {
  WriteFileAtomically(trial, text);
  const RunConfig read =
      ReadShortRunConfig(trial, made.setup ? std::vector<std::string>{}
                                           : std::vector<std::string>{"setup=" + std::string(SetupName(best.setup))});
  const Diagnosis diagnosis = DiagnosePair(read, num_threads, Verbosity::kQuiet, Examine::kInputs);
  constexpr double kAsGood = 1.2;
  if (diagnosis.pose_fit && diagnosis.pose_fit->fits && diagnosis.pose_fit->misfit_m <= kAsGood * best.MisfitM())
    return;
  throw InputError(PlaceText(best.poses) + ": an error of heba: the poses fit as " +
                   ReadingInWords(best.reading.format) + " (" + best.reading.diagnosis.pose_fit->misfit +
                   "), but not as pose_format: " + PoseFormatText(read.arms.front().reading.format) +
                   " would have been written (" +
                   (diagnosis.pose_fit ? diagnosis.pose_fit->misfit : std::string("no fit")) + ")");
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
  for (const fs::path& source : sources) {
    if (source == raw.camera || source == raw.target) continue;
    for (const GuessedTable& table : GuessTables(source)) {
      raw.found.push_back({source, table.paths, table.formats.front(), table.num_rows});
    }
  }
  const auto difference_of = [&](const RawPoses& poses) {
    return std::max(poses.num_rows, raw.num_images) - std::min(poses.num_rows, raw.num_images);
  };
  std::stable_sort(raw.found.begin(), raw.found.end(),
                   [&](const RawPoses& a, const RawPoses& b) { return difference_of(a) < difference_of(b); });
  return raw;
}

std::optional<RawFolder> FindRawFolder(const fs::path& folder) {
  RawFolder raw = FindRawFiles(folder, {});
  if (raw.num_images == 0 || raw.found.empty()) return std::nullopt;
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
  for (const RawPoses& poses : raw.found) {
    for (const Setup setup : {Setup::kEyeToHand, Setup::kEyeInHand}) {
      if (!target || (raw.setup && setup != *raw.setup)) continue;
      WriteFileAtomically(trial, ConfigText(raw, poses, setup, {}, {}));
      const std::string fault_here = FaultOfTrial(trial, raw, poses);
      if (fault.empty()) fault = fault_here;
      if (!fault_here.empty()) break;
      std::optional<GuessedReading> reading = GuessReading(trial, {}, num_threads, Verbosity::kQuiet, Examine::kInputs);
      if (reading) trials.push_back({poses, setup, std::move(*reading)});
    }
  }
  // Trials that fit come first.
  std::stable_sort(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) {
    return std::pair(!a.Fits(), a.MisfitM()) < std::pair(!b.Fits(), b.MisfitM());
  });
  made.setup = raw.setup;
  RawPoses poses = raw.found.front();
  std::optional<Trial> best;
  Words words;
  if (trials.empty() || !trials.front().Fits()) {
    words = WordsOfMisfit(raw, trials, fault);
  } else {
    std::erase_if(trials, [](const Trial& one) { return !one.Fits(); });
    best = trials.front();
    // Two setups with similar misfits are not distinguished.
    constexpr double kDecidedly = 2.5;
    const bool has_rival = std::any_of(trials.begin(), trials.end(), [&](const Trial& one) {
      return one.setup != best->setup && one.MisfitM() <= kDecidedly * best->MisfitM();
    });
    const bool is_decided = raw.setup || !has_rival;
    if (is_decided) made.setup = best->setup;
    poses = best->poses;
    poses.format = best->reading.format;
    made.fits = is_decided;
    words = WordsOfFit(raw, trials, is_decided);
  }
  made.warnings = std::move(words.warnings);
  made.remarks = std::move(words.remarks);
  made.poses = poses.source;
  poses = WithNamedFormat(poses);
  if (best) CheckWritten(made, ConfigText(raw, poses, made.setup, {}, {}), trial, *best, num_threads);
  made.text = ConfigText(raw, poses, made.setup, config, CommentsOf(made));
  return made;
}

std::optional<RawConfig> ConfigOfDataSet(const fs::path& folder, const RawFolder& raw, const fs::path& config,
                                         int num_threads) {
  const ImportFormat* const format = FindImportFormat(folder);
  if (format == nullptr || format->reader.read == nullptr) return std::nullopt;
  ImportedSet set;
  try {
    set = ImportDataSet(folder, format->name);
  } catch (const InputError&) {
    return std::nullopt;
  }
  std::error_code error;
  const bool is_whole = std::all_of(set.captures.begin(), set.captures.end(), [&](const ImportedCapture& capture) {
    return !capture.image.empty() && fs::exists(capture.image, error) && capture.base_from_gripper;
  });
  if (!is_whole || (set.target.empty() && !raw.target)) return std::nullopt;
  const auto text_of = [&](const std::optional<Setup>& setup, const fs::path& of_config,
                           const std::vector<std::string>& remarks) {
    std::map<std::string, std::string> values = {{"captures.data", PathInConfig(folder, of_config)},
                                                 {"captures.format", set.format}};
    if (setup) values["setup"] = SetupName(*setup);
    if (raw.target) values["target"] = PathInConfig(*raw.target, of_config);
    if (raw.camera) values["camera.intrinsics"] = PathInConfig(*raw.camera, of_config);
    return CommentedConfig(values, remarks);
  };
  const TrialFolder trial;
  const std::optional<Setup> known = raw.setup ? raw.setup : set.setup;
  RawConfig made;
  made.poses = folder;
  made.warnings = set.remarks;
  std::optional<double> best_m;
  std::string misfit;
  for (const Setup setup : {Setup::kEyeToHand, Setup::kEyeInHand}) {
    if (known && setup != *known) continue;
    WriteFileAtomically(trial.config(), text_of(setup, {}, {}));
    const Diagnosis diagnosis =
        DiagnosePair(ReadShortRunConfig(trial.config()), num_threads, Verbosity::kQuiet, Examine::kInputs);
    const std::optional<PoseFit>& fit = diagnosis.pose_fit;
    if (!fit || !fit->fits || (best_m && fit->misfit_m >= *best_m)) continue;
    best_m = fit->misfit_m;
    misfit = fit->misfit;
    made.setup = setup;
    if (const std::string fault = FirstWrong(diagnosis); !fault.empty()) made.warnings.push_back(fault);
  }
  made.fits = best_m.has_value();
  made.remarks.push_back("the folder is a data set of " + set.format +
                         (made.fits
                              ? "; " + std::string(SetupName(*made.setup)) + ": robot and images differ by " + misfit
                              : "; robot and images do not fit"));
  made.text = text_of(made.setup, config, CommentsOf(made));
  return made;
}

std::string RemarksText(const RawConfig& made) {
  std::string text;
  for (const std::string& warning : made.warnings) text += "warning: " + warning + "\n";
  for (const std::string& remark : made.remarks) text += "remark: " + remark + "\n";
  return text;
}

}  // namespace heba
