// SPDX-License-Identifier: Apache-2.0
// fake_node: replaces a node in the tests of the supervisor. It writes one line when it has started
// and one for each SIGTERM or SIGINT into the named pipe `events` of its folder. A file NAME.does
// in that folder with one of the words below makes it misbehave: "saturates" from SIGUSR1 on, with
// SCHED_FIFO; "lingers": never ends by itself, and has a thread that needs a processor to die. What
// it leaves behind holds the pipe open.
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

int main(int argc, char** argv) {
  const std::filesystem::path self = argv[0];
  std::string does;
  std::ifstream(self.string() + ".does") >> does;
  if (does == "refuses") return 2;
  if (does == "fails") return 1;

  sigset_t stop;
  sigemptyset(&stop);
  sigaddset(&stop, SIGTERM);
  sigaddset(&stop, SIGINT);
  sigaddset(&stop, SIGUSR1);
  sigprocmask(SIG_BLOCK, &stop, nullptr);

  const int events = open((self.parent_path() / "events").c_str(), O_WRONLY);
  const auto report = [&](const std::string& what) {
    const std::string line = self.filename().string() + " " + what + "\n";
    return write(events, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  };

  std::string started = "started " + std::to_string(getpid());
  for (int i = 1; i < argc; ++i) started += std::string(" ") + argv[i];
  if (!report(started)) return 1;
  if (does == "leaves_a_process" && fork() == 0) {
    constexpr unsigned kLongest_s = 600;  // if nobody ends it
    sleep(kLongest_s);
    _exit(0);
  }

  int signal = 0;
  if (does == "saturates") {
    const sched_param priority{.sched_priority = 5};
    sched_setscheduler(0, SCHED_FIFO, &priority);
    if (!report("ready")) return 1;
    sigwait(&stop, &signal);
    // a tick that is always late: it never sleeps, and its equals have their turn after it
    const timespec at_once{};
    while (signal != SIGTERM) {
      signal = sigtimedwait(&stop, nullptr, &at_once);
      sched_yield();
    }
    return report("signal " + std::to_string(signal)) ? 0 : 1;
  }
  if (does == "lingers") {
    std::thread([] {
      const sched_param least{.sched_priority = 1};
      sched_setscheduler(0, SCHED_FIFO, &least);
      while (true) pause();
    }).detach();
    if (!report("ready")) return 1;
    do {
      sigwait(&stop, &signal);
    } while (signal != SIGTERM);
    report("signal " + std::to_string(signal));
    while (true) pause();
  }
  do {
    sigwait(&stop, &signal);
    if (!report("signal " + std::to_string(signal))) return 1;
  } while (does == "does_not_stop");
  return 0;
}
