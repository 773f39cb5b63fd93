#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>

#include "heba/base/error.h"
#include "heba/base/even_indices.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/data/setup.h"
#include "heba/io/camera_file.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"
#include "heba/recognition.h"
#include "heba/target.h"
#include "targets/images/image.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/commented_config.h"
#include "tools/config/key_reference.h"
#include "tools/doctor/raw_folder.h"
#include "tools/text/console.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Asks a question on the terminal and returns the answer without blanks around it. Throws InputError at the end of the
// input.
std::string Ask(const std::string& question) {
  std::cerr << question << " " << std::flush;
  std::string answer;
  if (!std::getline(std::cin, answer))
    throw InputError("the question has no answer; 'heba init --help' lists the flags");
  return Trim(answer);
}

// Asks until the answer is the name of one of the entries, or its number in the list; an empty answer is nothing.
std::string AskChoice(const std::string& question, const std::vector<std::string>& names, bool may_be_empty) {
  while (true) {
    const std::string answer = Ask(question);
    double number = 0;
    if (ParseDouble(answer, &number) && number >= 1 && number <= static_cast<double>(names.size())) {
      return names[static_cast<size_t>(number) - 1];
    }
    const bool is_name = std::find(names.begin(), names.end(), answer) != names.end();
    if (is_name || (answer.empty() && may_be_empty)) return answer;
    std::cerr << Quoted(answer) << " is not one of: " << Join(names, ", ") << DidYouMean(answer, names) << "\n";
  }
}

// Asks for the type of the target and for its required keys, until they describe a target. Returns its YAML.
std::string AskTarget() {
  const std::vector<std::string> types = TargetTypeNames();
  std::cerr << "Which target is in the images?\n";
  for (size_t i = 0; i < types.size(); ++i) std::cerr << "  " << i + 1 << "  " << types[i] << "\n";
  while (true) {
    const std::string type = AskChoice("target:", types, false);
    std::string text = "type: " + type + "\n";
    for (const KeyEntry& entry : KeyEntries()) {
      if (entry.document != "targets" || !entry.key.starts_with(type + ".") || entry.fallback != "required") continue;
      text += entry.key.substr(type.size() + 1) + ": " + Ask(entry.meaning + " (" + entry.value + ")") + "\n";
    }
    try {
      ParseTarget(text);
      return text;
    } catch (const InputError& error) {
      std::cerr << error.what() << "\n";
    }
  }
}

fs::path Existing(const char* flag, const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError("--" + std::string(flag) + ": " + path + ": no such file or folder");
  return path;
}

void RefuseToReplace(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return;
  if (FLAGS_force && fs::is_regular_file(file, error) && IsCommentedConfig(ReadTextFile(file))) return;
  throw InputError(file.string() + ": exists already; remove it, or name another file (--out)" +
                   (FLAGS_force ? "; --force replaces only what 'heba init' wrote" : ""));
}

// Returns where to write the target's keys: target.yaml beside the config, or a file that is named after the config if
// that one has other content.
fs::path TargetFileFor(const fs::path& config, const std::string& text) {
  const fs::path file = config.parent_path() / "target.yaml";
  std::error_code error;
  const auto is_other = [&](const fs::path& path) { return fs::exists(path, error) && ReadTextFile(path) != text; };
  if (!is_other(file)) return file;
  const fs::path named = config.parent_path() / (config.stem().string() + ".target.yaml");
  if (is_other(named)) RefuseToReplace(named);
  return named;
}

// Returns the keys of the target that a few images of a folder show, with its size open; empty if none is seen.
std::string TargetSeen(const fs::path& folder) {
  constexpr size_t kFew = 4;
  const std::vector<fs::path> files = ImagesOf(folder);
  std::vector<cv::Mat> images;
  for (const size_t i : EvenIndices(files.size(), kFew)) images.push_back(ReadGreyImage(files[i]));
  const std::vector<RecognisedTarget> found = RecogniseTargets(images, NumThreads());
  return found.empty() ? "" : RecognisedTargetText(found.front());
}

// Throws InputError unless poses were found.
void CheckPoses(const fs::path& folder, const RawFolder& raw) {
  if (!raw.found.empty()) return;
  throw InputError((raw.poses.empty() ? folder.string() + ": contains no robot poses; name their file (--poses)"
                                      : raw.poses.string() + ": contains no robot poses") +
                   "; 'heba help poses' describes what it may contain");
}

// Returns why no config can be written, as one line.
std::string WhyNoConfig(const RawConfig& made) {
  std::vector<std::string> reasons = made.warnings;
  if (reasons.empty()) reasons = made.remarks;
  return Join(reasons, "; ");
}

// Returns whether a data set of another project has several cameras. One that cannot be read has none.
bool HasSeveralCameras(const fs::path& folder, const ImportFormat& format) {
  try {
    return format.reader.read_rig != nullptr && ImportCell(folder, format.name).has_value();
  } catch (const InputError&) {
    return false;
  }
}

