#include <iostream>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "tools/cli/command.h"
#include "tools/files/detection_cache.h"
#include "tools/text/console.h"

namespace heba {
namespace {

std::string SizeText(const CacheSize& size) {
  return std::to_string(size.num_entries) + " detections, " + Fixed(size.bytes / 1e6, 1) + " MB";
}

}  // namespace

int RunCommand_cache(const std::vector<std::string>& arguments) {
  const std::string& what = arguments[0];
  if (what != "show" && what != "clear") {
    throw InputError("heba cache: " + UnknownName(what, {"show", "clear"}));
  }
  const std::filesystem::path folder = CacheFolder();
  if (folder.empty()) {
    std::cout << "no detections are kept (HEBA_CACHE is empty)" << std::endl;
    return kDone;
  }
  if (what == "clear") {
    std::cout << ForTerminal(folder.string() + ": removed " + SizeText(TrimCache(-1))) << std::endl;
    return kDone;
  }
  std::cout << ForTerminal(folder.string() + ": " + SizeText(SizeOfCache()) + "; at most " +
                           Fixed(LargestCacheBytes() / 1e6, 0) +
                           " MB are kept (HEBA_CACHE_MB), the most recently used ones")
            << std::endl;
  return kDone;
}

}  // namespace heba
