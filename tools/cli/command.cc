#include "tools/cli/command.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <new>
#include <optional>

#include <gflags/gflags.h>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/io/result_file.h"
#include "heba/kernels/simd.h"
#include "tools/cli/command_table.h"
#include "tools/cli/flags.h"
#include "tools/cli/manual.h"
#include "tools/text/console.h"

namespace heba {

namespace {

void PrintUsage(std::ostream& stream) {
  stream << "heba " << Version() << ": hand-eye calibration by bundle adjustment\n\n"
         << "usage: heba COMMAND [ARGUMENTS] [--flags]\n\n";
  for (const Command& command : Commands()) {
    const std::string call = command.name + " " + command.arguments;
    stream << "  " << call << std::string(call.size() < 24 ? 24 - call.size() : 1, ' ') << command.summary << "\n";
  }
  stream << "\n'heba COMMAND --help' describes a command and its flags; 'heba help TOPIC' prints one of these:\n\n";
  for (const ManualTopic& topic : ManualTopics()) stream << "  " << PadRight(topic.name, 23) << topic.summary << "\n";
}

// A word that begins with a hyphen: the name of its flag, and its value if the word contains it.
struct FlagWord {
  std::string name;
  std::optional<std::string> value;
};

// Reads --name, --name=VALUE, the same with one hyphen, and the short forms -o, -oVALUE and -o=VALUE.
FlagWord ReadFlagWord(const Command& command, const std::string& word) {
  const auto takes = [&](const std::string& name) {
    return std::find(command.flags.begin(), command.flags.end(), name) != command.flags.end();
  };
  const size_t dashes = word[1] == '-' ? 2 : 1;
  const size_t equals = word.find('=');
  FlagWord read{word.substr(dashes, equals == std::string::npos ? std::string::npos : equals - dashes), {}};
  if (equals != std::string::npos) read.value = word.substr(equals + 1);
  const std::string of_letter = dashes == 1 ? FlagOfLetter(word[1]) : "";
  if (takes(read.name) || !takes(of_letter)) return read;
  const std::string rest = word.substr(2);
  if (!rest.empty() && FlagOf(of_letter).type == "bool") {
    throw InputError("-" + std::string(1, word[1]) + " takes no value, not '" + rest + "'");
  }
  if (rest.empty()) return {of_letter, {}};
  return {of_letter, rest[0] == '=' ? rest.substr(1) : rest};
}

// Sets the flags in `words` and returns the other words. Names and values are checked here first, because gflags keeps
// one registry for the whole program, with glog's flags in it, and ends the program on an error.
std::vector<std::string> ParseFlags(const Command& command, const std::vector<std::string>& words) {
  std::vector<std::string> arguments;
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--") {
      arguments.insert(arguments.end(), words.begin() + static_cast<std::ptrdiff_t>(i) + 1, words.end());
      break;
    }
    if (word.size() < 2 || word[0] != '-') {
      arguments.push_back(word);
      continue;
    }
    const auto& [name, given] = ReadFlagWord(command, word);
    if (std::find(command.flags.begin(), command.flags.end(), name) == command.flags.end()) {
      throw InputError(
          "'heba " + command.name + "' has no flag --" + name + DidYouMean(name, command.flags) +
          (DidYouMean(name, command.flags).empty() ? "; 'heba " + command.name + " --help' lists them" : ""));
    }
    gflags::CommandLineFlagInfo info;
    CHECK(gflags::GetCommandLineFlagInfo(FlagVariable(name).c_str(), &info)) << name;
    std::string value;
    if (given) {
      value = *given;
    } else if (info.type == "bool") {
      value = "true";
    } else if (i + 1 < words.size() && !words[i + 1].starts_with("--")) {
      value = words[++i];
    } else {
      throw InputError("--" + name + " needs a value");
    }
    double number = 0;
    const bool is_number = ParseDouble(value, &number);
    if ((info.type == "int32" && (!is_number || number != std::floor(number) || std::abs(number) > 1e9)) ||
        (info.type == "double" && !is_number)) {
      throw InputError("--" + name + " needs a " + (info.type == "int32" ? "whole number" : "number") + ", not '" +
                       value + "'");
    }
    // 1e3 is a whole number too, but gflags cannot parse it.
    if (info.type == "int32") value = std::to_string(std::llround(number));
    if (info.type == "bool" && value != "true" && value != "false") {
      throw InputError("--" + name + " must be true or false, not '" + value + "'");
    }
    constexpr std::string_view kRepeatable = "set";
    if (name == kRepeatable && !info.current_value.empty()) value = info.current_value + kSettingSeparator + value;
    if (info.type == "string" && value.empty()) throw InputError("--" + name + " needs a value");
    CHECK(!gflags::SetCommandLineOption(FlagVariable(name).c_str(), value.c_str()).empty());
  }
  return arguments;
}

