#include "tools/pipeline/watch.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/detection.h"
#include "targets/images/image.h"
#include "tools/files/cached_detector.h"
#include "tools/pages/page.h"
#include "tools/pipeline/pipeline.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kInterval(250);

// An image of a capture, and what it is called.
struct WatchedImage {
  std::string name;
  fs::path path;
};

std::vector<WatchedImage> ImagesOf(const RunConfig& config) {
  std::vector<WatchedImage> images;
  for (const Recording& capture : config.data.captures) {
    for (size_t c = 0; c < capture.images.size(); ++c) {
      if (capture.images[c].empty()) continue;
      const std::string& camera = config.data.rig.cameras[c].name;
      images.push_back(
          {camera.empty() ? capture.name : camera + "/" + capture.images[c].filename().string(), capture.images[c]});
    }
  }
  return images;
}

// The images that were looked at.
struct Watched {
  std::map<fs::path, std::uintmax_t> sizes;  // Their sizes are those of the last look.
  std::map<fs::path, std::string> complete;  // Each complete image has its ExposureText.
  std::set<fs::path> told;                   // A line was printed about these images.
};

// Returns what a run depends on: the config as used, its images and its other files, with their sizes and times.
std::string StateOf(const RunConfig& config, const std::vector<WatchedImage>& images) {
  std::string state = config.used;
  std::vector<fs::path> files = config.data_files;
  for (const WatchedImage& image : images) files.push_back(image.path);
  for (const fs::path& file : files) {
    std::error_code error;
    const auto time = fs::last_write_time(file, error);
    state += file.string() + " " + std::to_string(error ? 0 : time.time_since_epoch().count()) + "\n";
  }
  return state;
}

// Returns what the exposure of an image lacks; empty if nothing.
std::string ExposureText(const cv::Mat& grey) {
  double num_bright = 0;
  double sum = 0;
  for (int row = 0; row < grey.rows; ++row) {
    const auto* const pixels = grey.ptr<unsigned char>(row);
    for (int column = 0; column < grey.cols; ++column) {
      constexpr unsigned char kSaturated = 254;
      num_bright += pixels[column] >= kSaturated ? 1 : 0;
      sum += pixels[column];
    }
  }
  const double num_pixels = static_cast<double>(grey.rows) * grey.cols;
  constexpr double kMostBright = 0.2;
  constexpr double kDark = 30;
  if (num_bright > kMostBright * num_pixels) {
    return "overexposed: " + Fixed(100 * num_bright / num_pixels, 0) + " % of its pixels are white";
  }
  if (sum < kDark * num_pixels) return "dark: its mean is " + Fixed(sum / num_pixels, 0) + " of 255";
  return "";
}

// Returns whether an image is complete: its size has not changed since the last look, and it can be read.
bool IsComplete(const fs::path& path, Watched* watched) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) return false;
  if (watched->complete.contains(path) && watched->sizes[path] == size) return true;
  const auto [last, is_new] = watched->sizes.try_emplace(path, size);
  const bool is_stable = !is_new && last->second == size && size > 0;
  last->second = size;
  if (!is_stable) return false;
  try {
    watched->complete[path] = ExposureText(ReadGreyImage(path));
  } catch (const InputError&) {
    return false;  // The image is half-written.
  }
  return true;
}

// The places of the target in the images of a single camera, as shares of what a good session covers.
struct Gauges {
  double x = 0;
  double y = 0;
  double size = 0;
};

Gauges GaugesOf(const std::vector<CaptureDetection>& detections) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1);
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
  for (const CaptureDetection& capture : detections) {
    const std::vector<Eigen::Vector2d>& pixels = capture.detection.pixels;
    if (pixels.empty()) continue;
    Eigen::Vector2d least = pixels.front();
    Eigen::Vector2d most = pixels.front();
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& pixel : pixels) {
      least = least.cwiseMin(pixel);
      most = most.cwiseMax(pixel);
      mean += pixel / static_cast<double>(pixels.size());
    }
    const double area_px2 = static_cast<double>(capture.width_px) * capture.height_px;
    const Eigen::Vector3d place(mean.x() / capture.width_px, mean.y() / capture.height_px,
                                std::sqrt((most - least).prod() / area_px2));
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
  }
  const Eigen::Vector3d range = (high - low).cwiseMax(0);
  // The middle of the target should move over these parts of the image, as in hand-held calibrations.
  constexpr double kOfImage = 0.5;
  constexpr double kOfSize = 0.25;
  return {std::min(1.0, range.x() / kOfImage), std::min(1.0, range.y() / kOfImage), std::min(1.0, range.z() / kOfSize)};
}

