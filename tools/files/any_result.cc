#include "tools/files/any_result.h"

#include "heba/io/result_file.h"

namespace heba {

AnyResult ReadAnyResult(const std::filesystem::path& file) {
  if (IsRigResult(file)) return ReadRigResult(file);
  return ReadResult(file);
}

}  // namespace heba
