// The table of the commands and of their flags, from which the help, the manual pages and the completions are made.
#pragma once

#include <string>
#include <vector>

namespace heba {

struct CommandFlag {
  std::string name;   // Without hyphens before it.
  std::string type;   // gflags' type: bool, string, int32 or double.
  std::string value;  // The kind of value that it takes, such as PATH; empty if it takes none.
  std::string text;
  char letter = 0;  // The short form, such as o for -o; 0 if there is none.
};

struct Command {
  std::string name;
  std::string arguments;
  std::vector<std::string> flags;  // Their names.
  std::string summary;
  int (*run)(const std::vector<std::string>& arguments);
};

// Returns all commands, in the order of commands.def.
const std::vector<Command>& Commands();

// Returns gflags' own name of a flag: that of a variable, without hyphens.
std::string FlagVariable(std::string name);
// Returns whether a flag is on the command line, if only with its default.
bool IsFlagGiven(const std::string& name);
// Returns a flag with its text for a command; with its general text if there is no command or none of its own.
CommandFlag FlagOf(const std::string& name, const std::string& command = "");
// Returns the name of the flag with this short form; empty if there is none.
std::string FlagOfLetter(char letter);
// Returns the forms of a flag with its value, such as "-o, --out PATH".
std::string FlagForm(const CommandFlag& flag);

}  // namespace heba
