// A run config with comments for people, as `heba init` and `heba import` write it.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace heba {

// Returns a config in which `values` are set, each under its key with mappings, such as captures.images, and written as
// YAML. Every key has its meaning as a comment. A required key without a value, and the optional keys that most cells
// want to change, are comments themselves. `remarks` are comments at the beginning.
std::string CommentedConfig(const std::map<std::string, std::string>& values, const std::vector<std::string>& remarks);

// Returns whether a text is a config that CommentedConfig wrote, if with changes.
bool IsCommentedConfig(const std::string& text);

}  // namespace heba
