// Texts that are made from the tables of commands and keys: help, manual pages and completions of shells.
#pragma once

#include <string>
#include <vector>

#include "tools/cli/command_table.h"

namespace heba {

// Returns what `heba COMMAND --help` prints.
std::string CommandHelp(const Command& command);

// A topic of `heba help`.
struct ManualTopic {
  std::string name;
  std::string summary;
  // Returns the text. Throws InputError if the topic has no such arguments.
  std::string (*text)(const std::vector<std::string>& arguments);
};

// Returns the topics: the keys of the files that people write (with an argument, one of them), `man` (heba(1), or the
// page of a command, heba-COMMAND(1)), and the completions of shells.
const std::vector<ManualTopic>& ManualTopics();

}  // namespace heba
