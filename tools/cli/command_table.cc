#include "tools/cli/command_table.h"

#include <algorithm>
#include <array>
#include <utility>

#include <gflags/gflags.h>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {

#define HEBA_COMMAND(name, arguments, flags, summary) int RunCommand_##name(const std::vector<std::string>& arguments_);
#include "tools/cli/commands.def"
#undef HEBA_COMMAND

namespace {

constexpr std::array<std::pair<char, std::string_view>, 3> kLetters = {{{'o', "out"}, {'j', "jobs"}, {'q', "quiet"}}};

std::vector<std::string> WordsOf(const std::string& text) {
  return text.empty() ? std::vector<std::string>() : Split(text, ' ');
}

}  // namespace

const std::vector<Command>& Commands() {
  static const std::vector<Command> commands = {
#define HEBA_COMMAND(name, arguments, flags, summary) {#name, arguments, WordsOf(flags), summary, &RunCommand_##name},
#include "tools/cli/commands.def"
#undef HEBA_COMMAND
  };
  return commands;
}

std::string FlagVariable(std::string name) {
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

bool IsFlagGiven(const std::string& name) {
  gflags::CommandLineFlagInfo info;
  CHECK(gflags::GetCommandLineFlagInfo(FlagVariable(name).c_str(), &info)) << name;
  return !info.is_default;
}

CommandFlag FlagOf(const std::string& name, const std::string& command) {
  gflags::CommandLineFlagInfo info;
  CHECK(gflags::GetCommandLineFlagInfo(FlagVariable(name).c_str(), &info)) << name;
  const std::vector<std::string> parts = Split(info.description, '|');
  CHECK(parts.size() >= 2) << name;
  CommandFlag flag{name, info.type, parts[0], parts[1]};
  for (size_t i = 2; i < parts.size(); ++i) {
    const size_t colon = parts[i].find(": ");
    CHECK(colon != std::string::npos) << name;
    if (parts[i].substr(0, colon) == command) flag.text = parts[i].substr(colon + 2);
  }
  for (const auto& [letter, of] : kLetters) {
    if (of == name) flag.letter = letter;
  }
  return flag;
}

std::string FlagOfLetter(char letter) {
  for (const auto& [other, name] : kLetters) {
    if (other == letter) return std::string(name);
  }
  return "";
}

std::string FlagForm(const CommandFlag& flag) {
  const std::string letter = flag.letter == 0 ? "" : std::string("-") + flag.letter + ", ";
  return Trim(letter + "--" + flag.name + " " + flag.value);
}

}  // namespace heba
