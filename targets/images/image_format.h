// Inspects the bytes of an image file before a decoder does. The formats that are read are those of formats.def, each
// recognised by its first bytes.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "targets/images/formats/format.h"

namespace heba {

// Returns the format of an image file, or of the files with this suffix (".png"); nullptr if heba does not read the
// one, or write the other.
const ImageFormat* FormatOf(std::string_view bytes);
const ImageFormat* FormatOfSuffix(std::string_view suffix);

// Reads the header of an image file; returns nothing if its format is not supported.
std::optional<ImageHeader> ReadImageHeader(std::string_view bytes);

// Returns the names of the supported formats: "PNG, JPEG, ...".
std::string ImageFormatNames();

// Returns the name of a known format that heba does not read, with its article: "a WebP"; empty if the file is of none.
std::string_view UnreadFormatName(std::string_view bytes);

}  // namespace heba
