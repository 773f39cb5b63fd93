// Sections of a report of single cameras and of rigs: on the residuals of one camera, and on the correlation of the
// unknowns.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/solution.h"
#include "tools/pages/reported_capture.h"

namespace heba {

// What the sections show of one camera.
struct CameraResiduals {
  Camera camera;
  double sigma_px = 0;
  std::optional<double> rms_px;
  std::string condition = {};  // What the residuals are computed with, such as " after ..."; part of the captions.
  // The images, used or not.
  struct Image {
    std::string name;
    bool used = false;
    std::string reason;
    std::optional<double> rms_px;
    const ReportedCapture* shown = nullptr;  // Null if the image has no points.
    std::string title = {};                  // The title of the dialog; empty: the number and the name.
  };
  std::vector<Image> images = {};
};

// Returns the data of the views under a name. The capture dialog opens images of the data "captures" only.
std::string ResidualData(const std::string& name, const CameraResiduals& residuals);
// Returns the sections that show these data; empty if there are no points.
std::string ResidualSections(const std::string& name, const CameraResiduals& residuals);

// Returns the section on the correlation of the unknowns; empty if they are more than can be read.
std::string CorrelationSection(const Covariance& covariance);

// Returns the markup of a section.
std::string PageSection(const std::string& heading, const std::string& content);

}  // namespace heba
