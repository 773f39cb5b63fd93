#include "tools/text/arm_keys.h"

#include <cctype>
#include <string_view>

namespace heba {
namespace {

constexpr std::string_view kKeysOfRobot[] = {"model",   "base_link", "tip_link",   "kinematics",
                                             "payload", "tool",      "joints_near"};
constexpr std::string_view kKeysOfCaptures[] = {"joints", "joint_angle"};

bool IsInKey(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-'; }

// Returns whether a key of this length at `at` is one by itself, not a part of a longer one.
bool IsWhole(const std::string& text, size_t at, size_t length) {
  if (at > 0 && (IsInKey(text[at - 1]) || text[at - 1] == '.')) return false;
  return at + length == text.size() || !IsInKey(text[at + length]);
}

}  // namespace

std::vector<std::pair<std::string, std::string>> ArmKeys(const std::string& section) {
  if (section == "captures") return {};
  std::vector<std::pair<std::string, std::string>> keys;
  for (const std::string_view key : kKeysOfRobot) {
    keys.emplace_back("robot." + std::string(key), section + "." + std::string(key));
  }
  for (const std::string_view key : kKeysOfCaptures) {
    keys.emplace_back("captures." + std::string(key), section + "." + std::string(key));
  }
  return keys;
}

std::string WithArmKeys(const std::string& text, const std::string& robot) {
  if (robot == kOnlyArm) return text;
  std::string replaced = text;
  for (const auto& [key, of_rig] : ArmKeys("robots." + robot)) {
    for (size_t at = replaced.find(key); at != std::string::npos; at = replaced.find(key, at + 1)) {
      if (IsWhole(replaced, at, key.size())) replaced.replace(at, key.size(), of_rig);
    }
  }
  return replaced;
}

}  // namespace heba
