#include <csignal>
#include <cstdio>
#include <thread>

#include <unistd.h>

#include <glog/logging.h>

#include "heba/base/memory.h"
#include "tools/cli/command.h"
#include "tools/files/result_folder.h"

namespace {

// Ends the program on SIGINT, SIGTERM and SIGHUP without leaving half a result behind. A thread of its own waits for
// the signals, so that it may call functions that a signal handler must not. SIGPIPE is ignored: a closed pipe is
// reported as a write error.
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
  heba::KeepFreedMemory();
  WatchForInterruption();
  // Ceres warns through glog; the relevant warnings reach the user as errors or remarks of heba.
  FLAGS_logtostderr = true;
  FLAGS_minloglevel = google::GLOG_ERROR;
  google::InitGoogleLogging(argv[0]);
  return heba::RunCommandLine(argc, argv);
}
