#include "tools/pipeline/watch.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/detection.h"
#include "targets/images/image.h"
#include "tools/config/finished_run.h"
#include "tools/files/cached_detector.h"
#include "tools/pages/page.h"
#include "tools/pipeline/folder_watch.h"
#include "tools/pipeline/image_quality.h"
#include "tools/pipeline/pipeline.h"
#include "tools/pipeline/quick_look.h"
#include "tools/run/time_offset.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kInterval(100);
// A calibration of all captures takes longer than a look at a new one. It waits until nothing has come for so long, or
// until so many captures wait for it.
constexpr std::chrono::milliseconds kIdle(1000);
constexpr size_t kMostWaiting = 5;

// An image of a capture, and what it is called.
struct WatchedImage {
  std::string name;
  fs::path path;
  size_t camera = 0;
};

std::vector<WatchedImage> ImagesOf(const RunConfig& config) {
  std::vector<WatchedImage> images;
  for (const Recording& capture : config.data.captures) {
    for (size_t c = 0; c < capture.images.size(); ++c) {
      if (capture.images[c].empty()) continue;
      const std::string& camera = config.data.rig.cameras[c].name;
      images.push_back(
          {camera.empty() ? capture.name : camera + "/" + capture.images[c].filename().string(), capture.images[c], c});
    }
  }
  return images;
}

// The images that were looked at.
struct Watched {
  std::map<fs::path, std::uintmax_t> sizes;  // Their sizes are those of the last look.
  std::set<fs::path> closed;                 // Their writers have closed these.
  std::map<fs::path, std::string> complete;  // Each complete image has its ExposureText.
  std::set<fs::path> told;                   // A line was printed about these images.

  // Looks at an image, and returns whether it is complete: its writer has closed it or its size has not changed since
  // the last look, and it can be read.
  bool IsComplete(const fs::path& path);
};