// Writes the target's keys, if there are any, and then the config that `make` makes of the folder with this target;
// both, or none if the config does not fit.
template <class Make>
std::optional<RawConfig> WithTarget(const fs::path& config, const std::string& target_text, RawFolder raw,
                                    const Make& make) {
  fs::path new_target;
  std::error_code error;
  if (!target_text.empty()) {
    ParseTarget(target_text);  // A fault is reported before a file is written.
    raw.target = TargetFileFor(config, target_text);
    if (!fs::exists(*raw.target, error)) new_target = *raw.target;
    WriteFileAtomically(*raw.target, target_text);
  }
  std::optional<RawConfig> made;
  try {
    made = make(raw);
    if (made && made->fits) WriteFileAtomically(config, made->text);
    if (made && !target_text.empty()) made->target = *raw.target;
  } catch (...) {
    if (!new_target.empty()) fs::remove(new_target, error);
    throw;
  }
  if ((!made || !made->fits) && !new_target.empty()) fs::remove(new_target, error);
  return made;
}

// Prints what was written, or why nothing was. Returns the exit status.
int Finish(const fs::path& folder, const fs::path& config, const RawConfig& made) {
  if (!made.fits) {
    PrintError(folder.string() + ": " + WhyNoConfig(made));
    return kWorkFailed;
  }
  std::cout << ForTerminal(RemarksText(made)) << "written: " << config.string()
            << (made.target.empty() ? "" : ", " + made.target.string())
            << "\nnext: " << (made.warnings.empty() ? "heba run " : "heba doctor ") << config.string() << std::endl;
  return kDone;
}

}  // namespace

int RunCommand_init(const std::vector<std::string>& arguments) {
  const fs::path folder = arguments[0];
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw InputError(folder.string() + ": no such folder");
  const fs::path config = FLAGS_out.empty() ? folder / "config.yaml" : fs::path(FLAGS_out);
  RefuseToReplace(config);
  RawFolder given;
  if (!FLAGS_images.empty()) given.images = Existing("images", FLAGS_images);
  if (!FLAGS_poses.empty()) given.poses = Existing("poses", FLAGS_poses);
  if (!FLAGS_camera.empty()) {
    given.camera = Existing("camera", FLAGS_camera);
    ReadCameraFile(*given.camera);  // A fault is reported before a file is written.
  }
  if (!FLAGS_setup.empty()) {
    given.setup = FindSetup(FLAGS_setup);
    if (!given.setup) {
      throw InputError("--setup: " + UnknownName(FLAGS_setup, SetupNames()));
    }
  }
  const bool has_keys = FLAGS_target.find('{') != std::string::npos;
  if (!FLAGS_target.empty() && !has_keys) given.target = Existing("target", FLAGS_target);
  if (const auto* format = FindImportFormat(folder)) {
    if (HasSeveralCameras(folder, *format)) {
      throw InputError(folder.string() + ": is a data set of several cameras of " + std::string(format->name) +
                       "; 'heba import " + folder.string() + " --out DIR' converts it");
    }
    const auto made = WithTarget(config, has_keys ? FLAGS_target + "\n" : "", given, [&](const RawFolder& with_target) {
      return ConfigOfDataSet(folder, with_target, config, NumThreads());
    });
    if (made) return Finish(folder, config, *made);
  }
  RawFolder raw = FindRawFiles(folder, given);
  if (raw.num_images == 0) {
    throw InputError((raw.images.empty() ? folder : raw.images).string() +
                     ": contains no images; name their folder (--images)");
  }
  CheckPoses(folder, raw);
  std::string target_text = has_keys ? FLAGS_target + "\n" : "";
  const bool can_ask = isatty(STDIN_FILENO) == 1;
  if (!can_ask && !raw.target && !has_keys) {
    const std::string seen = TargetSeen(raw.images);
    throw InputError(folder.string() + ": contains no target file; " +
                     (seen.empty()
                          ? "name it (--target TARGET.yaml) or state the keys, such as --target "
                            "'{type: chessboard, rows: 6, columns: 9, square: 25 mm}'"
                          : "the images show --target '" + seen + "': state it with its size in place of SIZE"));
  }
  std::cerr << folder.string() << ": " << raw.num_images << " images in " << raw.images.string() << "\n";
  if (!raw.target && !has_keys) target_text = AskTarget();
  if (can_ask && !raw.setup) {
    const std::string answer = AskChoice(
        "Is the camera fixed (1, eye_to_hand) or carried by the gripper (2, eye_in_hand)? An empty answer leaves it to "
        "the images:",
        SetupNames(), true);
    if (!answer.empty()) raw.setup = FindSetup(answer);
  }
  const auto made = WithTarget(config, target_text, raw, [&](const RawFolder& with_target) {
    return std::optional<RawConfig>(ConfigOf(with_target, config, NumThreads()));
  });
  return Finish(folder, config, *made);
}

}  // namespace heba
