// Files of nested values as one kind of tree: JSON, YAML with one or several documents, OpenCV's FileStorage, XML,
// NumPy's .npy and .npz, and lists and matrices as Python and NumPy print them.
#pragma once

#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

namespace heba {

using RecordTree = nlohmann::ordered_json;

// Reads a file by its suffix (.json, .jsonl, .yaml, .yml, .xml, .npy, .npz) or, with another suffix, as a text in which
// numbers stand in brackets, or as 4 x 4 matrices in lines of 4 numbers.
//
// Several YAML documents, and the lines of a .jsonl, are a list. A matrix of FileStorage is a list of its rows. The
// elements of XML are objects with their attributes and elements as members; members of one name are a list, and a text
// of numbers is a list of them. The arrays of a .npz are the members of an object.
//
// Returns nothing if the text has no such values. Throws InputError if the file cannot be read, is larger than 64 MiB
// or has more than 20 million values, or if it is not valid in the form that its suffix names.
std::optional<RecordTree> ReadRecordTree(const std::filesystem::path& file);

}  // namespace heba
