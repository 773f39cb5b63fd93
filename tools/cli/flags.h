// Every flag of the program; commands.def says which command takes which.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <gflags/gflags_declare.h>

#include "heba/evaluation/finding.h"
#include "tools/batch/batch.h"

DECLARE_string(out);
DECLARE_int32(jobs);
DECLARE_bool(quiet);
DECLARE_double(dpi);
DECLARE_string(shard);
DECLARE_string(set);
DECLARE_bool(resume);
DECLARE_string(fail_on);
DECLARE_string(to);
DECLARE_string(method);
DECLARE_string(parent);
DECLARE_string(child);
DECLARE_string(child_is);
DECLARE_bool(inverse);
DECLARE_string(units);
DECLARE_string(pose);
DECLARE_string(near);
DECLARE_string(robot);
DECLARE_string(format);
DECLARE_string(target);
DECLARE_string(pixels);
DECLARE_string(plane);

namespace heba {

// Between several values of a flag that may stand more than once.
inline constexpr char kSettingSeparator = '\n';

// The number of threads that --jobs asks for.
int NumThreads();

// What every --set said, in order.
std::vector<std::string> Settings();

// The verdict from which on --fail-on makes a run end with status 1; nothing without it.
std::optional<Grade> FailOn();

// The part of the work that --shard asks for; all of it without the flag.
Shard ParseShard();

}  // namespace heba
