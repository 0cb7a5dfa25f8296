// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/supervisor.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <boost/process/args.hpp>
#include <boost/process/child.hpp>
#include <boost/process/env.hpp>
#include <boost/process/environment.hpp>
#include <boost/process/exe.hpp>
#include <boost/process/extend.hpp>
#include <boost/process/io.hpp>
#include <boost/process/start_dir.hpp>
#include <csignal>
#include <cstring>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/process/run_node.h"

namespace palpate {
namespace {

namespace process = boost::process;

std::string in_words(int status) {
  if (WIFEXITED(status)) return "exit status " + std::to_string(WEXITSTATUS(status));
  const int signal = WTERMSIG(status);
  return "killed by signal " + std::to_string(signal) + " (" + strsignal(signal) + ")";
}

}  // namespace

Supervisor::Supervisor(boost::asio::io_context& io, std::vector<ChildSpec> children,
                       const std::vector<std::vector<std::string>>& stop_order,
                       const SupervisorTiming& timing,
                       std::function<void(const ChildEvent&)> on_event,
                       std::function<void()> on_end)
    : io_(io),
      stages_(stop_order.size() + 1),
      timing_(timing),
      on_event_(std::move(on_event)),
      on_end_(std::move(on_end)),
      deaths_(io, SIGCHLD) {
  for (ChildSpec& spec : children) {
    Child& child = children_.emplace_back(io_, std::move(spec));
    child.back_off = timing_.first_back_off;
    const auto stage = std::find_if(stop_order.begin(), stop_order.end(), [&](const auto& names) {
      return std::find(names.begin(), names.end(), child.spec.name) != names.end();
    });
    stages_[static_cast<std::size_t>(stage - stop_order.begin())].push_back(&child);
  }
}

void Supervisor::start() {
  await_deaths();
  for (Child& child : children_) spawn(child);
}

void Supervisor::spawn(Child& child) {
  std::vector<std::string> arguments = child.spec.arguments;
  if (child.restarts > 0) {
    arguments.insert(arguments.end(), child.spec.restart_arguments.begin(),
                     child.spec.restart_arguments.end());
  }

  // runs between fork and exec: system calls only
  const pid_t supervisor = getpid();
  const auto in_child = [supervisor, descriptor = child.spec.descriptor](auto&) {
    setpgid(0, 0);
    if (descriptor >= 0) fcntl(descriptor, F_SETFD, 0);
    prctl(PR_SET_PDEATHSIG, SIGTERM);  // a device releases its motors; the lifeline kills later
    if (getppid() != supervisor) _exit(kExitFailure);  // it had ended before prctl
  };
  process::environment environment = boost::this_process::environment();
  for (const auto& [name, value] : child.spec.environment) environment[name] = value;
  const std::string folder = child.spec.folder.empty() ? "." : child.spec.folder.string();
  try {
    process::child started(process::exe = child.spec.program.string(), process::args = arguments,
                           process::env = environment, process::start_dir = folder,
                           process::std_in < process::null,
                           process::extend::on_exec_setup = in_child);
    child.pid = started.id();
    started.detach();  // reap() waits for it
  } catch (const process::process_error& e) {
    throw SetupError(child.spec.program.string() + ": cannot be started: " + e.code().message());
  }
  lifeline_.add(child.pid);
  child.started_at = std::chrono::steady_clock::now();
  on_event_({.kind = ChildEvent::Kind::kStarted, .name = child.spec.name, .pid = child.pid});
}

void Supervisor::await_deaths() {
  deaths_.async_wait([this](const boost::system::error_code& error, int) {
    if (error || has_ended_) return;
    await_deaths();
    reap();
  });
}

void Supervisor::reap() {
  // signals are merged: one SIGCHLD may stand for several deaths
  for (Child& child : children_) {
    if (child.pid == 0) continue;
    siginfo_t death{};
    constexpr int kLook = WEXITED | WNOHANG | WNOWAIT;
    if (waitid(P_PID, static_cast<id_t>(child.pid), &death, kLook) != 0 || death.si_pid == 0) {
      continue;
    }
    // a program that it started would hold its endpoints; not yet reaped, it keeps the group's id
    ::kill(-child.pid, SIGKILL);
    lifeline_.remove(child.pid);
    int status = 0;
    if (waitpid(child.pid, &status, WNOHANG) == child.pid) on_death(child, status);
  }
  if (is_stopping_) stop_next();
}

void Supervisor::on_death(Child& child, int status) {
  using Kind = ChildEvent::Kind;
  ChildEvent event{.name = child.spec.name, .pid = child.pid, .how = in_words(status)};
  child.pid = 0;
  child.timer.cancel();

  if (WIFEXITED(status) && WEXITSTATUS(status) == kExitSetupError) {
    event.kind = Kind::kRefused;
    was_refused_ = true;
    on_event_(event);
    stop();
    return;
  }
  if (is_stopping_) {
    event.kind = child.was_killed ? Kind::kKilled : Kind::kStopped;
    on_event_(event);
    return;
  }

  const auto age = std::chrono::steady_clock::now() - child.started_at;
  child.came_up = child.came_up || age >= kCameUpAfter;
  if (age >= timing_.healthy_after) child.back_off = timing_.first_back_off;
  restart_later(child, std::move(event));
}

void Supervisor::restart_later(Child& child, ChildEvent event) {
  event.kind = ChildEvent::Kind::kDied;
  event.restart_in = child.back_off;
  on_event_(event);
  child.timer.expires_after(child.back_off);
  child.back_off = std::min(2 * child.back_off, timing_.longest_back_off);
  child.timer.async_wait([this, &child](const boost::system::error_code& error) {
    if (error || is_stopping_) return;
    ++child.restarts;
    try {
      if (child.spec.before_restart) child.spec.before_restart();
      spawn(child);
    } catch (const SetupError& e) {  // it started before; its program may be being replaced
      restart_later(child, {.name = child.spec.name, .how = one_line(e.what())});
    }
  });
}

void Supervisor::stop() {
  if (is_stopping_) return;
  is_stopping_ = true;
  for (Child& child : children_) {
    child.timer.cancel();
    child.came_up = child.came_up || child.pid != 0;
  }
  stop_next();
}

void Supervisor::stop_next() {
  // One that was killed, and is not dead yet, holds up no other: it may have no processor to die on
  // before those of the next stages have ended.
  const auto runs = [](const Child* child) { return child->pid != 0 && !child->was_killed; };
  const auto running = std::find_if(stages_.begin(), stages_.end(), [&](const auto& stage) {
    return std::any_of(stage.begin(), stage.end(), runs);
  });
  if (running == stages_.end()) {
    const bool are_dead = std::all_of(children_.begin(), children_.end(),
                                      [](const Child& child) { return child.pid == 0; });
    if (has_ended_ || !are_dead) return;
    has_ended_ = true;
    deaths_.cancel();
    on_end_();
    return;
  }

  for (Child* child : *running) {
    if (!runs(child) || child->was_terminated) continue;
    child->was_terminated = true;
    ::kill(child->pid, SIGTERM);
    child->timer.expires_after(timing_.stop_grace);
    child->timer.async_wait([this, child](const boost::system::error_code& error) {
      if (error) return;
      kill(*child);
      stop_next();
    });
  }
}

void Supervisor::kill() {
  is_stopping_ = true;
  for (Child& child : children_) {
    child.timer.cancel();
    kill(child);
  }
  stop_next();
}

void Supervisor::kill(Child& child) {
  if (child.pid == 0) return;
  child.was_terminated = true;
  child.was_killed = true;
  ::kill(-child.pid, SIGKILL);  // the whole process group
}

std::vector<Supervisor::Restarts> Supervisor::restarts() const {
  std::vector<Restarts> restarts;
  for (const Child& child : children_) {
    restarts.push_back({child.spec.name, child.restarts, child.came_up});
  }
  return restarts;
}

}  // namespace palpate
