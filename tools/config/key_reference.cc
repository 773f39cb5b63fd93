#include "tools/config/key_reference.h"

#include <algorithm>
#include <iterator>
#include <type_traits>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/camera/camera_model.h"
#include "heba/data/setup.h"
#include "heba/data/target_shape.h"
#include "heba/io/import.h"
#include "heba/io/pose_formats.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/ur_kinematics.h"
#include "heba/run_types.h"
#include "heba/target.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/residuals/loss.h"
#include "solvers/study/study_cell.h"
#include "tools/run/arm_setup.h"

namespace heba {
namespace {

template <class Names>
requires(!std::is_convertible_v<const Names&, std::string>) std::string OneOf(const Names& names) {
  return Join(std::vector<std::string>(std::begin(names), std::end(names)), " | ");
}

template <class... Names>
requires(std::is_convertible_v<Names, const char*>&&...) std::string OneOf(Names... names) {
  return OneOf(std::vector<std::string>{names...});
}

std::vector<std::string> With(std::vector<std::string> names, std::string_view last) {
  names.emplace_back(last);
  return names;
}

std::vector<std::string> WithAuto(std::vector<std::string> names) {
  names.insert(names.begin(), "auto");
  return names;
}

std::vector<std::string> PoseFormatNamesAndJoints() { return With(PoseFormatNames(), "joints"); }

// A default in words.
struct Described {
  explicit Described(std::string default_words) : words(std::move(default_words)) {}
  std::string words;
};

KeyEntry EntryOf(std::string_view document, std::string key, std::string value, std::string fallback,
                 std::string meaning) {
  return {document, std::move(key), std::move(value), std::move(fallback), std::move(meaning)};
}
KeyEntry EntryOf(std::string_view document, std::string key, std::string value, Described fallback,
                 std::string meaning) {
  return {document,
          std::move(key),
          std::move(value),
          std::move(fallback.words),
          std::move(meaning),
          /*is_described=*/true};
}

constexpr char kUnits[] =
    "A length or an angle has its unit: 40 mm, 0.04 m, 5 deg, 0.1 rad, 0.3 px. Relative paths refer to the file that "
    "contains them. Unknown keys are errors.";
constexpr char kPose[] =
    "A pose is a mapping: translation, three lengths; and rotation, a quaternion [x, y, z, w], or rpy, three angles "
    "with R = Rz(y) Ry(p) Rx(r). Without either, the rotation is the identity.";

// Returns the formats of pose files with their columns and units.
std::string PoseFormatList() {
  std::string text;
  for (const std::string& name : PoseFormatNames()) {
    const PoseFormat format = *FindPoseFormat(name);
    const bool is_matrix = format.columns.size() == 16;
    text += "\n- " + name + ": columns " +
            (is_matrix ? format.columns.front() + " to " + format.columns.back() + ", row by row"
                       : Join(format.columns, ", ")) +
            "; " + format.translation_unit + (format.angle_unit.empty() ? "" : " and " + format.angle_unit) + "; " +
            format.rotation;
  }
  return text + "\n- joints: columns j1, j2, ..., or the names of the joints of a URDF; needs captures.robot\n";
}

std::string ConfigIntroduction() {
  return std::string("The config of `heba run`, `heba detect` and `heba doctor`. ") + kUnits + " " + kPose +
         " `--set refine.loss=none` sets a key on the command line.\n";
}

std::string PosesIntroduction() {
  return "A file of robot poses has a row for each capture. Columns are separated by commas, semicolons, tabs or "
         "blanks; brackets around a row, as in p[...], are ignored. A header names the columns; without a header, the "
         "format must be a mapping. The column image has the name of the image; without it, the rows are in the "
         "sorted order of the images. These formats have names:\n" +
         PoseFormatList() +
         "\nEvery other format is a mapping as captures.pose_format, such as {columns: [x, y, z, a, b, c], "
         "translation: mm, rotation: euler_zyx, angle: deg}.\n";
}

std::string TargetsIntroduction() {
  return std::string("The target: the value of `target` in a config, or a file of its own. Its types are:\n") +
#define HEBA_TARGET(type, description) "\n- " #type ": " description
#include "targets/targets.def"
#undef HEBA_TARGET
         "\n\n" + kUnits + "\n";
}

std::string CameraIntroduction() {
  return "A camera file in heba's own form. ROS camera_info, OpenCV, Kalibr and mrcal files are read too. The models "
         "and "
         "their coefficients are:\n"
#define HEBA_CAMERA_MODEL(name, description) "\n- " #name ": " description
#include "heba/camera/models.def"
#undef HEBA_CAMERA_MODEL
         "\n";
}

std::string SceneIntroduction() {
  return std::string("A scene that `heba simulate` renders and `heba study` samples. ") + kUnits + " " + kPose + "\n";
}

std::string StudyIntroduction() {
  return "A study of `heba study`. Every list is varied over its values, each combined with all others; a single value "
         "needs no list. kinematics, methods and start are for scenes of one camera, estimators for rigs.\n";
}

std::string LongFormIntroduction() {
  return std::string(
             "The config of `heba run` for several cameras, targets or arms. NAME stands for the names that you "
             "give them. ") +
         kUnits + "\n";
}

std::string LongSceneIntroduction() {
  return std::string("A scene with several cameras, targets or arms that `heba simulate` renders. ") + kUnits + " " +
         kPose + "\n";
}

// Returns the mapping that contains a key, empty at the top level, and the key's own name.
std::pair<std::string, std::string> MappingAndName(const std::string& key) {
  const size_t point = key.rfind('.');
  if (point == std::string::npos) return {"", key};
  return {key.substr(0, point), key.substr(point + 1)};
}

// Returns the keys of a document within the mapping `key` or with that name; all of them if it is empty.
std::vector<KeyEntry> EntriesWithin(const KeyDocument& document, std::string_view key) {
  std::vector<KeyEntry> entries;
  for (const KeyEntry& entry : KeyEntries()) {
    if (entry.document != document.name) continue;
    const std::string_view rest =
        entry.key.starts_with(key) ? std::string_view(entry.key).substr(key.size()) : std::string_view("no");
    if (key.empty() || rest.empty() || rest[0] == '.' || rest[0] == '[') entries.push_back(entry);
  }
  return entries;
}

std::string EscapedForTable(const std::string& text) {
  std::string escaped;
  for (const char c : text) escaped += c == '|' ? std::string("\\|") : std::string(1, c);
  return escaped;
}

}  // namespace

const std::vector<KeyDocument>& KeyDocuments() {
  static const std::vector<KeyDocument> documents = {
      {"config", "Run config", &ConfigIntroduction}, {"poses", "Robot poses", &PosesIntroduction},
      {"targets", "Targets", &TargetsIntroduction},  {"camera", "Camera file", &CameraIntroduction},
      {"scene", "Scene", &SceneIntroduction},        {"study", "Study", &StudyIntroduction},
      {"rig", "Rig config", &LongFormIntroduction},  {"rig_scene", "Rig scene", &LongSceneIntroduction}};
  return documents;
}

const std::vector<KeyEntry>& KeyEntries() {
  static const std::vector<KeyEntry> entries = {
#define HEBA_KEY(document, key, value, fallback, meaning) EntryOf(#document, key, value, fallback, meaning),
#include "tools/config/keys.def"
#undef HEBA_KEY
  };
  return entries;
}

std::string KeysAsText(const KeyDocument& document, std::string_view key) {
  const std::vector<KeyEntry> entries = EntriesWithin(document, key);
  if (entries.empty()) {
    std::vector<std::string> names;
    for (const KeyEntry& entry : EntriesWithin(document, "")) {
      names.push_back(entry.key);
      const std::string mapping = MappingAndName(entry.key).first;
      if (!mapping.empty() && std::find(names.begin(), names.end(), mapping) == names.end()) names.push_back(mapping);
    }
    throw InputError("heba help " + std::string(document.name) + ": there is no key " + Quoted(key) +
                     DidYouMean(key, names) + "; 'heba help " + std::string(document.name) + "' lists them");
  }
  std::string text;
  if (key.empty()) text = std::string(document.title) + "\n\n" + document.introduction();
  std::string mapping;
  for (size_t i = 0; i < entries.size(); ++i) {
    const auto [inside, name] = MappingAndName(entries[i].key);
    if (inside != mapping || (i == 0 && !key.empty()))
      text += (text.empty() ? "" : "\n") + inside + (inside.empty() ? "" : ":\n");
    else if (i == 0)
      text += "\n";
    mapping = inside;
    const std::string indent = inside.empty() ? "" : "  ";
    text += indent + name + ": " + entries[i].value + " (" + (entries[i].HasDefault() ? "default: " : "") +
            entries[i].fallback + ")\n" + indent + "    " + entries[i].meaning + "\n";
  }
  std::replace(text.begin(), text.end(), '`', '\'');
  return text;
}

std::string KeysAsMarkdown() {
  std::string page =
      "# Key reference\n\nThis page is what the program itself says: `heba help config`, `heba help poses`, `heba help "
      "targets`, `heba help camera`, `heba help scene`, `heba help study`, `heba help rig` and `heba help rig_scene` "
      "print its sections, and `heba help config "
      "refine.loss` prints one key.\n";
  for (const KeyDocument& document : KeyDocuments()) {
    page += "\n## " + std::string(document.title) + "\n\n" + document.introduction();
    std::string mapping = "none";
    for (const KeyEntry& entry : EntriesWithin(document, "")) {
      const auto [inside, name] = MappingAndName(entry.key);
      if (inside != mapping) {
        page += (inside.empty() ? "" : "\n### " + inside + "\n") +
                std::string("\n| key | value | default | meaning |\n|---|---|---|---|\n");
        mapping = inside;
      }
      page += "| `" + name + "` | " + EscapedForTable(entry.value) + " | " + EscapedForTable(entry.fallback) + " | " +
              EscapedForTable(entry.meaning) + " |\n";
    }
  }
  return page;
}

}  // namespace heba
