// moveit_calibration's samples: a list of {effector_wrt_world, object_wrt_sensor} of 16 numbers each, row by row (m),
// or of pairs of 4 x 4 matrices in this order (the JSON of its own tests).
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) {
  const std::string text = BeginningOf(source);
  return text.find("effector_wrt_world") != std::string::npos || Trim(text).starts_with("[[[[");
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  for (const ConfigValue& entry : ReadYamlFile(source).AsList()) {
    ImportedCapture capture;
    capture.name = "sample_" + std::to_string(set.captures.size());
    std::vector<ConfigValue> pair;
    if (entry.IsMap()) {
      MapReader reader(entry);
      pair.push_back(reader.Get("effector_wrt_world"));
      pair.push_back(reader.Get("object_wrt_sensor"));
    } else {
      for (const ConfigValue& item : entry.AsList()) pair.push_back(item);
      if (pair.size() != 2) entry.Fail("two poses are needed, the effector's and the object's");
    }
    const auto pose_of = [](const ConfigValue& value) {
      std::string where = value.Where();
      where.resize(where.size() - 2);
      return PoseOfMatrix(FlatNumbers(value), 1, where);
    };
    capture.base_from_gripper = pose_of(pair[0]);
    capture.camera_from_target = pose_of(pair[1]);
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_moveit_calibration() { return {Matches, Read}; }

}  // namespace heba
