// handeye-calib of fishros: alternating lines hand,x,y,z,rx,ry,rz and eye,x,y,z,rx,ry,rz (m, degrees; R = Rz Ry Rx).
// The poses are those of the hand in the base and of the marker in the camera.
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"
#include "heba/io/pose_formats.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) {
  const std::string text = Trim(BeginningOf(source));
  return text.starts_with("hand,") && text.find("\neye,") != std::string::npos;
}

Rigid3d PoseOfLine(const TextLine& line, const std::string& what, const fs::path& source) {
  const std::string where = source.string() + ":" + std::to_string(line.number);
  if (!line.text.starts_with(what + ",")) throw InputError(where + ": a line " + what + ",x,y,z,rx,ry,rz is needed");
  const std::vector<double> numbers = NumbersOfLine(line.text.substr(what.size()), source, line.number);
  const PoseFormat format{"", {"x", "y", "z", "rx", "ry", "rz"}, "m", "extrinsic_xyz", "deg"};
  if (numbers.size() != format.columns.size()) {
    throw InputError(where + ": " + std::to_string(numbers.size()) + " numbers; 6 are needed: x, y, z, rx, ry, rz");
  }
  const Outcome<Rigid3d> pose = PoseFromNumbers(format, numbers);
  if (!pose) throw InputError(where + ": " + pose.reason());
  return *pose;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  const std::vector<TextLine> lines = LinesOf(ReadTextFile(source));
  if (lines.size() % 2 != 0) {
    throw InputError(source.string() + ": the last line has no partner; lines hand and eye must alternate");
  }
  for (size_t i = 0; i < lines.size(); i += 2) {
    ImportedCapture capture;
    capture.name = "pair_" + std::to_string(i / 2);
    capture.base_from_gripper = PoseOfLine(lines[i], "hand", source);
    capture.camera_from_target = PoseOfLine(lines[i + 1], "eye", source);
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_fishros() { return {Matches, Read}; }

}  // namespace heba
