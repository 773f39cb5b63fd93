#include "tools/config/commented_config.h"

#include <string_view>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "tools/config/key_reference.h"

namespace heba {
namespace {

// A key that is shown in a comment if it is not set. It can be read when the comment becomes a line of the config.
struct ShownKey {
  std::string_view name;
  std::string_view example;  // Empty: the default is shown.
};
constexpr ShownKey kShown[] = {{"setup", "eye_to_hand  # or eye_in_hand"},
                               {"target", "target.yaml"},
                               {"camera.model", ""},
                               {"camera.intrinsics", "camera.yaml"},
                               {"captures.images", "images"},
                               {"captures.poses", "poses.csv"},
                               {"captures.pose_format", ""},
                               {"captures.exclude", "[000.png]"},
                               {"robot.model", "ur5e"},
                               {"refine.intrinsics", ""},
                               {"refine.target_shape", ""},
                               {"refine.robot_noise", ""},
                               {"evaluate.folds", ""},
                               {"evaluate.require[].within", "1 mm"},
                               {"output", "runs/cell"}};

constexpr size_t kWidth = 100;
constexpr std::string_view kFirstWords = "A run config of heba";

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

bool IsCommentedConfig(const std::string& text) { return text.starts_with("# " + std::string(kFirstWords)); }

std::string CommentedConfig(const std::map<std::string, std::string>& values, const std::vector<std::string>& remarks) {
  std::string text = Comment(std::string(kFirstWords) +
                                 "; 'heba help config' describes all keys. Lines that begin with # are comments; a key "
                                 "in a comment shows its default, or an example if it has none.",
                             "");
  for (const std::string& remark : remarks) text += Comment(remark, "");
  std::string mapping;
  size_t num_set = 0;
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.document != "config") continue;
    const auto value = values.find(entry.key);
    const bool is_set = value != values.end();
    const ShownKey* const example = FindEntry(kShown, entry.key);
    if (!is_set && example == nullptr) continue;
    num_set += is_set ? 1 : 0;
    const size_t point = entry.key.find('.');
    std::string inside = point == std::string::npos ? "" : entry.key.substr(0, point);
    std::string name = entry.key.substr(inside.empty() ? 0 : point + 1);
    const bool has_value = entry.HasDefault() && !entry.is_described;
    CHECK(is_set || has_value == example->example.empty()) << entry.key;
    std::string shown = is_set ? value->second : has_value ? entry.fallback : std::string(example->example);
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
