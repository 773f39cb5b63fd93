#include "tools/files/detection_cache.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/json_reader.h"
#include "tools/files/program_digest.h"
#include "tools/run/digest.h"

namespace heba {

std::filesystem::path CacheFolder() {
  if (const char* named = std::getenv("HEBA_CACHE")) return named;
  if (const char* user = std::getenv("XDG_CACHE_HOME"); user != nullptr && *user != 0) {
    return std::filesystem::path(user) / "heba";
  }
  if (const char* home = std::getenv("HOME"); home != nullptr && *home != 0) {
    return std::filesystem::path(home) / ".cache" / "heba";
  }
  return {};
}

namespace {

// An entry of the cache, a file with the suffix .detection in a folder with a name of two characters. Other files are
// ignored.
struct CacheEntry {
  std::filesystem::path file;
  double bytes = 0;
  std::filesystem::file_time_type used;
};

std::vector<CacheEntry> EntriesOfCache() {
  std::vector<CacheEntry> entries;
  const std::filesystem::path folder = CacheFolder();
  std::error_code error;
  if (folder.empty()) return entries;
  for (const auto& shelf : std::filesystem::directory_iterator(folder / "detections", error)) {
    if (shelf.path().filename().string().size() != 2 || !shelf.is_directory(error)) continue;
    for (const auto& file : std::filesystem::directory_iterator(shelf.path(), error)) {
      if (file.path().extension() != ".detection" || !file.is_regular_file(error)) continue;
      entries.push_back({file.path(), static_cast<double>(file.file_size(error)), file.last_write_time(error)});
    }
  }
  return entries;
}

std::string ToJson(const CaptureDetection& capture) {
  nlohmann::ordered_json json;
  json["size"] = {capture.width_px, capture.height_px};
  json["ids"] = capture.detection.ids;
  json["pixels"] = nlohmann::ordered_json::array();
  for (const Eigen::Vector2d& pixel : capture.detection.pixels) {
    json["pixels"].push_back(pixel.x());
    json["pixels"].push_back(pixel.y());
  }
  json["covariances_px2"] = nlohmann::ordered_json::array();
  for (const Eigen::MatrixXd& matrix : capture.detection.covariances_px2) {
    json["covariances_px2"].push_back(std::vector<double>(matrix.data(), matrix.data() + matrix.size()));
  }
  json["reason"] = capture.detection.reason;
  json["small_jpeg"] = ToBase64(capture.small_jpeg);
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// Returns what an entry of this name and content begins with.
std::string SealOf(const std::filesystem::path& file, const std::string& json) {
  return DigestOf(file.filename().string() + json);
}

CaptureDetection FromJson(const JsonReader& reader) {
  CaptureDetection capture;
  const std::vector<double> size = reader.Get("size").Numbers(2);
  capture.width_px = static_cast<int>(size[0]);
  capture.height_px = static_cast<int>(size[1]);
  for (const double id : reader.Get("ids").Numbers()) capture.detection.ids.push_back(static_cast<int>(id));
  const std::vector<double> pixels = reader.Get("pixels").Numbers(2 * capture.detection.ids.size());
  for (size_t i = 0; i < pixels.size(); i += 2) capture.detection.pixels.emplace_back(pixels[i], pixels[i + 1]);
  for (const JsonReader& matrix : reader.Get("covariances_px2").List()) {
    const std::vector<double> values = matrix.Numbers();
    const auto rows = static_cast<Eigen::Index>(std::lround(std::sqrt(static_cast<double>(values.size()))));
    if (rows * rows != static_cast<Eigen::Index>(values.size())) matrix.Fail("is not square");
    capture.detection.covariances_px2.emplace_back(Eigen::Map<const Eigen::MatrixXd>(values.data(), rows, rows));
  }
  capture.detection.reason = reader.Get("reason").Text();
  capture.small_jpeg = FromBase64(reader.Get("small_jpeg").Text());
  return capture;
}

}  // namespace

CacheSize SizeOfCache() {
  CacheSize size;
  for (const CacheEntry& entry : EntriesOfCache()) {
    ++size.num_entries;
    size.bytes += entry.bytes;
  }
  return size;
}

double LargestCacheBytes() {
  constexpr double kMegabyte = 1e6;
  constexpr double kUsualMegabytes = 1024;
  const char* const asked = std::getenv("HEBA_CACHE_MB");
  if (asked == nullptr || *asked == 0) return kUsualMegabytes * kMegabyte;
  double megabytes = 0;
  if (!ParseDouble(asked, &megabytes) || !(megabytes >= 0) || megabytes > 1e9) {
    throw InputError("HEBA_CACHE_MB: " + Quoted(asked) + " is no size in megabytes");
  }
  return megabytes * kMegabyte;
}

CacheSize TrimCache(double most_bytes) {
  std::vector<CacheEntry> entries = EntriesOfCache();
  std::sort(entries.begin(), entries.end(), [](const CacheEntry& a, const CacheEntry& b) { return a.used > b.used; });
  double kept = 0;
  CacheSize removed;
  for (const CacheEntry& entry : entries) {
    std::error_code error;
    if (kept + entry.bytes <= most_bytes || !std::filesystem::remove(entry.file, error)) {
      kept += entry.bytes;
      continue;
    }
    ++removed.num_entries;
    removed.bytes += entry.bytes;
  }
  return removed;
}

DetectionCache::DetectionCache(const std::string& target)
    : folder_(CacheFolder()), context_(DigestOfProgram() + DigestOf(target)) {}

std::filesystem::path DetectionCache::FileOf(const std::string& image_digest) const {
  const std::string name = DigestOf(context_ + image_digest);
  return folder_ / "detections" / name.substr(0, 2) / (name + ".detection");
}

std::optional<CaptureDetection> DetectionCache::Find(const std::string& image_digest) const {
  if (folder_.empty()) return std::nullopt;
  const std::filesystem::path file = FileOf(image_digest);
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return std::nullopt;
  try {
    constexpr size_t kMaxBytes = size_t{64} << 20;
    // The first line is the digest of the rest with the name, which detects corrupted files and those of others.
    const std::string text = ReadTextFile(file, kMaxBytes);
    const size_t end = text.find('\n');
    if (end == std::string::npos || SealOf(file, text.substr(end + 1)) != text.substr(0, end)) return std::nullopt;
    const nlohmann::ordered_json json = nlohmann::ordered_json::parse(text.substr(end + 1), nullptr, false);
    if (json.is_discarded()) return std::nullopt;
    CaptureDetection detection = FromJson(JsonReader(json, file.string()));
    // The time of last use, for TrimCache.
    std::filesystem::last_write_time(file, std::filesystem::file_time_type::clock::now(), error);
    return detection;
  } catch (const InputError&) {
    return std::nullopt;  // A corrupted entry counts as missing.
  }
}

void DetectionCache::Keep(const std::string& image_digest, const CaptureDetection& detection) const {
  if (folder_.empty()) return;
  const std::filesystem::path file = FileOf(image_digest);
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  try {
    const std::string json = ToJson(detection);
    WriteFileAtomically(file, SealOf(file, json) + "\n" + json);
  } catch (const InputError&) {
    return;
  }
}

}  // namespace heba
