#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/scene_config.h"
#include "tools/pipeline/data_set.h"
#include "tools/text/console.h"

namespace heba {
int RunCommand_simulate(const std::vector<std::string>& arguments) {
  if (FLAGS_out.empty()) throw InputError("'heba simulate' needs --out DIR");
  const std::string& path = arguments[0];
  const SceneConfig scene = ReadSceneConfig(path, Settings());
  RefuseArms(scene, path);
  const Outcome<int> num_images =
      WriteDataSet(scene, FLAGS_out, NumThreads(), FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  if (!num_images) {
    PrintError(path + ": " + num_images.reason());
    return kWorkFailed;
  }
  if (!FLAGS_quiet) {
    std::cout << *num_images << " images with ground truth in " << FLAGS_out << "; next: heba run "
              << (std::filesystem::path(FLAGS_out) / "config.yaml").string() << std::endl;
  }
  return kDone;
}

}  // namespace heba