bool Watched::IsComplete(const fs::path& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) return false;
  if (complete.contains(path) && sizes[path] == size) return true;
  const auto [last, is_new] = sizes.try_emplace(path, size);
  const bool is_stable = closed.erase(path.lexically_normal()) > 0 || (!is_new && last->second == size && size > 0);
  last->second = size;
  if (!is_stable) return false;
  try {
    complete[path] = ExposureText(ReadGreyImage(path));
  } catch (const InputError&) {
    return false;  // The image is half-written.
  }
  return true;
}

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
    const std::string& camera = result.rig.cameras[of_camera.camera].name;
    text += "; " + (camera.empty() ? "" : camera + ", ") + one.place + ": " +
            (one.reached_m ? ShownAmount(1000 * *one.reached_m, 2) + " mm" : "not located") + " of " +
            ShownAmount(1000 * one.within_m, 2) + " mm";
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

  // Waits until something has happened in the folders of the session, but not for long.
  void Wait() {
    for (const fs::path& file : folders_.Wait(kInterval)) watched_.closed.insert(file.lexically_normal());
  }

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
    Follow(*config, images);
    std::string missing;
    for (const WatchedImage& image : images) {
      if (!watched_.IsComplete(image.path)) missing = image.name;
    }
    if (!missing.empty()) {
      constexpr std::chrono::milliseconds kPatience(1200);
      const auto now = std::chrono::steady_clock::now();
      if (!waiting_since_) waiting_since_ = now;
      if (now - *waiting_since_ > kPatience) Tell("waiting for " + missing + ", which is not a complete image");
      return false;
    }
    waiting_since_.reset();
    std::string state = StateOf(*config, images);
    if (state == calibrated_) return false;
    if (state != looked_at_) {
      TellImages(*config, images);
      looked_at_ = state;
      const bool is_told = TellQuickly(*config);
      changed_at_ = std::chrono::steady_clock::now();
      if (is_told) WritePage(OutputOf(*config), config->data.name, lines_);
      if (is_told) return false;
    } else if (std::chrono::steady_clock::now() - changed_at_ < kIdle) {
      return false;
    }
    calibrated_ = std::move(state);
    return Calibrate(*config);
  }

 private:
  void Follow(const RunConfig& config, const std::vector<WatchedImage>& images) {
    std::set<fs::path> folders = {fs::path(config_path_).parent_path()};
    for (const WatchedImage& image : images) folders.insert(image.path.parent_path());
    for (const fs::path& file : config.data_files) folders.insert(file.parent_path());
    if (folders.erase("") > 0) folders.insert(".");
    folders_.Follow(folders);
  }

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

  // Says of each new image which targets it shows, how it is exposed and how sharp it is, and what the images of each
  // camera cover.
  void TellImages(const RunConfig& config, const std::vector<WatchedImage>& images) {
    if (config.targets_used != targets_used_) {
      targets_used_ = config.targets_used;
      detect_ = CachedDetections(config.data, targets_used_);
      detections_.clear();
    }
    if (detect_.empty()) return;  // There are points, or poses of the target, and no images.
    const Problem& rig = config.data.rig;
    std::vector<std::vector<SeenTarget>> of_cameras(rig.cameras.size());
    for (const WatchedImage& image : images) {
      const std::vector<CaptureDetection>& detections = DetectOnce(image.path);
      for (size_t t = 0; t < detections.size(); ++t) {
        const CaptureDetection& seen = detections[t];
        of_cameras[image.camera].push_back(
            {ObservationsOf(*config.data.targets[t], seen.detection), seen.width_px, seen.height_px});
      }
      if (watched_.told.insert(image.path).second) Tell(image.name + ": " + AboutImage(config.data, image, detections));
    }
    for (size_t c = 0; c < of_cameras.size(); ++c) {
      const Gauges gauges = GaugesOf(of_cameras[c]);
      const auto percent = [](double share) { return Fixed(100 * share, 0) + " %"; };
      Tell((rig.cameras[c].name.empty() ? "" : rig.cameras[c].name + " ") + "covered: x " + percent(gauges.x) + ", y " +
           percent(gauges.y) + ", size " + percent(gauges.size) + ", skew " + percent(gauges.skew));
    }
  }

  // Returns what is to be said about a new image.
  std::string AboutImage(const Dataset& data, const WatchedImage& image,
                         const std::vector<CaptureDetection>& detections) {
    std::vector<std::string> remarks;
    std::vector<Eigen::Vector2d> pixels;
    for (size_t t = 0; t < detections.size(); ++t) {
      const Detection& seen = detections[t].detection;
      const std::string& name = data.rig.targets[t].name;
      const std::string target = name.empty() ? "" : "target " + name + " ";
      pixels.insert(pixels.end(), seen.pixels.begin(), seen.pixels.end());
      if (seen.ids.empty()) {
        remarks.push_back((name.empty() ? "the target " : target) + "is not seen" +
                          (seen.reason.empty() ? "" : " (" + seen.reason + ")"));
      } else {
        remarks.push_back(target + std::to_string(seen.ids.size()) + " of " +
                          std::to_string(data.targets[t]->points().size()) + " points");
      }
    }
    if (const std::string& exposure = watched_.complete.at(image.path); !exposure.empty()) remarks.push_back(exposure);
    if (const std::optional<double> blur_px = BlurPx(ReadGreyImage(image.path), pixels)) {
      sharpest_px_ = std::min(sharpest_px_.value_or(*blur_px), *blur_px);
      if (const std::string text = SharpnessText(*blur_px, *sharpest_px_); !text.empty()) remarks.push_back(text);
    }
    return Join(remarks, "; ");
  }

  // Returns the detection of each target in an image.
  const std::vector<CaptureDetection>& DetectOnce(const fs::path& image) {
    const auto [known, is_new] = detections_.try_emplace(image);
    if (is_new) {
      for (const DetectFunction& detect : detect_) known->second.push_back(detect(image, std::nullopt));
    }
    return known->second;
  }

  fs::path OutputOf(const RunConfig& config) const { return options_.output.empty() ? config.output : options_.output; }

  // Returns whether the last calibration is one of the cell that the config describes.
  bool KnowsCell(const RunConfig& config) const {
    if (known_ == nullptr || used_by_known_ != config.targets_used) return false;
    const Problem& known = known_->result.rig;
    const Problem& rig = config.data.rig;
    const auto is_same = [](const auto& a, const auto& b) { return a.name == b.name && a.mount == b.mount; };
    return known.robots == rig.robots &&
           std::equal(known.cameras.begin(), known.cameras.end(), rig.cameras.begin(), rig.cameras.end(), is_same) &&
           std::equal(known.targets.begin(), known.targets.end(), rig.targets.begin(), rig.targets.end(), is_same);
  }

  // Says what the captures that have come since the last calibration say beside it. Returns false if there is none of
  // this cell, if nothing can be said, or if many captures have come.
  bool TellQuickly(const RunConfig& config) {
    if (detect_.empty() || !KnowsCell(config)) return false;
    Dataset data = config.data;
    if (data.stream && config.options.estimates_time_offset) {
      const std::optional<EstimatedTimeOffset>& offset = known_->result.time_offset;
      if (!offset) return false;
      data = WithPosesAt(std::move(data), offset->value_s);
    }
    std::vector<SessionImage> images;
    std::vector<ArmsAtImage> poses;
    std::vector<std::vector<Detection>> seen;
    std::vector<std::string> names;
    for (const Recording& capture : data.captures) {
      if (captures_of_known_.contains(capture.name)) continue;
      names.push_back(capture.name);
      ArmsAtImage arms;
      for (size_t r = 0; r < capture.base_from_gripper.size(); ++r) {
        GivenArmPose& arm = arms.emplace_back();
        arm.base_from_gripper = capture.base_from_gripper[r];
        // Joints tell the errors of an arm, if these were estimated.
        const bool has_joints = r < capture.joints.size() && !capture.joints[r].empty();
        if (!has_joints || FindEstimatedArm(known_->result, r) == nullptr) continue;
        arm.joints = Eigen::Map<const Eigen::VectorXd>(capture.joints[r].data(),
                                                       static_cast<Eigen::Index>(capture.joints[r].size()));
      }
      for (size_t c = 0; c < capture.images.size(); ++c) {
        if (capture.images[c].empty()) continue;
        images.push_back({c, capture.images[c]});
        poses.push_back(arms);
        std::vector<Detection>& of_image = seen.emplace_back();
        for (const CaptureDetection& one : DetectOnce(capture.images[c])) of_image.push_back(one.detection);
      }
    }
    if (images.empty() || names.size() >= kMostWaiting) return false;
    try {
      const std::string text = QuickLook(known_, images, poses, seen);
      if (!text.empty()) Tell(Join(names, ", ") + " " + text);
      return !text.empty();
    } catch (const InputError&) {
      return false;  // The errors of the arm at this pose are not known.
    }
  }

  bool Calibrate(const RunConfig& config) {
    const fs::path output = OutputOf(config);
    Console console(Verbosity::kQuiet);
    const Outcome<RunResult> result = RunPipeline(config, output, options_.num_threads, &console);
    if (!result) {
      Tell("not yet: " + FailureText(result.failure()));
      return false;
    }
    Remember(config, output);
    Tell(KnownText(*result));
    const std::string next = NextText(*result);
    if (!next.empty()) Tell("next: " + next);
    const bool is_met = IsMet(*result);
    if (is_met) Tell("the required accuracy is reached; results: " + output.string());
    WritePage(output, config.data.name, lines_);
    return is_met;
  }

  // Keeps the run for what comes next; nothing of a run without a refined estimate.
  void Remember(const RunConfig& config, const fs::path& output) {
    known_ = nullptr;
    captures_of_known_.clear();
    try {
      known_ = std::make_shared<const FinishedRun>(ReadFinishedRun(output));
    } catch (const InputError&) {
      return;
    }
    used_by_known_ = config.targets_used;
    for (const Recording& capture : config.data.captures) captures_of_known_.insert(capture.name);
  }

  std::string config_path_;
  WatchOptions options_;
  FolderWatch folders_;
  bool has_config_ = false;
  std::optional<std::chrono::steady_clock::time_point> waiting_since_;  // For an image that is not complete.
  std::string looked_at_;                                               // StateOf the last look at images.
  std::chrono::steady_clock::time_point changed_at_ = {};
  std::string calibrated_;  // StateOf the last run.
  // The last run, the targets that it used, and the captures that it had.
  std::shared_ptr<const FinishedRun> known_;
  std::vector<std::string> used_by_known_;
  std::set<std::string> captures_of_known_;
  Watched watched_;
  std::vector<std::string> targets_used_;
  std::vector<DetectFunction> detect_;  // One per target; they keep what the run needs again.
  std::map<fs::path, std::vector<CaptureDetection>> detections_;
  std::optional<double> sharpest_px_;  // The blur of the sharpest image.
  std::vector<std::string> lines_;
};

}  // namespace

void Watch(const std::string& config_path, const WatchOptions& options) {
  WatchedSession session(config_path, options);
  while (!session.Look()) session.Wait();
}

}  // namespace heba
