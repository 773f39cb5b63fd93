// Reads the key `stream` of captures: the poses of a robot that moved while the images were taken.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/data/pose_stream.h"
#include "heba/io/pose_file.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads a table of poses with a column `time`. Of rows with the same time, the first one counts. Throws InputError if
// it has no times, or one only.
PoseStream ReadStream(const std::filesystem::path& file, const PoseReading& reading);

// Returns those of the rows, which name images and have times, that a stream covers, with its poses in the form `ros`.
// Throws InputError, which begins with the file of the stream, if there are none.
std::vector<PoseRow> RowsAtTimes(const PoseStream& stream, const std::filesystem::path& file,
                                 std::vector<PoseRow> timed);

// Reads the times of images: a table of images, named by a column `image` or by one for each camera, and of times.
std::vector<PoseRow> ReadTimes(const std::filesystem::path& file, const std::vector<std::string>& cameras);

// Reads `time_offset` of the section `refine`, s; nothing if it is to be estimated, or if there is no stream.
std::optional<double> ReadTimeOffset(MapReader& refine, bool has_stream);

}  // namespace heba
