#include "tools/config/file_kind.h"

#include <optional>
#include <string>

#include "heba/base/error.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the kind that the keys indicate; nothing if they indicate none.
std::optional<FileKind> KindOf(const ConfigValue& value) {
  if (!value.IsMap()) return std::nullopt;
  MapReader reader(value);
  if (reader.Has("scenes")) return FileKind::kStudy;
  if (reader.Has("captures")) return FileKind::kRunConfig;
  if (reader.Has("motion") || (reader.Has("hand_eye") && reader.Has("board"))) return FileKind::kScene;
  if (reader.Has("type") || reader.Has("target_type")) return FileKind::kTarget;
  if (reader.Has("fx") || reader.Has("camera_matrix")) return FileKind::kCamera;
  return std::nullopt;
}

// Describes a kind and its use.
std::string UseOf(FileKind kind) {
  switch (kind) {
    case FileKind::kRunConfig:
      return "a run config; use 'heba run'";
    case FileKind::kScene:
      return "a scene; use 'heba simulate'";
    case FileKind::kStudy:
      return "a study; use 'heba study'";
    case FileKind::kTarget:
      return "a target, which a run config or a scene names; 'heba target' draws it";
    case FileKind::kCamera:
      return "a camera, which a run config names (camera.intrinsics)";
  }
  return "";
}

}  // namespace

void RefuseFolder(const fs::path& path, FileKind kind) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return;
  const fs::path meant = path / (kind == FileKind::kRunConfig ? "config.yaml"
                                 : kind == FileKind::kScene   ? "scene.yaml"
                                 : kind == FileKind::kStudy   ? "study.yaml"
                                                              : "target.yaml");
  if (fs::is_regular_file(meant, error)) {
    throw InputError(path.string() + ": this is a folder; did you mean " + meant.string() + "?");
  }
  throw InputError(path.string() + ": this is a folder; a file is needed" +
                   (kind == FileKind::kRunConfig ? ", which 'heba init " + path.string() + "' writes" : ""));
}

void RefuseOtherKind(const ConfigValue& value, const fs::path& path, FileKind kind) {
  const std::optional<FileKind> actual = KindOf(value);
  if (actual && *actual != kind) throw InputError(path.string() + ": this is " + UseOf(*actual));
}

}  // namespace heba
