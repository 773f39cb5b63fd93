// The images of a later session, with the poses of the arm at which they were taken, as a problem of the calibration.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/session_check.h"
#include "tools/config/finished_run.h"
#include "tools/run/image_location.h"

namespace heba {

// An image of one camera.
struct SessionImage {
  size_t camera = 0;
  std::filesystem::path path;
};

struct Session {
  Problem problem;                 // Its captures have the points of the images.
  std::vector<std::string> notes;  // One sentence for each image that is not used.
};

// Returns the points of a target with symmetries in the reading order that is closest to the prediction.
Observations InPredictedOrder(const Camera& camera, const std::vector<Rigid3d>& symmetries, const TargetShape& shape,
                              const Rigid3d& predicted, const Observations& seen);

// The poses of all arms when an image was taken.
using ArmsAtImage = std::vector<GivenArmPose>;

// Returns the poses of an arm at the images: the rows of a poses file that name them or, if no row names an image, the
// rows in the order of the images. The joints are those of the rows if these are joints or, with a file of joints, of
// which an arm with estimated errors may need some, those of its columns j1 to jN and image; an empty path: there is
// none. Throws InputError if a file cannot be read or has no row for an image.
std::vector<GivenArmPose> PosesOfImages(const FinishedRun& run, size_t robot, const std::filesystem::path& poses,
                                        const std::filesystem::path& joints, const std::vector<SessionImage>& images);

// Detects the targets in the images, which were taken at these poses of the arms; images at the same poses are one
// capture. Throws InputError if an image cannot be read or is not of the size of the calibration's, or if joints are
// missing without which the errors of an arm are not known.
Session ReadSession(const FinishedRun& run, const std::vector<SessionImage>& images,
                    const std::vector<ArmsAtImage>& poses, int num_threads);

// The points of targets in images: a list for each image, with an entry for each target of the run.
using SeenTargets = std::vector<std::vector<Detection>>;
// Detects the targets of a run in images. Throws InputError if one cannot be read or is not of the size of the
// calibration's.
SeenTargets DetectTargets(const FinishedRun& run, const std::vector<SessionImage>& images, int num_threads);

// Returns the session of images in which the targets were detected. Throws InputError like ReadSession.
Session SessionOf(const FinishedRun& run, const std::vector<SessionImage>& images,
                  const std::vector<ArmsAtImage>& poses, const SeenTargets& seen);

// Returns the options for a session of a run: its wobble, and the smooth errors that it states.
SessionOptions SessionOptionsOf(const FinishedRun& run, bool is_target_in_place);

}  // namespace heba
