#include "tools/config/commented_config.h"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "tools/config/key_reference.h"

namespace heba {
namespace {

// The keys that are shown without a value.
constexpr std::string_view kShown[] = {"setup",
                                       "target",
                                       "camera.model",
                                       "camera.intrinsics",
                                       "captures.images",
                                       "captures.poses",
                                       "captures.pose_format",
                                       "captures.exclude",
                                       "robot.model",
                                       "refine.intrinsics",
                                       "refine.target_shape",
                                       "refine.robot_noise",
                                       "evaluate.folds",
                                       "evaluate.require[].within",
                                       "output"};

constexpr size_t kWidth = 100;

// Returns a text as comment lines of at most kWidth characters.
std::string Comment(const std::string& text, const std::string& indent) {
  std::string comment;
  std::string line;
  for (const std::string& word : Split(text, ' ')) {
    if (!line.empty() && indent.size() + 3 + line.size() + word.size() > kWidth) {
      comment += indent + "# " + line + "\n";
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
  }
  return comment + indent + "# " + line + "\n";
}

}  // namespace

std::string CommentedConfig(const std::map<std::string, std::string>& values, const std::vector<std::string>& remarks) {
  std::string text = Comment(
      "A run config of heba; 'heba help config' describes all keys. Lines that begin with # are "
      "comments; a key in a comment shows its default, or what can be written.",
      "");
  for (const std::string& remark : remarks) text += Comment(remark, "");
  std::string mapping;
  size_t num_set = 0;
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.document != "config") continue;
    const auto value = values.find(entry.key);
    const bool is_set = value != values.end();
    if (!is_set && std::find(std::begin(kShown), std::end(kShown), entry.key) == std::end(kShown)) continue;
    num_set += is_set ? 1 : 0;
    const size_t point = entry.key.find('.');
    std::string inside = point == std::string::npos ? "" : entry.key.substr(0, point);
    std::string name = entry.key.substr(inside.empty() ? 0 : point + 1);
    std::string shown = is_set ? value->second : entry.HasDefault() ? entry.fallback : entry.value;
    // The items of a list are shown as one item with its first key.
    if (const size_t item = name.find("[]."); item != std::string::npos) {
      shown = "[{" + name.substr(item + 3) + ": " + shown + "}]";
      name = name.substr(0, item);
    }
    // The other mappings may be empty.
    if (inside == "robot" && !is_set) {
      shown = "{" + name + ": " + shown + "}";
      name = std::exchange(inside, "");
    }
    text += inside == mapping && !inside.empty() ? "" : "\n";
    if (inside != mapping && !inside.empty()) text += inside + ":\n";
    mapping = inside;
    const std::string indent = inside.empty() ? "" : "  ";
    text += Comment(entry.meaning, indent) + indent + (is_set ? "" : "# ") + name + ": " + shown + "\n";
  }
  CHECK_EQ(num_set, values.size()) << "a value belongs to no key";
  return text;
}

}  // namespace heba
