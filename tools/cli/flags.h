// Declares every flag of the program; commands.def lists the flags of each command.
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
DECLARE_string(paper);
DECLARE_bool(suggest);
DECLARE_string(target_type);
DECLARE_string(distance);
DECLARE_string(camera);
DECLARE_string(shard);
DECLARE_string(set);
DECLARE_bool(resume);
DECLARE_string(fail_on);
DECLARE_bool(strict);
DECLARE_string(to);
DECLARE_string(method);
DECLARE_string(parent);
DECLARE_string(child);
DECLARE_string(child_is);
DECLARE_bool(force);
DECLARE_bool(inverse);
DECLARE_string(units);
DECLARE_string(pose);
DECLARE_string(joints);
DECLARE_string(near);
DECLARE_string(robot);
DECLARE_string(arm);
DECLARE_string(format);
DECLARE_string(target);
DECLARE_string(images);
DECLARE_string(poses);
DECLARE_string(pose_format);
DECLARE_string(setup);
DECLARE_string(pixels);
DECLARE_string(plane);
DECLARE_bool(any);
DECLARE_bool(json);
DECLARE_string(history);
DECLARE_string(reference);
DECLARE_int32(count);
DECLARE_string(tool);
DECLARE_string(grasp);
DECLARE_string(procedure);

namespace heba {

// Separates the values of a flag that may be given several times.
inline constexpr char kSettingSeparator = '\n';

// Returns the number of threads that --jobs requests. Throws InputError if it is out of range.
int NumThreads();

// Returns the values of all --set flags, in order.
std::vector<std::string> Settings();

// Returns the verdict from which on --fail-on makes a run end with exit status 1; nothing without the flag. Throws
// InputError if the flag names no such verdict.
std::optional<Grade> FailOn();

// Returns the part of the work that --shard requests, or all of it without the flag. Throws InputError if it is
// malformed.
Shard ParseShard();

}  // namespace heba
