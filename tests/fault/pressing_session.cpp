// SPDX-License-Identifier: Apache-2.0
#include "tests/fault/pressing_session.h"

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/session/session_file.h"

namespace palpate::test {
namespace {

/// Leases of one length, so that the motion of the hand after a fault can be predicted; a force of
/// silent physics that ends before the press does.
std::string session_text(const std::string& name) {
  return std::string(kPressingHand) + "name: \"" + name + R"("
device { longest_lease_us: 2000 }
mofc { mode: guard still_after_ms: 500 }
viewer { web { port: 0 } }
)";
}

}  // namespace

PressingSession::PressingSession(const std::string& name, const std::vector<std::string>& arguments,
                                 const std::vector<std::string>& sides) {
  files_.write("hand.csv", kPressingPath);
  std::string text = session_text(name);
  for (const std::string& side : sides) text += "side { name: \"" + side + "\" }\n";
  file_ = files_.write(name + ".txtpb", text);
  session_ = load_session(file_);
  watcher_.emplace(session_, links_);
  std::vector<std::string> all{"launch", file_, "--json", (files_.path() / "run.json").string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  launch_.emplace("palpate", all);
}

// 100 ticks later the target of the hand is at rest.
bool PressingSession::until_pressing(std::size_t side) {
  return watcher_->until([&] { return presses(rows(side)); }) && watcher_->until_rows(100);
}

bool PressingSession::until_pressing_while_others_touch() {
  const auto touches = [&](std::size_t side) {
    return !rows(side).empty() && is_fresh(rows(side).back()) &&
           rows(side).back().mofc->state == MofcState::kContact;
  };
  return watcher_->until([&] {
    if (!presses(rows(0))) return false;
    for (std::size_t side = 1; side < session_.sides.size(); ++side) {
      if (!touches(side)) return false;
    }
    return true;
  });
}

pid_t PressingSession::node(const std::string& name, int count) {
  const std::string pid = launch_->await_err("event=node_started node=" + name + " pid=", count);
  return pid.empty() ? 0 : std::stoi(pid);
}

std::map<std::string, int> PressingSession::stop_and_count_restarts() {
  launch_->send_signal(SIGTERM);
  launch_->wait();
  std::ifstream file(files_.path() / "run.json");
  return nlohmann::json::parse(file)["restarts"];
}

}  // namespace palpate::test