int Dispatch(const std::vector<std::string>& words) {
  if (words.empty() || words[0] == "help" || words[0] == "--help" || words[0] == "-h") {
    if (words.size() > 1 && words[0] == "help") {
      const ManualTopic* const topic = FindEntry(ManualTopics(), words[1]);
      if (topic == nullptr) {
        if (FindEntry(Commands(), words[1]) != nullptr) return Dispatch({words[1], "--help"});
        const std::vector<std::string> names = NamesOf(ManualTopics());
        std::vector<std::string> known = NamesOf(Commands());
        known.insert(known.end(), names.begin(), names.end());
        throw InputError("'" + words[1] + "' is neither a command nor a topic" + DidYouMean(words[1], known) +
                         "; topics: " + Join(names, ", "));
      }
      std::cout << topic->text(std::vector<std::string>(words.begin() + 2, words.end()));
      return kDone;
    }
    PrintUsage(std::cout);
    return kDone;
  }
  if (words[0] == "--version") {
    const std::string_view commit = HEBA_COMMIT;
    std::cout << "heba " << Version() << (commit.empty() ? "" : " (" + std::string(commit) + ")") << "\n";
    return kDone;
  }
  const Command* command = FindEntry(Commands(), words[0]);
  if (command == nullptr) {
    const std::vector<std::string> names = NamesOf(Commands());
    throw InputError("'" + words[0] + "' is not a command" + DidYouMean(words[0], names) +
                     "; one of: " + Join(names, ", "));
  }
  const std::vector<std::string> rest(words.begin() + 1, words.end());
  if (std::any_of(rest.begin(), rest.end(), [](const std::string& word) { return word == "--help" || word == "-h"; })) {
    std::cout << CommandHelp(*command);
    return kDone;
  }
  const std::vector<std::string> arguments = ParseFlags(*command, rest);
  const bool takes_many = command->arguments.find("...") != std::string::npos;
  const std::vector<std::string> forms = Split(command->arguments, ' ');
  const auto num_optional =
      std::count_if(forms.begin(), forms.end(), [](const std::string& form) { return form.starts_with("["); });
  const size_t num_needed = forms.size() - static_cast<size_t>(num_optional);
  if (arguments.size() < num_needed || (!takes_many && arguments.size() > forms.size())) {
    const std::string line = "heba " + command->name + " " + command->arguments;
    if (arguments.empty()) {
      throw InputError(forms[0] + " is missing: " + line + "; 'heba help " + command->name + "' explains it" +
                       (forms[0].starts_with("CONFIG") ? ", and 'heba init FOLDER' writes a config" : ""));
    }
    throw InputError("'heba " + command->name + "' takes " + command->arguments + ", not " +
                     std::to_string(arguments.size()) + (arguments.size() == 1 ? " argument" : " arguments"));
  }
  return command->run(arguments);
}

}  // namespace

int RunCommandLine(int argc, char** argv) {
  try {
    if (const std::string fault = FaultOfSimdSetting(); !fault.empty()) throw InputError(fault);
    const int status = Dispatch(std::vector<std::string>(argv + 1, argv + argc));
    // A result that could not be written counts as a failure.
    std::cout.flush();
    if (std::cout && std::fflush(stdout) == 0) return status;
    PrintError("standard output cannot be written");
    return kWorkFailed;
  } catch (const OutputError& error) {
    PrintError(error.what());
    return kWorkFailed;
  } catch (const InputError& error) {
    PrintError(error.what());
    return kInputWrong;
  } catch (const std::filesystem::filesystem_error& error) {
    // The file system rejects the path itself, for example because it is too long.
    PrintError(Quoted(error.path1().string()) + ": " + error.code().message());
    return kInputWrong;
  } catch (const std::bad_alloc&) {
    PrintError("out of memory");
    return kWorkFailed;
  } catch (const std::exception& error) {
    PrintError(std::string("unexpected: ") + error.what());
    return kWorkFailed;
  }
}

}  // namespace heba
