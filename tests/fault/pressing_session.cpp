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

constexpr const char* kHand =
    "t,x,y,z\n0,0,0,0.004\n0.3,0,0,0.004\n0.6,0,0,-0.0075\n1.8,0,0,-0.0075\n2.1,0,0,0.004\n";

std::string session_text(const std::string& name) {
  return "name: \"" + name + R"("
hand { stiffness_newton_per_m: 400 recorded { file: "hand.csv" loop: true } }
mofc { mode: guard }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
viewer { web { port: 0 } }
)";
}

}  // namespace

bool is_fresh(const viewer::TickRow& row) {
  return row.device.is_answered && row.mofc &&
         (row.mofc->state == MofcState::kContact || row.mofc->state == MofcState::kFree);
}

PressingSession::PressingSession(const std::string& name, const std::vector<std::string>& arguments,
                                 const std::vector<std::string>& sides) {
  files_.write("hand.csv", kHand);
  std::string text = session_text(name);
  for (const std::string& side : sides) text += "side { name: \"" + side + "\" }\n";
  file_ = files_.write(name + ".txtpb", text);
  session_ = load_session(file_);
  watcher_.emplace(session_, links_);
  std::vector<std::string> all{"launch", file_, "--json", (files_.path() / "run.json").string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  launch_.emplace("palpate", all);
}

// 80 % of the force reached; in from 1 mm above the tissue within 0.6 s, so that it is not yet on
// its way out.
bool PressingSession::presses(std::size_t side) const {
  const std::vector<viewer::TickRow>& rows = this->rows(side);
  if (rows.empty() || !is_fresh(rows.back()) || rows.back().mofc->state != MofcState::kContact ||
      newton(rows.back()) < 0.8 * kPressNewton) {
    return false;
  }
  const auto above = std::find_if(rows.rbegin(), rows.rend(), [](const viewer::TickRow& row) {
    return row.device.true_tool_position_world_m.z() > 1e-3;
  });
  return above != rows.rend() && rows.back().device.sampled_at - above->device.sampled_at < 600ms;
}

// 100 ticks later its target rests.
bool PressingSession::until_pressing(std::size_t side) {
  return watcher_->until([&] { return presses(side); }) && watcher_->until_rows(100);
}

bool PressingSession::until_all_pressing() {
  const auto all_press = [&] {
    for (std::size_t side = 0; side < sides_of(session_).size(); ++side) {
      if (!presses(side)) return false;
    }
    return true;
  };
  return watcher_->until(all_press) && watcher_->until_rows(100);
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
