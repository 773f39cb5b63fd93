// A trajectory as TUM's RGB-D benchmark writes it: lines of time x y z qx qy qz qw (m, Hamilton), here the gripper's
// pose in the base. Pictures are those of a folder `images` or `rgb` beside it, in order, if there are as many as
// lines.
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kNumbers = 8;

bool Matches(const fs::path& source) {
  const std::vector<TextLine> lines = LinesOf(BeginningOf(source));
  if (lines.empty()) return false;
  try {
    return NumbersOfLine(lines.front().text, source, 1).size() == kNumbers;
  } catch (const InputError&) {
    return false;
  }
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  const std::vector<TextLine> lines = LinesOf(ReadTextFile(source));
  std::vector<fs::path> pictures = PicturesOf(source.parent_path() / "images");
  if (pictures.empty()) pictures = PicturesOf(source.parent_path() / "rgb");
  const bool has_pictures = pictures.size() == lines.size();
  if (!pictures.empty() && !has_pictures) {
    set.remarks.push_back(std::to_string(pictures.size()) + " pictures lie beside the " + std::to_string(lines.size()) +
                          " poses; which belongs to which, the file does not say");
  }
  for (size_t i = 0; i < lines.size(); ++i) {
    const std::string where = source.string() + ":" + std::to_string(lines[i].number);
    const std::vector<double> numbers = NumbersOfLine(lines[i].text, source, lines[i].number);
    if (numbers.size() != kNumbers) throw InputError(where + ": 8 numbers are needed: time, x, y, z, qx, qy, qz, qw");
    ImportedCapture capture;
    capture.base_from_gripper = PoseOf("ros", std::span(numbers).subspan(1), where);
    capture.image = has_pictures ? pictures[i] : fs::path();
    capture.name = has_pictures ? pictures[i].filename().string() : "pose_" + std::to_string(i);
    set.captures.push_back(std::move(capture));
  }
  set.remarks.emplace_back("the file does not say where the camera is: set setup");
  return set;
}

}  // namespace

ImportReader ImportReader_tum() { return {Matches, Read}; }

}  // namespace heba