// Returns whether there are requirements, and all are met.
bool IsMet(const RunResult& result) {
  return !result.requirements.empty() &&
         std::all_of(result.requirements.begin(), result.requirements.end(), [](const CameraRequirement& of_camera) {
           const Requirement& one = of_camera.requirement;
           return one.reached_m && *one.reached_m <= one.within_m;
         });
}

// Returns what is known, and what to take next.
std::string KnownText(const RunResult& result) {
  std::string text =
      std::to_string(NumUsedCaptures(result)) + " captures: " + std::string(GradeName(result.verdict.grade));
  const auto covariance = IsShort(result) && FindRefined(result) != nullptr
                              ? PoseCovarianceOf(result.solution.covariance, kHandEyeBlock)
                              : std::nullopt;
  if (covariance) {
    const auto [sigma_m, sigma_rad] = LargestSigmas(*covariance);
    text += ", the camera's pose is known to " + ShownAmount(1000 * sigma_m, 2) + " mm and " +
            ShownAmount(RadToDeg(sigma_rad), 2) + " deg";
  }
  for (const CameraRequirement& of_camera : result.requirements) {
    const Requirement& one = of_camera.requirement;
    text += "; " + one.place + ": " + (one.reached_m ? ShownAmount(1000 * *one.reached_m, 2) + " mm" : "not located") +
            " of " + ShownAmount(1000 * one.within_m, 2) + " mm";
  }
  return text;
}

// Returns the advice about the captures to take next; empty if there is none.
std::string NextText(const RunResult& result) {
  for (const Finding& finding : result.verdict.findings) {
    if (finding.code == "weak_direction" && !finding.action.empty()) return finding.action;
  }
  for (const Finding& finding : result.verdict.findings) {
    if (finding.code != "weak_direction") continue;
    const size_t place = finding.text.find("; from capture");
    return place == std::string::npos ? "" : finding.text.substr(place + 2);
  }
  return "";
}

void WritePage(const fs::path& output, const std::string& name, const std::vector<std::string>& lines) {
  std::error_code error;
  if (!fs::is_directory(output, error)) return;
  std::string body = "<h1>" + EscapedForMarkup(name) + "</h1>\n" +
                     Paragraph("This page reloads itself while heba watch follows the session.");
  std::vector<std::vector<PageCell>> rows;
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) rows.push_back({{*line}});
  body += HtmlTable({"what has come, the latest first"}, rows);
  body += "<p><a href=\"report.html\">The report of the latest run</a></p>";
  std::string page = HtmlPage(name, body);
  const size_t head = page.find("<head>");
  if (head != std::string::npos) page.insert(head + 6, "<meta http-equiv=\"refresh\" content=\"2\">");
  // It stands beside the folder, whose files are those of one run.
  WriteFileAtomically(fs::path(output.string() + ".watch.html"), page);
}

// One session: what was printed, and what is known about the images.
class WatchedSession {
 public:
  WatchedSession(std::string config_path, WatchOptions options)
      : config_path_(std::move(config_path)), options_(std::move(options)) {}

