#include <csignal>
#include <cstdio>
#include <thread>

#include <unistd.h>

#include <glog/logging.h>

#include "tools/cli/command.h"
#include "tools/files/result_folder.h"

namespace {

// Ctrl-C and SIGTERM end the program without half a result. They are waited for by a thread of its own, so that it may
// do what a signal's handler must not. A reader that goes away is an error of writing and no signal.
void WatchForInterruption() {
  std::signal(SIGPIPE, SIG_IGN);
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread([signals] {
    int signal = 0;
    if (sigwait(&signals, &signal) != 0) return;
    heba::AbandonStaging();
    std::fputs("heba: error: interrupted\n", stderr);
    constexpr int kBySignal = 128;
    _exit(kBySignal + signal);
  }).detach();
}

}  // namespace

int main(int argc, char** argv) {
  WatchForInterruption();
  // Ceres warns through glog; what matters of it reaches the user as an error or a remark of ours.
  FLAGS_logtostderr = true;
  FLAGS_minloglevel = google::GLOG_ERROR;
  google::InitGoogleLogging(argv[0]);
  return heba::RunCommandLine(argc, argv);
}
