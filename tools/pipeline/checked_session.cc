#include "tools/pipeline/checked_session.h"

#include <algorithm>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "tools/pipeline/reference_session.h"
#include "tools/pipeline/shown_target.h"
#include "tools/text/check_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the reference images of a camera: one, or those of a folder.
std::vector<SessionImage> ReferencesOf(size_t camera, const fs::path& path) {
  if (!fs::is_directory(path)) return {{camera, path}};
  std::vector<SessionImage> images;
  for (const fs::directory_entry& entry : fs::directory_iterator(path)) {
    if (HasImageSuffix(entry.path())) images.push_back({camera, entry.path()});
  }
  if (images.empty()) throw InputError("the reference images: the folder " + path.string() + " contains no images");
  std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
  return images;
}

}  // namespace

CheckedSession SessionAtPoses(const FinishedRun& run, const std::vector<SessionImage>& images,
                              const std::vector<ArmsAtImage>& poses, bool is_target_in_place, int num_threads) {
  Session session = ReadSession(run, images, poses, num_threads);
  return {std::move(session.problem), run.result.solution, SessionOptionsOf(run, is_target_in_place),
          std::move(session.notes)};
}

CheckedSession SessionBesideReferences(const FinishedRun& run, const fs::path& reference,
                                       const std::vector<SessionImage>& images, int num_threads) {
  const size_t camera = images.front().camera;
  for (const SessionImage& image : images) {
    if (image.camera != camera)
      throw InputError("the images: beside reference images, they must be those of one camera");
  }
  ReferenceSession session = ReadReferenceSession(run, ReferencesOf(camera, reference), images, num_threads);
  SessionOptions options;
  options.wobble = {};
  return {std::move(session.problem), std::move(session.solution), options, std::move(session.notes)};
}

std::string WhyUndecided(const Failure& failure, const std::vector<SessionImage>& images, int num_threads) {
  const std::string text = UndecidedText(failure);
  if (failure.code != "no_target") return text;
  std::vector<fs::path> paths;
  for (const SessionImage& image : images) paths.push_back(image.path);
  const std::string shown = ShownTarget(paths, num_threads);
  return shown.empty() ? text : text + "; they show: " + shown;
}

}  // namespace heba
