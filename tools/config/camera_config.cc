#include "tools/config/camera_config.h"

#include <algorithm>
#include <set>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/camera/camera_model.h"
#include "solvers/residuals/loss.h"
#include "tools/config/common_keys.h"
#include "tools/config/file_kind.h"
#include "tools/config/image_list.h"
#include "tools/config/long_form.h"
#include "tools/config/run_config.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// Returns the images without those that `exclude` names.
std::vector<fs::path> ReadImages(MapReader& captures) {
  const ConfigValue value = captures.Get("images");
  std::vector<fs::path> images = FindImages(value);
  captures.Record("images", ImagesNode(value, images));
  const std::optional<ConfigValue> list = captures.Find("exclude");
  if (!list) return images;
  std::vector<std::string> names;
  for (const fs::path& image : images) names.push_back(image.filename().string());
  std::set<std::string> excluded;
  for (const ConfigValue& item : list->AsList()) {
    const std::string name = item.AsText();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      item.Fail("there is no image " + Quoted(name) + DidYouMean(name, names));
    }
    excluded.insert(name);
  }
  captures.Record("exclude", list->node());
  std::erase_if(images, [&](const fs::path& image) { return excluded.contains(image.filename().string()); });
  if (images.empty()) list->Fail("leaves out all images");
  return images;
}

// Returns the model that the section `camera` of a config states; empty if it is to be chosen. A file of intrinsics
// states none: they are calibrated anew.
std::string StatedModel(const ConfigValue& value) {
  MapReader root(value);
  MapReader camera = root.Section("camera");
  const std::string model = camera.Has("model") ? camera.Get("model").AsText() : "auto";
  return model == "auto" ? "" : model;
}

// Returns what the config of a run says about its camera, whose model is stated or empty.
CameraConfig FromRun(const RunConfig& run, const std::string& model) {
  CameraConfig config;
  config.file = run.file;
  config.name = run.data.name;
  config.about = run.data.about;
  config.target = run.data.targets.front();
  config.target_used = run.targets_used.front();
  for (const Recording& capture : run.data.captures) {
    const fs::path& image = capture.images.front();
    if (image.empty() || !run.data.given_detections.empty()) {
      throw InputError(run.file.string() + ": a camera is calibrated from images");
    }
    config.images.push_back(image);
  }
  config.options.model = model;
  config.options.choose_bend = run.options.calibration.choose_target_shape;
  config.options.loss = run.options.calibration.adjustment.loss;
  config.options.folds = run.options.folds;
  config.output = run.output.parent_path() / (run.data.name + "_camera");
  config.used = run.used;
  return config;
}

}  // namespace

CameraConfig ReadCameraConfig(const fs::path& path, const std::vector<std::string>& settings) {
  RefuseFolder(path, FileKind::kRunConfig);
  const ConfigValue file = ReadYamlFileOverBases(path, {"name", "output"});
  const ConfigValue value = settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
  if (HasLongForm(value)) {
    throw InputError(path.string() +
                     ": has several cameras or targets; a config of one camera and one target is needed");
  }
  RefuseOtherKind(value, path, FileKind::kRunConfig);
  MapReader reader(value);
  MapReader captures(reader.Get("captures"));
  for (const char* key : {"poses", "data", "detections", "target_poses"}) {
    if (captures.Has(key)) return FromRun(ReadShortRunConfig(path, settings), StatedModel(value));
  }
  CameraConfig config;
  config.file = path;
  config.name = ReadFolderName(reader, path.stem().string());
  config.about = ReadAbout(reader);
  config.target = ReadTarget(reader, "target");
  config.target_used = YAML::Dump(reader.used()["target"]);
  MapReader camera = reader.Section("camera");
  std::vector<std::string> models = CameraModelNames();
  models.emplace_back("auto");
  const std::string model = camera.Choice("model", models, "auto");
  config.options.model = model == "auto" ? "" : model;
  camera.Finish();
  reader.Record("camera", camera.used());
  config.images = ReadImages(captures);
  captures.Finish();
  reader.Record("captures", captures.used());
  MapReader refine = reader.Section("refine");
  config.options.choose_bend = refine.Choice("target_shape", {"auto", "none"}, "auto") == "auto";
  config.options.loss = *FindLossKind(refine.Choice("loss", LossNames(), "truncated"));
  refine.Finish();
  reader.Record("refine", refine.used());
  MapReader evaluate = reader.Section("evaluate");
  config.options.folds = evaluate.Int("folds", {0, 1000000}, 5);
  if (config.options.folds == 1)
    evaluate.Get("folds").Fail("one fold leaves no training data; use 0 for none, or at least 2");
  evaluate.Finish();
  reader.Record("evaluate", evaluate.used());
  config.output = ReadOutput(reader, fs::absolute(path).parent_path() / "runs" / config.name);
  reader.Finish();
  config.used = UsedText(reader);
  return config;
}

}  // namespace heba
