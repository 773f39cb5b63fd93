#include "tools/pipeline/watch.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/text/console.h"

namespace heba {

int RunCommand_watch(const std::vector<std::string>& arguments) {
  WatchOptions options;
  if (!FLAGS_out.empty()) options.output = std::filesystem::absolute(FLAGS_out);
  options.settings = Settings();
  options.num_threads = NumThreads();
  Watch(arguments[0], options);
  return kDone;
}

}  // namespace heba
