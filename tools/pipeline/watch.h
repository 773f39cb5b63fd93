// `heba watch`: calibrates again whenever a capture has come, and says what is known and what to take next.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heba {

struct WatchOptions {
  std::filesystem::path output;       // Empty: that of the config.
  std::vector<std::string> settings;  // Values of --set.
  int num_threads = 1;
};

// Follows the images and the poses of a run's config until the requirements of the config are met: whenever the system
// reports a change, and several times a second, which file systems of any kind support. A capture counts when its image
// and its pose are there, and when the image is complete. The run's folder holds the latest result, and watch.html
// beside its report reloads itself. Throws InputError if the config itself is wrong; images and poses that are missing
// or not complete are waited for.
void Watch(const std::string& config_path, const WatchOptions& options);

}  // namespace heba
