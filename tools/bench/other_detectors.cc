#include "tools/bench/other_detectors.h"

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}

namespace heba {

Corners BySectors(const cv::Mat& grey, const BoardSize& size, int flags) {
  Corners corners;
  if (!cv::findChessboardCornersSB(grey, {size.columns, size.rows}, corners, flags)) corners.clear();
  return corners;
}

Corners BySubPix(const cv::Mat& grey, const BoardSize& size, int half_px) {
  Corners corners;
  if (!cv::findChessboardCorners(grey, {size.columns, size.rows}, corners)) return {};
  cv::cornerSubPix(grey, corners, {half_px, half_px}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-3});
  return corners;
}

namespace {

// A libapriltag detector that is kept from image to image, as its users do.
struct AprilTagDetector {
  apriltag_family_t* family = tag36h11_create();
  apriltag_detector_t* detector = apriltag_detector_create();
  AprilTagDetector() {
    apriltag_detector_add_family(detector, family);
    detector->nthreads = 1;
  }
  ~AprilTagDetector() {
    apriltag_detector_destroy(detector);
    tag36h11_destroy(family);
  }
  AprilTagDetector(const AprilTagDetector&) = delete;
  AprilTagDetector& operator=(const AprilTagDetector&) = delete;
};

}  // namespace

Detection FindWithAprilTag(const cv::Mat& grey, double decimate) {
  static const AprilTagDetector detector;
  detector.detector->quad_decimate = static_cast<float>(decimate);
  image_u8_t image = {grey.cols, grey.rows, static_cast<int32_t>(grey.step[0]), grey.data};
  zarray_t* const found = apriltag_detector_detect(detector.detector, &image);
  Detection detection;
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(found, i, &tag);
    for (int corner = 0; corner < 4; ++corner) {
      detection.ids.push_back(4 * tag->id + corner);
      detection.pixels.emplace_back(tag->p[corner][0] - 0.5, tag->p[corner][1] - 0.5);
    }
  }
  apriltag_detections_destroy(found);
  return detection;
}

Detection FindWithAruco(const cv::Mat& grey) {
  const cv::Ptr<cv::aruco::Dictionary> dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  const cv::Ptr<cv::aruco::DetectorParameters> parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, dictionary, corners, ids, parameters);
  Detection detection;
  for (size_t i = 0; i < ids.size(); ++i) {
    // OpenCV's codes are those of the tag rotated by 180 degrees; its corners run clockwise, those of a tag
    // counter-clockwise.
    const int order[] = {1, 0, 3, 2};
    for (int corner = 0; corner < 4; ++corner) {
      const cv::Point2f& at = corners[i][static_cast<size_t>(order[corner])];
      detection.ids.push_back(4 * ids[i] + corner);
      detection.pixels.emplace_back(at.x, at.y);
    }
  }
  return detection;
}

}  // namespace heba
