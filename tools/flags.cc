#include "tools/flags.h"

#include <gflags/gflags.h>

#include "heba/base/error.h"
#include "heba/base/parallel.h"

DEFINE_string(out, "", "where the results go");
DEFINE_int32(jobs, 0, "threads to use; 0 for one a processor");
DEFINE_bool(quiet, false, "no progress and no table");
DEFINE_string(shard, "", "I/N: the part I, from 0 to N - 1, of N");
DEFINE_double(dpi, 300, "resolution of a .png sheet");

namespace heba {

int NumThreads() {
  if (FLAGS_jobs < 0) throw InputError("--jobs must not be negative");
  return FLAGS_jobs == 0 ? NumProcessors() : FLAGS_jobs;
}

}  // namespace heba
