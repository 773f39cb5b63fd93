#include "heba/io/import.h"

#include <algorithm>

#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {

#define HEBA_IMPORT_FORMAT(name, description) ImportReader ImportReader_##name();
#include "heba/io/import_formats.def"
#undef HEBA_IMPORT_FORMAT

const std::vector<ImportFormat>& ImportFormats() {
  static const std::vector<ImportFormat> formats = {
#define HEBA_IMPORT_FORMAT(name, description) {#name, description, ImportReader_##name()},
#include "heba/io/import_formats.def"
#undef HEBA_IMPORT_FORMAT
  };
  return formats;
}

std::vector<std::string> ImportFormatNames() { return NamesOf(ImportFormats()); }

const ImportFormat* FindImportFormat(const std::filesystem::path& source) {
  const auto found = std::find_if(ImportFormats().begin(), ImportFormats().end(),
                                  [&](const ImportFormat& format) { return format.reader.matches(source); });
  return found == ImportFormats().end() ? nullptr : &*found;
}

namespace {

ImportedSet FindAndRead(const std::filesystem::path& source, std::string_view name) {
  std::error_code error;
  if (!std::filesystem::exists(source, error)) throw InputError(source.string() + ": no such file or folder");
  const ImportFormat* format = name.empty() ? FindImportFormat(source) : FindEntry(ImportFormats(), name);
  if (format == nullptr && !name.empty()) {
    throw InputError(source.string() + ": the format " + UnknownName(name, ImportFormatNames()));
  }
  if (format == nullptr) {
    throw InputError(source.string() +
                     ": is not a data set in a known format; one of: " + Join(ImportFormatNames(), ", "));
  }
  ImportedSet set = format->reader.read(source);
  set.format = format->name;
  return set;
}

}  // namespace

ImportedSet ImportDataSet(const std::filesystem::path& source, std::string_view name) {
  ImportedSet set;
  try {
    set = FindAndRead(source, name);
  } catch (const std::filesystem::filesystem_error& fault) {
    // A data set may name a file whose existence cannot even be checked.
    throw InputError(source.string() + ": " + Quoted(fault.path1().string()) + ": " + fault.code().message());
  }
  if (set.camera) {
    Camera checked = *set.camera;
    if (checked.width_px == 0 && checked.height_px == 0) checked.width_px = checked.height_px = 1;
    const std::string faults = CheckCamera(checked);
    if (!faults.empty()) throw InputError(source.string() + ": the camera: " + faults);
  }
  if (set.captures.empty()) throw InputError(source.string() + ": contains no captures");
  std::vector<std::string> names;
  for (const ImportedCapture& capture : set.captures) names.push_back(capture.name);
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice != names.end()) throw InputError(source.string() + ": two captures have the name " + Quoted(*twice));
  return set;
}

}  // namespace heba
