#include "tools/cli/manual.h"

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/io/result_file.h"
#include "tools/cli/command_table.h"
#include "tools/config/key_reference.h"
#include "tools/text/console.h"

namespace heba {
namespace {

// Returns a text as roff shows it as it stands.
std::string Roff(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else {
      escaped += c;
    }
  }
  // A line that begins with a point or an apostrophe would be a request.
  const bool is_request = !escaped.empty() && (escaped[0] == '.' || escaped[0] == '\'');
  return is_request ? "\\&" + escaped : escaped;
}

std::string PageHead(const std::string& name, const std::string& summary) {
  std::string capitals = name;
  for (char& c : capitals) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return ".TH " + Roff(capitals) + " 1 \"\" \"heba " + Version() + "\" \"heba manual\"\n.SH NAME\n" + Roff(name) +
         " \\- " + Roff(summary) + "\n.SH SYNOPSIS\n";
}

std::string ExitStatus() {
  return ".SH EXIT STATUS\n0: done. 1: the work failed, or its result cannot be trusted. 2: the input is wrong.\n";
}

std::string ProgramPage() {
  std::string page = PageHead("heba", "hand-eye calibration by bundle adjustment") +
                     ".B heba\n.I COMMAND\n[\\fIARGUMENTS\\fR] [\\fB\\-\\-flags\\fR]\n.SH COMMANDS\n";
  for (const Command& command : Commands()) {
    page += ".TP\n.B " + Roff(command.name) + " \\fR\\fI" + Roff(command.arguments) + "\\fR\n" + Roff(command.summary) +
            "; see \\fBheba\\-" + Roff(command.name) + "\\fR(1)\n";
  }
  return page + ExitStatus();
}

std::string CommandPage(const Command& command) {
  std::string page = PageHead("heba-" + command.name, command.summary) + ".B heba " + Roff(command.name) + "\n.I " +
                     Roff(command.arguments) + "\n[\\fB\\-\\-flags\\fR]\n";
  if (!command.flags.empty()) page += ".SH OPTIONS\n";
  for (const std::string& name : command.flags) {
    const CommandFlag flag = FlagOf(name, command.name);
    page += ".TP\n.B " + Roff(FlagForm(flag)) + "\n" + Roff(flag.text) + "\n";
  }
  return page + ExitStatus() + ".SH SEE ALSO\n.BR heba (1)\n";
}

std::string ManPage(const std::vector<std::string>& arguments) {
  if (arguments.empty()) return ProgramPage();
  const Command* const command = FindEntry(Commands(), arguments[0]);
  if (command == nullptr) {
    throw InputError("'" + arguments[0] + "' is not a command" + DidYouMean(arguments[0], NamesOf(Commands())));
  }
  return CommandPage(*command);
}

// Returns the long and short forms of a command's flags.
std::vector<std::string> FormsOf(const Command& command) {
  std::vector<std::string> forms = {"--help"};
  for (const std::string& name : command.flags) {
    forms.push_back("--" + name);
    if (const char letter = FlagOf(name).letter; letter != 0) forms.push_back(std::string("-") + letter);
  }
  return forms;
}

std::string BashCompletion(const std::vector<std::string>& /*arguments*/) {
  std::string text =
      "# Completion of heba for bash.\n"
      "_heba() {\n"
      "  local word=${COMP_WORDS[COMP_CWORD]} words\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
      "    words=\"help --help --version " +
      Join(NamesOf(Commands()), " ") +
      "\"\n"
      "  else\n"
      "    case ${COMP_WORDS[1]} in\n";
  for (const Command& command : Commands()) {
    text += "      " + command.name + ") words=\"" + Join(FormsOf(command), " ") + "\" ;;\n";
  }
  text += "      help) words=\"" + Join(NamesOf(Commands()), " ") + " " + Join(NamesOf(ManualTopics()), " ") +
          "\" ;;\n"
          "    esac\n"
          "  fi\n"
          "  # Files are completed unless a flag was begun.\n"
          "  if [ \"$COMP_CWORD\" -gt 1 ] && [ \"${COMP_WORDS[1]}\" != help ] && [[ $word != -* ]]; then\n"
          "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
          "    compopt -o filenames 2>/dev/null\n"
          "  else\n"
          "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
          "  fi\n"
          "}\n"
          "complete -F _heba heba\n";
  return text;
}

// Returns a text within single quotes of zsh, in which a specification of _arguments or _describe keeps its colons.
std::string ZshText(const std::string& text) {
  std::string quoted;
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else if (c == ':' || c == '[' || c == ']') {
      quoted += std::string("\\") + c;
    } else {
      quoted += c;
    }
  }
  return quoted;
}

