#include "heba/io/import.h"

#include <algorithm>
#include <cctype>

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

std::vector<std::string> DataSetFormatNames() {
  std::vector<ImportFormat> formats = ImportFormats();
  std::erase_if(formats, [](const ImportFormat& format) { return format.reader.read == nullptr; });
  return NamesOf(formats);
}

const ImportFormat* FindImportFormat(const std::filesystem::path& source) {
  const auto found = std::find_if(ImportFormats().begin(), ImportFormats().end(),
                                  [&](const ImportFormat& format) { return format.reader.matches(source); });
  return found == ImportFormats().end() ? nullptr : &*found;
}

namespace {

const ImportFormat& FindFormat(const std::filesystem::path& source, std::string_view name) {
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
  return *format;
}

ImportedSet FindAndRead(const std::filesystem::path& source, std::string_view name) {
  const ImportFormat& format = FindFormat(source, name);
  if (format.reader.read == nullptr) {
    throw InputError(source.string() + ": the format " + std::string(format.name) +
                     " has cameras but no captures; 'heba import' writes a config of a rig from it");
  }
  ImportedSet set = format.reader.read(source);
  set.format = format.name;
  return set;
}

std::optional<ImportedCell> FindAndReadCell(const std::filesystem::path& source, std::string_view name) {
  const ImportFormat& format = FindFormat(source, name);
  if (format.reader.read_rig == nullptr) return std::nullopt;
  std::optional<ImportedCell> rig = format.reader.read_rig(source);
  if (rig) rig->format = format.name;
  return rig;
}

// Throws InputError if the camera is faulty.
void Check(const Camera& camera, const std::string& where) {
  std::string faults = CheckCamera(camera);
  std::replace(faults.begin(), faults.end(), '\n', ';');
  if (!faults.empty()) throw InputError(where + ": " + faults);
}

// Calls a function that reads `source`. A data set may name a file whose existence cannot even be checked.
template <class Read>
auto WithFileErrors(const std::filesystem::path& source, const Read& read) {
  try {
    return read();
  } catch (const std::filesystem::filesystem_error& fault) {
    throw InputError(source.string() + ": " + Quoted(fault.path1().string()) + ": " + fault.code().message());
  }
}

}  // namespace

ImportedSet ImportDataSet(const std::filesystem::path& source, std::string_view name) {
  ImportedSet set = WithFileErrors(source, [&] { return FindAndRead(source, name); });
  if (set.camera) {
    Camera checked = *set.camera;
    if (checked.width_px == 0 && checked.height_px == 0) checked.width_px = checked.height_px = 1;
    Check(checked, source.string() + ": the camera");
  }
  if (set.captures.empty()) throw InputError(source.string() + ": contains no captures");
  std::vector<std::string> names;
  for (const ImportedCapture& capture : set.captures) names.push_back(capture.name);
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice != names.end()) throw InputError(source.string() + ": two captures have the name " + Quoted(*twice));
  return set;
}

std::optional<ImportedCell> ImportCell(const std::filesystem::path& source, std::string_view name) {
  std::optional<ImportedCell> rig = WithFileErrors(source, [&] { return FindAndReadCell(source, name); });
  if (!rig) return rig;
  for (const ImportedCamera& camera : rig->cameras) {
    const bool is_plain = std::all_of(camera.name.begin(), camera.name.end(),
                                      [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
    if (!is_plain) {
      throw InputError(source.string() + ": a config cannot have a camera called " + Quoted(camera.name) +
                       "; a name has letters, digits, _ and - only");
    }
    if (camera.camera) Check(*camera.camera, source.string() + ": the camera " + camera.name);
  }
  return rig;
}

}  // namespace heba
