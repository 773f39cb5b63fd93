// Every flag of the program; commands.def says which command takes which.
#pragma once

#include <gflags/gflags_declare.h>

DECLARE_string(out);
DECLARE_int32(jobs);
DECLARE_bool(quiet);
DECLARE_double(dpi);
DECLARE_string(shard);

namespace heba {

// The number of threads that --jobs asks for.
int NumThreads();

}  // namespace heba
