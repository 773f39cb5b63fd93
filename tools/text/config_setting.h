// A setting of the config that cures a fault: for people as text, for programs as key and value.
#pragma once

#include <string>
#include <vector>

#include "heba/base/text.h"

namespace heba {

struct ConfigSetting {
  // From the root of the config, such as refine.robot_noise: a key of --set.
  std::string key;
  std::string value;  // In YAML.

  bool operator==(const ConfigSetting&) const = default;
};

// Formats settings as in a config: "captures.robot: ur5, captures.joint_angles: deg".
inline std::string SettingsText(const std::vector<ConfigSetting>& settings) {
  std::vector<std::string> texts;
  for (const ConfigSetting& setting : settings) texts.push_back(setting.key + ": " + setting.value);
  return Join(texts, ", ");
}

}  // namespace heba
