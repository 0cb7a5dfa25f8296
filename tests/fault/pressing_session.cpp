#include "tests/fault/pressing_session.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/runtime/session_file.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

std::string session_text(const std::string& name) {
  return std::string(kPressingHand) + "name: \"" + name + R"("
mofc { mode: guard }
viewer { web { port: 0 } }
)";
}

}  // namespace

PressingSession::PressingSession(const std::string& name,
                                 const std::vector<std::string>& arguments) {
  files_.write("hand.csv", kPressingPath);
  file_ = files_.write(name + ".txtpb", session_text(name));
  session_ = load_session(file_);
  watcher_.emplace(session_, links_);
  std::vector<std::string> all{"launch", file_, "--json", (files_.path() / "run.json").string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  launch_.emplace("palpate", all);
}

bool PressingSession::until_pressing() {
  return watcher_->until([this] { return presses(rows()); }) &&
         watcher_->until_rows(100);  // its target rests by then
}

pid_t PressingSession::node(const std::string& name, int count) {
  const std::string pid = launch_->await_err("event=node_started node=" + name + " pid=", count);
  return pid.empty() ? 0 : std::stoi(pid);
}

std::string PressingSession::stop_and_count_restarts() {
  launch_->send_signal(SIGTERM);
  launch_->wait();
  std::ifstream file(files_.path() / "run.json");
  return nlohmann::json::parse(file)["restarts"].dump();
}

}  // namespace palpate::test