  // Looks once. Returns whether the requirements are met.
  bool Look() {
    std::optional<RunConfig> config;
    try {
      config = ReadRunConfig(config_path_, options_.settings);
    } catch (const InputError& error) {
      // A config that was right may be edited meanwhile.
      if (!has_config_ && !IsAboutCaptures(error.what())) throw;
      Tell("waiting: " + std::string(error.what()));
      return false;
    }
    has_config_ = true;
    const std::vector<WatchedImage> images = ImagesOf(*config);
    std::string missing;
    for (const WatchedImage& image : images) {
      if (!IsComplete(image.path, &watched_)) missing = image.name;
    }
    if (!missing.empty()) {
      constexpr int kPatientLooks = 12;
      if (++num_waits_ > kPatientLooks) Tell("waiting for " + missing + ", which is not a complete image");
      return false;
    }
    num_waits_ = 0;
    std::string state = StateOf(*config, images);
    if (state == calibrated_) return false;
    TellImages(*config, images);
    calibrated_ = std::move(state);
    return Calibrate(*config);
  }

 private:
  // Returns whether a fault is that of captures that have not come yet.
  static bool IsAboutCaptures(const std::string& fault) {
    const std::vector<std::string> words = {"captures.images", "captures.poses"};
    return std::any_of(words.begin(), words.end(),
                       [&](const std::string& word) { return fault.find(word) != std::string::npos; });
  }

  void Tell(const std::string& line) {
    if (!lines_.empty() && lines_.back() == line) return;
    lines_.push_back(line);
    std::cout << ForTerminal(line + "\n") << std::flush;
  }

  // Says of each new image whether it shows the target, and how it is exposed.
  void TellImages(const RunConfig& config, const std::vector<WatchedImage>& images) {
    const bool is_short = IsShort(config.data.rig);
    std::vector<CaptureDetection> detections;
    for (const WatchedImage& image : images) {
      const bool is_new = watched_.told.insert(image.path).second;
      if (!is_short) {
        if (is_new) Tell(image.name + ": has come");
        continue;
      }
      detections.push_back(DetectOnce(config, image.path));
      if (!is_new) continue;
      const Detection& seen = detections.back().detection;
      const std::string& exposure = watched_.complete.at(image.path);
      Tell(image.name + ": " +
           (seen.ids.empty() ? "the target is not seen" + (seen.reason.empty() ? "" : " (" + seen.reason + ")")
                             : std::to_string(seen.ids.size()) + " of " +
                                   std::to_string(config.data.targets.front()->points().size()) + " points") +
           (exposure.empty() ? "" : "; " + exposure));
    }
    if (!is_short) return;
    const Gauges gauges = GaugesOf(detections);
    const auto percent = [](double share) { return Fixed(100 * share, 0) + " %"; };
    Tell("covered: x " + percent(gauges.x) + ", y " + percent(gauges.y) + ", size " + percent(gauges.size));
  }

  const CaptureDetection& DetectOnce(const RunConfig& config, const fs::path& image) {
    const auto known = detections_.find(image);
    if (known != detections_.end()) return known->second;
    if (!detect_) detect_ = CachedDetection(config.targets_used.front());
    return detections_.emplace(image, detect_(image, std::nullopt)).first->second;
  }

  bool Calibrate(const RunConfig& config) {
    const fs::path output = options_.output.empty() ? config.output : options_.output;
    Console console(Verbosity::kQuiet);
    const Outcome<RunResult> result = RunPipeline(config, output, options_.num_threads, &console);
    if (!result) {
      Tell("not yet: " + FailureText(result.failure()));
      return false;
    }
    Tell(KnownText(*result));
    const std::string next = NextText(*result);
    if (!next.empty()) Tell("next: " + next);
    const bool is_met = IsMet(*result);
    if (is_met) Tell("the required accuracy is reached; results: " + output.string());
    WritePage(output, config.data.name, lines_);
    return is_met;
  }

  std::string config_path_;
  WatchOptions options_;
  bool has_config_ = false;
  int num_waits_ = 0;
  std::string calibrated_;  // StateOf the last run.
  Watched watched_;
  DetectFunction detect_;  // Keeps what the run needs again.
  std::map<fs::path, CaptureDetection> detections_;
  std::vector<std::string> lines_;
};

}  // namespace

void Watch(const std::string& config_path, const WatchOptions& options) {
  WatchedSession session(config_path, options);
  while (!session.Look()) std::this_thread::sleep_for(kInterval);
}

}  // namespace heba
