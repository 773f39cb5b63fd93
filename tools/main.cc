#include <glog/logging.h>

#include "tools/command.h"

int main(int argc, char** argv) {
  // Ceres warns through glog; what matters of it reaches the user as an error or a remark of ours.
  FLAGS_logtostderr = true;
  FLAGS_minloglevel = google::GLOG_ERROR;
  google::InitGoogleLogging(argv[0]);
  return heba::RunCommandLine(argc, argv);
}
