#include "tools/pipeline/shown_target.h"

#include "heba/base/even_indices.h"
#include "heba/recognition.h"
#include "targets/images/image.h"

namespace heba {

std::string ShownTarget(const std::vector<std::filesystem::path>& images, int num_threads) {
  constexpr size_t kFew = 4;
  std::vector<cv::Mat> read;
  for (const size_t i : EvenIndices(images.size(), kFew)) read.push_back(ReadGreyImage(images[i]));
  const std::vector<RecognisedTarget> found = RecogniseTargets(read, num_threads);
  return found.empty() ? "" : RecognisedTargetText(found.front());
}

}  // namespace heba
