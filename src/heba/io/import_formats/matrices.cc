// Robot poses as 4 x 4 matrices in a text file, 16 numbers per line or four lines of four (calibration-rs'
// RobotPosesVec.txt), the gripper in the base, m. The images of a folder `images` beside the file are used if there is
// one per pose.
#include "heba/base/error.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kMatrix = 16;

bool Matches(const fs::path& source) {
  const size_t count = NumbersInFirstLine(source);
  return count == kMatrix || count == 4;
}

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  const std::vector<double> numbers = NumbersOfFile(source);
  if (numbers.size() % kMatrix != 0) {
    throw InputError(source.string() + ": " + std::to_string(numbers.size()) +
                     " numbers are not a whole number of 4 x 4 matrices");
  }
  const size_t count = numbers.size() / kMatrix;
  const auto [images, remarks] = ImagesForPoses({source.parent_path() / "images"}, count);
  set.remarks = remarks;
  for (size_t i = 0; i < count; ++i) {
    ImportedCapture capture = CaptureOf(images.empty() ? fs::path() : images[i], i);
    capture.base_from_gripper = PoseOfMatrix(std::span(numbers).subspan(kMatrix * i, kMatrix), 1,
                                             source.string() + ": matrix " + std::to_string(i + 1));
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_matrices() { return {Matches, Read}; }

}  // namespace heba
