// Makes a config of a folder of images and poses, such as a user has after recording.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tools/doctor/raw_folder.h"

namespace heba {

struct InitRequest {
  std::filesystem::path folder;
  std::filesystem::path config;  // The file to write.
  RawFolder given;               // The statements of the user, whose files exist.
  std::string target_keys;       // The YAML of the target if the user states no file of it.
  bool replaces_own = false;     // Whether a config that was made in this way may be replaced.
  // Returns how the user states an option, for messages: "--target TARGET.yaml".
  std::string (*option)(const std::string& name, const std::string& value) = nullptr;
};

// A user states these things about a folder as text. A text is empty if the user does not state it.
struct StatedFiles {
  std::string images;
  std::string poses;
  std::string camera;
  std::string target;  // A file, or the keys of the target, in which there is a brace.
  std::string setup;
};

// Returns the request for a folder; `config` is by default config.yaml in it. Throws InputError if the folder or a file
// does not exist, if the camera cannot be read, or if the config exists and may not be replaced.
InitRequest RequestOf(const std::filesystem::path& folder, const std::filesystem::path& config,
                      const StatedFiles& stated, bool replaces_own, decltype(InitRequest::option) option);

// Makes and writes the config of a folder that is a data set of another project (ConfigOfDataSet), with the file of the
// target if its keys are stated; writes nothing if the config does not fit. Returns nothing if the folder is no such
// data set. Throws InputError if it is one of several cameras.
std::optional<RawConfig> InitDataSet(const InitRequest& request, int num_threads);

// Returns the files of any other folder. Throws InputError if it has no images or no poses.
RawFolder FilesToRead(const InitRequest& request);

// Throws InputError if the target is neither stated nor among the files; the error says which target the images show.
void CheckTarget(const InitRequest& request, const RawFolder& files, int num_threads);

// Makes and writes the config of a folder with these files, as InitDataSet.
RawConfig InitFolder(const InitRequest& request, const RawFolder& files, int num_threads);

// Returns why no config was written, as one line; empty if one was.
std::string WhyNoConfig(const RawConfig& made);

}  // namespace heba
