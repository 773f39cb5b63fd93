// Robot poses as 4 x 4 matrices in a text file, 16 numbers a line or 4 lines of 4 (calibration-rs' RobotPosesVec.txt),
// the gripper in the base, m. Pictures in a folder `images` beside it, if there are as many.
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kMatrix = 16;

bool Matches(const fs::path& source) {
  const std::vector<TextLine> lines = LinesOf(BeginningOf(source));
  if (lines.empty()) return false;
  try {
    const size_t count = NumbersOfLine(lines.front().text, source, 1).size();
    return count == kMatrix || count == 4;
  } catch (const InputError&) {
    return false;
  }
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  std::vector<double> numbers;
  for (const TextLine& line : LinesOf(ReadTextFile(source))) {
    for (const double number : NumbersOfLine(line.text, source, line.number)) numbers.push_back(number);
  }
  if (numbers.size() % kMatrix != 0) {
    throw InputError(source.string() + ": " + std::to_string(numbers.size()) + " numbers are no 4 x 4 matrices");
  }
  const size_t count = numbers.size() / kMatrix;
  const std::vector<fs::path> pictures = PicturesOf(source.parent_path() / "images");
  const bool has_pictures = pictures.size() == count;
  if (!pictures.empty() && !has_pictures) {
    set.remarks.push_back(std::to_string(pictures.size()) + " pictures lie beside the " + std::to_string(count) +
                          " poses; which belongs to which, the file does not say");
  }
  for (size_t i = 0; i < count; ++i) {
    ImportedCapture capture;
    capture.base_from_gripper = PoseOfMatrix(std::span(numbers).subspan(kMatrix * i, kMatrix), 1,
                                             source.string() + ": matrix " + std::to_string(i + 1));
    capture.image = has_pictures ? pictures[i] : fs::path();
    capture.name = has_pictures ? pictures[i].filename().string() : "pose_" + std::to_string(i);
    set.captures.push_back(std::move(capture));
  }
  set.remarks.emplace_back("the file does not say where the camera is: set setup");
  return set;
}

}  // namespace

ImportReader ImportReader_matrices() { return {Matches, Read}; }

}  // namespace heba