std::string ZshCompletion(const std::vector<std::string>& /*arguments*/) {
  std::string text = "#compdef heba\n# Completion of heba for zsh.\n_heba() {\n  local -a commands=(\n";
  for (const Command& command : Commands()) {
    text += "    '" + command.name + ":" + ZshText(command.summary) + "'\n";
  }
  text +=
      "  )\n"
      "  if (( CURRENT == 2 )); then\n"
      "    _describe command commands\n"
      "    return\n"
      "  fi\n"
      "  local command=$words[2]\n"
      "  shift words\n"
      "  (( CURRENT-- ))\n"
      "  case $command in\n";
  for (const Command& command : Commands()) {
    text += "    " + command.name + ")\n      _arguments";
    for (const std::string& name : command.flags) {
      const CommandFlag flag = FlagOf(name, command.name);
      const std::string value = flag.value.empty() ? "" : ":" + ZshText(flag.value) + ":_files";
      const std::string explained = "[" + ZshText(flag.text) + "]" + value + "'";
      text += " \\\n        '--" + name + (flag.value.empty() ? "" : "=") + explained;
      if (flag.letter != 0) text += " \\\n        '-" + std::string(1, flag.letter) + explained;
    }
    text += " \\\n        '*:file:_files'\n      ;;\n";
  }
  return text + "  esac\n}\n_heba \"$@\"\n";
}

std::string Keys(std::string_view document, const std::vector<std::string>& arguments) {
  return ForTerminal(KeysAsText(*FindEntry(KeyDocuments(), document), arguments.empty() ? "" : arguments[0]));
}

// The keys of a study follow the help of the command with this name.
std::string StudyKeys(const std::vector<std::string>& arguments) {
  return (arguments.empty() ? CommandHelp(*FindEntry(Commands(), "study")) + "\n" : "") + Keys("study", arguments);
}

}  // namespace

std::string CommandHelp(const Command& command) {
  std::string text =
      "usage: heba " + command.name + " " + command.arguments + " [--flags]\n\n" + command.summary + "\n\n";
  for (const std::string& name : command.flags) {
    const CommandFlag flag = FlagOf(name, command.name);
    text += ForTerminal("  " + PadRight(FlagForm(flag), 21) + " " + flag.text + "\n");
  }
  return text;
}

const std::vector<ManualTopic>& ManualTopics() {
  using Words = std::vector<std::string>;
  static const std::vector<ManualTopic> topics = {
      {"config", "the keys of a run config", [](const Words& words) { return Keys("config", words); }},
      {"poses", "the formats of robot poses", [](const Words& words) { return Keys("poses", words); }},
      {"targets", "the keys of a target", [](const Words& words) { return Keys("targets", words); }},
      {"camera", "the keys of a camera file", [](const Words& words) { return Keys("camera", words); }},
      {"scene", "the keys of a scene", [](const Words& words) { return Keys("scene", words); }},
      {"study", "the keys of a study", &StudyKeys},
      {"rig", "the keys of the config of a rig", [](const Words& words) { return Keys("rig", words); }},
      {"rig_scene", "the keys of a scene with a rig", [](const Words& words) { return Keys("rig_scene", words); }},
      {"reference", "all keys as a page in Markdown", [](const Words& /*words*/) { return KeysAsMarkdown(); }},
      {"man", "a manual page in roff", &ManPage},
      {"bash", "the completion of bash", &BashCompletion},
      {"zsh", "the completion of zsh", &ZshCompletion}};
  return topics;
}

}  // namespace heba
