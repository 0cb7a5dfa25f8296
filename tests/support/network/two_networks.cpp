// SPDX-License-Identifier: Apache-2.0
#include "tests/support/network/two_networks.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include "tests/support/program.h"

namespace palpate::test {
namespace {

constexpr const char* kIp = "/usr/sbin/ip";
constexpr const char* kTc = "/usr/sbin/tc";

/// Returns the reason of a failure; "" on success.
std::string write_file(const char* file, const std::string& text) {
  std::ofstream out(file);
  out << text << std::flush;
  return out ? "" : std::string("cannot write ") + file;
}

/// Runs it in that network; −1: in this one.
bool run(const char* program, int network, const std::string& text) {
  std::vector<std::string> arguments;
  std::istringstream words(text);
  for (std::string word; words >> word;) arguments.push_back(word);
  return Program(program, arguments, network).wait() == 0;
}

/// `ip addr add …` of the workstation.
std::string address(const std::string& what) {
  return "addr " + what + " " + TwoNetworks::kWorkstation + "/24 dev work";
}

}  // namespace

std::string TwoNetworks::make() {
  const uid_t uid = getuid();
  const gid_t gid = getgid();
  if (access(kIp, X_OK) != 0) return std::string(kIp).append(" is not installed (iproute2)");
  if (uid == 0) {
    if (unshare(CLONE_NEWNET) != 0) return "a network namespace is not permitted";
  } else {
    // become root of a new user namespace
    if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return "namespaces are not permitted";
    write_file("/proc/self/setgroups", "deny");
    if (auto why = write_file("/proc/self/uid_map", "0 " + std::to_string(uid) + " 1");
        !why.empty()) {
      return why;
    }
    if (auto why = write_file("/proc/self/gid_map", "0 " + std::to_string(gid) + " 1");
        !why.empty()) {
      return why;
    }
  }
  int ready[2];
  if (pipe2(ready, O_CLOEXEC) != 0) return "no pipe";
  child_ = fork();
  if (child_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const char answer = unshare(CLONE_NEWNET) == 0 ? 'y' : 'n';
    if (write(ready[1], &answer, 1) != 1) _exit(1);
    for (;;) pause();
  }
  char answer = 'n';
  const bool is_answered = read(ready[0], &answer, 1) == 1;
  close(ready[0]);
  close(ready[1]);
  if (!is_answered || answer != 'y') return "a second network namespace is not permitted";
  workstation_ =
      open(("/proc/" + std::to_string(child_) + "/ns/net").c_str(), O_RDONLY | O_CLOEXEC);
  for (const int network : {-1, workstation_}) {
    if (!run(kIp, network, "link set lo up")) return "ip link set lo up failed";
  }
  return "";
}

std::string TwoNetworks::connect(const std::optional<PacketDisturbance>& disturbance) {
  if (cable_.starts_with("veth")) {
    if (!run(kIp, -1, "link del bedside")) return "ip link del bedside failed";
  }
  relay_.reset();  // its devices disappear with it
  cable_ = "veth";
  if (!run(kIp, -1, "link add bedside type veth peer name work netns " + std::to_string(child_))) {
    return "a veth pair is not permitted";
  }
  if (disturbance && add_netem(*disturbance)) {
    cable_ = "veth, netem";
  } else if (disturbance) {
    if (!run(kIp, -1, "link del bedside")) return "ip link del bedside failed";
    relay_.emplace();
    if (auto why = relay_->start("bedside", workstation_, "work", *disturbance); !why.empty()) {
      return "no netem in this kernel, and " + why;
    }
    cable_ = "TUN relay";
  }
  const std::string near = TwoNetworks::kBedside;
  for (const auto& [network, arguments] :
       std::vector<std::pair<int, std::string>>{{-1, "addr add " + near + "/24 dev bedside"},
                                                {-1, "link set bedside up"},
                                                {workstation_, address("add")},
                                                {workstation_, "link set work up"}}) {
    if (!run(kIp, network, arguments)) return "ip " + arguments + " failed";
  }
  return "";
}

bool TwoNetworks::add_netem(const PacketDisturbance& disturbance) const {
  if (access(kTc, X_OK) != 0) return false;
  const auto us = [](Duration time) {
    return std::to_string(std::chrono::duration_cast<std::chrono::microseconds>(time).count()) +
           "us";
  };
  const std::string netem = " root netem limit 10000 delay " + us(disturbance.delay) + " " +
                            us(disturbance.jitter) + " loss " +
                            std::to_string(100.0 * disturbance.loss_ratio) + "%";
  return run(kTc, -1, "qdisc add dev bedside" + netem) &&
         run(kTc, workstation_, "qdisc add dev work" + netem);
}

bool TwoNetworks::cut() const { return run(kIp, workstation_, "link set work down"); }
bool TwoNetworks::mend() const { return run(kIp, workstation_, "link set work up"); }

bool TwoNetworks::remove_address() const { return run(kIp, workstation_, address("del")); }
bool TwoNetworks::add_address() const { return run(kIp, workstation_, address("add")); }

TwoNetworks::~TwoNetworks() {
  relay_.reset();
  if (child_ <= 0) return;
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
  close(workstation_);
}

}  // namespace palpate::test
