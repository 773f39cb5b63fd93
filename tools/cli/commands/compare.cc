#include <filesystem>
#include <iostream>

#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/pages/comparison_files.h"
#include "tools/text/console.h"

namespace heba {

int RunCommand_compare(const std::vector<std::string>& arguments) {
  const Comparison comparison = CompareRuns(ReadComparedRuns({arguments.begin(), arguments.end()}));
  if (!FLAGS_quiet) std::cout << ForTerminal(ComparisonTable(comparison));
  if (FLAGS_out.empty()) return kDone;
  WriteComparison(comparison, FLAGS_out);
  if (!FLAGS_quiet) std::cout << "results: " << std::filesystem::absolute(FLAGS_out).string() << std::endl;
  return kDone;
}

}  // namespace heba
