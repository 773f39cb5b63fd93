// Texts that are made from the table of the commands: manual pages and completions of shells.
#pragma once

#include <string>
#include <vector>

namespace heba {

// A topic of `heba help` that is no command.
struct ManualTopic {
  std::string name;
  // Returns the text. Throws InputError if the topic has no such arguments.
  std::string (*text)(const std::vector<std::string>& arguments);
};

// Returns the topics: `man` (a manual page in roff: heba(1), or that of a command, heba-COMMAND(1)), and `bash` and
// `zsh` (the completion of that shell).
const std::vector<ManualTopic>& ManualTopics();

}  // namespace heba
