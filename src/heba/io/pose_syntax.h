// Poses in the text of robots' programs and of what ROS prints, by the syntaxes of pose_syntaxes.def.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace heba {

// The poses that a text contains in one syntax, in the order of the text.
struct WrittenPoses {
  std::string pose_format;  // Name in pose_formats.def.
  std::vector<std::vector<double>> rows;
  std::vector<int> lines;  // The line at which each pose begins, from 1.
  // The line of a pose that breaks off after its first number, such as one with a misspelt number; 0 if there is none.
  int broken_line = 0;
};

// Returns the poses of the syntax that occurs most often; none if no syntax occurs.
WrittenPoses FindWrittenPoses(std::string_view text);

}  // namespace heba
