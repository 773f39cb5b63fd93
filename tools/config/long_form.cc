#include "tools/config/long_form.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {

bool HasLongForm(const ConfigValue& value) {
  if (!value.IsMap()) return false;
  MapReader reader(value);
  return reader.Has("cameras") || reader.Has("targets") || reader.Has("robots");
}

std::vector<std::string> NamesIn(MapReader& reader, const std::string& example) {
  const ConfigValue& section = reader.value();
  if (!section.IsMap()) section.Fail("a mapping of names is needed, such as {" + example + ": {...}}");
  // The names of the lowest layer come first; a layer above may remove one.
  std::vector<std::string> names;
  const std::vector<ConfigValue> layers = section.Layers();
  for (auto place = layers.rbegin(); place != layers.rend(); ++place) {
    const ConfigValue& layer = *place;
    for (const auto& entry : layer.node()) {
      const std::string name = entry.first.Scalar();
      const bool is_plain = std::all_of(name.begin(), name.end(),
                                        [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
      if (name.empty() || !is_plain) layer.Fail(Quoted(name) + ": a name has letters, digits, _ and - only");
      const bool is_known = std::find(names.begin(), names.end(), name) != names.end();
      if (!is_known && reader.Has(name)) names.push_back(name);
    }
  }
  if (names.empty()) section.Fail("a mapping of names is needed, such as {" + example + ": {...}}");
  std::map<std::string, std::string> name_of;
  for (const std::string& name : names) {
    std::string frame = name;
    std::replace(frame.begin(), frame.end(), '-', '_');
    const auto [other, is_new] = name_of.emplace(frame, name);
    if (is_new) continue;
    reader.Get(name).Fail("differs from " + other->second +
                          " by - and _ only, and frames of ROS have no -; rename one");
  }
  return names;
}

std::vector<std::string> CameraNamesIn(MapReader& reader) {
  const std::vector<std::string> names = NamesIn(reader, "top");
  for (const auto& [taken, file] : {std::pair{"config", "of the config of a simulated data set"},
                                    std::pair{"cameras", "of exports of all cameras"}}) {
    if (std::find(names.begin(), names.end(), taken) == names.end()) continue;
    reader.Get(taken).Fail(std::string("a camera cannot have this name, which is that ") + file + "; rename it");
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
