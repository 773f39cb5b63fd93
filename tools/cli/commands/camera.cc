#include <iostream>

#include "heba/base/error.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/pipeline/camera_pipeline.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"

namespace heba {

int RunCommand_camera(const std::vector<std::string>& arguments) {
  const CameraConfig config = ReadCameraConfig(arguments[0], Settings());
  const std::filesystem::path output = FLAGS_out.empty() ? config.output : std::filesystem::absolute(FLAGS_out);
  Console console(FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  const Outcome<CalibratedCamera> result = RunCamera(config, output, NumThreads(), &console);
  if (!result) {
    PrintError(arguments[0] + ": " + FailureText(result.failure()));
    return kWorkFailed;
  }
  if (!FLAGS_quiet) {
    std::cout << ForTerminal(CameraTable(result->calibration, result->map)) << "results: " << output.string()
              << std::endl;
  }
  return kDone;
}

}  // namespace heba
