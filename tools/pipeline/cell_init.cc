#include "tools/pipeline/cell_init.h"

#include <vector>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/data/setup.h"
#include "heba/io/camera_file.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"
#include "heba/target.h"
#include "tools/config/commented_config.h"
#include "tools/pipeline/shown_target.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

void RefuseToReplace(const InitRequest& request, const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return;
  if (request.replaces_own && fs::is_regular_file(file, error) && IsCommentedConfig(ReadTextFile(file))) return;
  throw InputError(
      file.string() + ": exists already; remove it, or name another file (" + request.option("out", "") + ")" +
      (request.replaces_own ? "; " + request.option("force", "") + " replaces only what 'heba init' wrote" : ""));
}

// Returns where to write the target's keys: target.yaml beside the config, or a file that is named after the config if
// that one has other content.
fs::path TargetFileFor(const InitRequest& request) {
  const fs::path folder = request.config.parent_path();
  std::error_code error;
  const auto is_other = [&](const fs::path& path) {
    return fs::exists(path, error) && ReadTextFile(path) != request.target_keys;
  };
  const fs::path file = folder / "target.yaml";
  if (!is_other(file)) return file;
  const fs::path named = folder / (request.config.stem().string() + ".target.yaml");
  if (is_other(named)) RefuseToReplace(request, named);
  return named;
}

// Returns whether a data set of another project has several cameras. One that cannot be read has none.
bool HasSeveralCameras(const fs::path& folder, const ImportFormat& format) {
  try {
    return format.reader.read_rig != nullptr && ImportCell(folder, format.name).has_value();
  } catch (const InputError&) {
    return false;
  }
}

// Writes the target's keys, if there are any, and then the config that `make` makes of the files with this target;
// both, or none if the config does not fit.
template <class Make>
std::optional<RawConfig> WrittenWithTarget(const InitRequest& request, RawFolder files, const Make& make) {
  fs::path new_target;
  std::error_code error;
  if (!request.target_keys.empty()) {
    ParseTarget(request.target_keys);  // A fault is reported before a file is written.
    files.target = TargetFileFor(request);
    if (!fs::exists(*files.target, error)) new_target = *files.target;
    WriteFileAtomically(*files.target, request.target_keys);
  }
  std::optional<RawConfig> made;
  try {
    made = make(files);
    if (made && made->fits) WriteFileAtomically(request.config, made->text);
    if (made && !request.target_keys.empty()) made->target = *files.target;
  } catch (...) {
    if (!new_target.empty()) fs::remove(new_target, error);
    throw;
  }
  if ((!made || !made->fits) && !new_target.empty()) fs::remove(new_target, error);
  return made;
}

}  // namespace

InitRequest RequestOf(const fs::path& folder, const fs::path& config, const StatedFiles& stated, bool replaces_own,
                      decltype(InitRequest::option) option) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw InputError(folder.string() + ": no such folder");
  const auto existing = [&](const std::string& name, const std::string& path) -> fs::path {
    if (path.empty() || fs::exists(path, error)) return path;
    throw InputError(option(name, "") + ": " + path + ": no such file or folder");
  };
  InitRequest request;
  request.folder = folder;
  request.config = config.empty() ? folder / "config.yaml" : config;
  request.replaces_own = replaces_own;
  request.option = option;
  RefuseToReplace(request, request.config);
  request.given.images = existing("images", stated.images);
  request.given.poses = existing("poses", stated.poses);
  if (!stated.camera.empty()) {
    request.given.camera = existing("camera", stated.camera);
    ReadCameraFile(*request.given.camera);  // A fault is reported before a file is written.
  }
  if (!stated.setup.empty()) {
    request.given.setup = FindSetup(stated.setup);
    if (!request.given.setup) {
      throw InputError(option("setup", "") + ": " + UnknownName(stated.setup, SetupNames()));
    }
  }
  const bool has_keys = stated.target.find('{') != std::string::npos;
  if (has_keys) request.target_keys = stated.target + "\n";
  if (!has_keys && !stated.target.empty()) request.given.target = existing("target", stated.target);
  return request;
}

std::optional<RawConfig> InitDataSet(const InitRequest& request, int num_threads) {
  const ImportFormat* const format = FindImportFormat(request.folder);
  if (format == nullptr) return std::nullopt;
  if (HasSeveralCameras(request.folder, *format)) {
    throw InputError(request.folder.string() + ": is a data set of several cameras of " + std::string(format->name) +
                     "; 'heba import " + request.folder.string() + " --out DIR' converts it");
  }
  return WrittenWithTarget(request, request.given, [&](const RawFolder& files) {
    return ConfigOfDataSet(request.folder, files, request.config, num_threads);
  });
}

RawFolder FilesToRead(const InitRequest& request) {
  RawFolder files = FindRawFiles(request.folder, request.given);
  if (files.num_images == 0) {
    throw InputError((files.images.empty() ? request.folder : files.images).string() +
                     ": contains no images; name their folder (" + request.option("images", "") + ")");
  }
  if (!files.found.empty()) return files;
  throw InputError((files.poses.empty() ? request.folder.string() + ": contains no robot poses; name their file (" +
                                              request.option("poses", "") + ")"
                                        : files.poses.string() + ": contains no robot poses") +
                   "; 'heba help poses' describes what it may contain");
}

void CheckTarget(const InitRequest& request, const RawFolder& files, int num_threads) {
  if (files.target || !request.target_keys.empty()) return;
  const std::string seen = ShownTarget(ImagesOf(files.images), num_threads);
  throw InputError(
      request.folder.string() + ": contains no target file; " +
      (seen.empty()
           ? "name it (" + request.option("target", "TARGET.yaml") + ") or state the keys, such as " +
                 request.option("target", "{type: chessboard, rows: 6, columns: 9, square: 25 mm}")
           : "the images show " + request.option("target", seen) + ": state it with its size in place of SIZE"));
}

RawConfig InitFolder(const InitRequest& request, const RawFolder& files, int num_threads) {
  return *WrittenWithTarget(request, files, [&](const RawFolder& with_target) {
    return std::optional<RawConfig>(ConfigOf(with_target, request.config, num_threads));
  });
}

std::string WhyNoConfig(const RawConfig& made) {
  if (made.fits) return "";
  return Join(made.warnings.empty() ? made.remarks : made.warnings, "; ");
}

}  // namespace heba
