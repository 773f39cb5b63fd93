#include "tools/config/stream_section.h"

#include <algorithm>
#include <string>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/io/pose_formats.h"
#include "heba/io/pose_source.h"

namespace heba {
namespace fs = std::filesystem;

PoseStream ReadStream(const fs::path& file, const PoseReading& reading) {
  std::vector<PoseRow> rows = ReadPoseFile(file, reading.format);
  if (!rows.front().time_s)
    throw InputError(file.string() + ": has no column 'time' (s), which a stream of poses needs");
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return *a.time_s < *b.time_s; });
  PoseStream stream;
  for (const PoseRow& row : rows) {
    // Robots repeat a row until the next one is ready.
    if (!stream.times_s.empty() && *row.time_s == stream.times_s.back()) continue;
    stream.times_s.push_back(*row.time_s);
    stream.base_from_gripper.push_back(BaseFromGripper(reading, row.pose));
  }
  if (stream.times_s.size() < 2) throw InputError(file.string() + ": has one time only; a stream needs more");
  return stream;
}

std::vector<PoseRow> RowsAtTimes(const PoseStream& stream, const fs::path& file, std::vector<PoseRow> timed) {
  const PoseFormat& format = *FindPoseFormat("ros");
  std::vector<PoseRow> rows;
  std::optional<double> other_s;
  for (PoseRow& row : timed) {
    if (!Covers(stream, *row.time_s)) {
      other_s = row.time_s;
      continue;
    }
    row.pose = PoseAt(stream, *row.time_s);
    row.numbers = NumbersFromPose(format, row.pose);
    rows.push_back(std::move(row));
  }
  if (!rows.empty()) return rows;
  throw InputError(file.string() + ": no image was taken within its times, " + RoundTrip(stream.times_s.front()) +
                   " to " + RoundTrip(stream.times_s.back()) + " s" +
                   (other_s ? " (one was at " + RoundTrip(*other_s) + " s)" : ""));
}

std::vector<PoseRow> ReadTimes(const fs::path& file, const std::vector<std::string>& cameras) {
  std::vector<PoseRow> rows = ReadPoses(file, NumbersFormat({std::string(kTimeColumn)}), cameras, {});
  for (PoseRow& row : rows) {
    if (row.image.empty() && row.images.empty()) {
      throw InputError(file.string() + ": needs the columns image and time");
    }
    row.time_s = SecondsOf(row.numbers.front());
  }
  return rows;
}

std::optional<double> ReadTimeOffset(MapReader& refine, bool has_stream) {
  const std::optional<ConfigValue> value = refine.Find("time_offset");
  if (!has_stream) {
    if (value) value->Fail("there is no stream of poses (captures.stream)");
    return std::nullopt;
  }
  const std::string text = value ? value->AsText() : "auto";
  refine.Record("time_offset", YAML::Node(text));
  if (text == "auto") return std::nullopt;
  double offset_s = 0;
  if (!ParseDouble(text, &offset_s)) value->Fail("'" + text + "' is neither auto nor a number of seconds");
  return offset_s;
}

}  // namespace heba
