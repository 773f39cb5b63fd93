#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/data/setup.h"
#include "heba/target.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/key_reference.h"
#include "tools/pipeline/cell_init.h"
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

std::string Flag(const std::string& name, const std::string& value) {
  const bool needs_quotes = value.find(' ') != std::string::npos;
  return "--" + name + (value.empty() ? "" : needs_quotes ? " '" + value + "'" : " " + value);
}

// Prints what was written, or why nothing was. Returns the exit status.
int Finish(const InitRequest& request, const RawConfig& made) {
  if (!made.fits) {
    PrintError(request.folder.string() + ": " + WhyNoConfig(made));
    return kWorkFailed;
  }
  std::cout << ForTerminal(RemarksText(made)) << "written: " << request.config.string()
            << (made.target.empty() ? "" : ", " + made.target.string())
            << "\nnext: " << (made.warnings.empty() ? "heba run " : "heba doctor ") << request.config.string()
            << std::endl;
  return kDone;
}

}  // namespace

int RunCommand_init(const std::vector<std::string>& arguments) {
  InitRequest request = RequestOf(
      arguments[0], FLAGS_out, {FLAGS_images, FLAGS_poses, FLAGS_camera, FLAGS_target, FLAGS_setup}, FLAGS_force, Flag);
  if (const std::optional<RawConfig> made = InitDataSet(request, NumThreads())) return Finish(request, *made);
  RawFolder files = FilesToRead(request);
  const bool can_ask = isatty(STDIN_FILENO) == 1;
  if (!can_ask) CheckTarget(request, files, NumThreads());
  std::cerr << request.folder.string() << ": " << files.num_images << " images in " << files.images.string() << "\n";
  if (!files.target && request.target_keys.empty()) request.target_keys = AskTarget();
  if (can_ask && !files.setup) {
    const std::string answer = AskChoice(
        "Is the camera fixed (1, eye_to_hand) or carried by the gripper (2, eye_in_hand)? An empty answer leaves it to "
        "the images:",
        SetupNames(), true);
    if (!answer.empty()) files.setup = FindSetup(answer);
  }
  return Finish(request, InitFolder(request, files, NumThreads()));
}

}  // namespace heba
