#include "tools/files/any_result.h"

#include "heba/io/result_file.h"

namespace heba {

AnyResult ReadAnyResult(const std::filesystem::path& file) {
  if (IsLongResult(file)) return ReadRunResult(file);
  return ReadPairResult(file);
}

}  // namespace heba
