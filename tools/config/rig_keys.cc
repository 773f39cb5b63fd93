#include "tools/config/rig_keys.h"

#include <algorithm>
#include <cctype>

#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {

bool HasRigKeys(const ConfigValue& value) {
  if (!value.IsMap()) return false;
  MapReader reader(value);
  return reader.Has("cameras") || reader.Has("targets") || reader.Has("robots");
}

std::vector<std::string> NamesIn(const ConfigValue& section, const std::string& example) {
  if (!section.IsMap() || section.node().size() == 0) {
    section.Fail("a mapping of names is needed, such as {" + example + ": {...}}");
  }
  std::vector<std::string> names;
  for (const auto& entry : section.node()) {
    const std::string name = entry.first.Scalar();
    const bool is_plain = std::all_of(name.begin(), name.end(),
                                      [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
    if (name.empty() || !is_plain) section.Fail(Quoted(name) + ": a name has letters, digits, _ and - only");
    names.push_back(name);
  }
  return names;
}

std::pair<Mount, std::string> ReadMount(MapReader& reader, const std::vector<std::string>& robots) {
  const ConfigValue value = reader.Get("mount");
  const std::string text = value.AsText();
  const std::optional<Mount> mount = FindMount(robots, text);
  if (!mount) value.Fail(UnknownName(text, MountTexts(robots)));
  reader.Record("mount", YAML::Node(text));
  return {*mount, text};
}

}  // namespace heba
