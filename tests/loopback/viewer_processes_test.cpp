// SPDX-License-Identifier: Apache-2.0
// viewer_node as a user starts it: its clients see the scene, the scene follows a drag, and nothing
// else that a client says has any effect.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <memory>
#include <vector>

#include "common/core/random.h"
#include "common/link/codec/codec.h"
#include "common/link/zmq_source.h"
#include "common/session/session_file.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "tests/support/web_client.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::Program;
using test::TempFolder;
using test::Watcher;
using test::WebClient;
using testing::HasSubstr;

/// A hand that rests 20 mm above soft tissue, and may be led.
constexpr const char* kSession = R"(
name: "page"
realtime { priority: 0 cpu: -1 }
device { monitor: off rate_hz: 200 lease_us: 12500 }
hand { pointer { speed_m_per_s: 0.5 } hold { position_m { z: 0.02 } } }
mofc { controller: none stale_after_ms: 200 }
scene {
  tool { tip_radius_m: 0.003 }
  tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 damping_newton_s_per_m: 1 } }
}
viewer { web { port: 0 } }
)";

// Channel numbers: order of the channels of viewer_node.
constexpr int kScene = 1;
constexpr int kMesh = 2;
constexpr int kHealth = 6;
constexpr int kLog = 11;

class ViewerProcesses : public testing::Test {
 protected:
  ViewerProcesses() { file_ = files_.write("page.txtpb", kSession); }
  /// Starts all nodes; the viewer's port.
  void launch(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"launch", file_, "--no-realtime"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    launch_.emplace("palpate", arguments);
    const std::string rest = launch_->await_err("event=web url=http://127.0.0.1:");
    ASSERT_FALSE(rest.empty());
    port_ = static_cast<std::uint16_t>(std::stoi(rest));
  }
  void stop() {
    launch_->send_signal(SIGTERM);
    EXPECT_EQ(launch_->wait(), 0);
  }
  static void subscribe(const WebClient& client, int channel) {
    client.send_text(R"({"op":"subscribe","subscriptions":[{"id":)" + std::to_string(channel) +
                     R"(,"channelId":)" + std::to_string(channel) + "}]}");
  }
  static void advertise(const WebClient& client) {
    client.send_text(R"({"op":"advertise","channels":[{"id":1,"topic":"/hand_target",)"
                     R"("encoding":"protobuf","schemaName":"palpate.v1.HandTarget"}]})");
  }
  /// A HandTarget { hand_position_m { z } is_released }, written by hand: field 3 of 9 bytes, in it
  /// field 3, a double; field 4, a bool.
  static void lead(const WebClient& client, double z_m, bool is_released = false) {
    const auto bits = std::bit_cast<std::array<char, 8>>(z_m);
    const std::string target =
        std::string("\x1a\x09\x19") + std::string(bits.data(), 8) + (is_released ? "\x20\x01" : "");
    client.send_raw(WebClient::frame(2, std::string("\x01\x01\0\0\0", 5) + target));
  }
  template <class T>
  static T decoded(const std::string& payload) {
    const std::string frame = static_cast<char>(kKindOf<T>) + payload;
    T message;
    EXPECT_EQ(Codec<T>().decode(std::as_bytes(std::span(frame)), message), DecodeError::kNone);
    return message;
  }

  test::RunFolder run_folder_;
  TempFolder files_;
  std::string file_;
  std::optional<Program> launch_;
  std::uint16_t port_ = 0;
};

// Its port is taken before its address is printed, so a browser may open it before viewer_node
// runs.
TEST_F(ViewerProcesses, APageThatIsAnnouncedCanBeOpenedAtOnce) {
  Program launch("palpate", {"launch", file_, "--no-realtime"});
  std::string out;
  ASSERT_TRUE(test::await([&] { return (out = launch.out()).find("/\n") != std::string::npos; }));
  const std::string address = "http://127.0.0.1:";
  ASSERT_TRUE(out.starts_with(address)) << out;
  const WebClient early(static_cast<std::uint16_t>(std::stoi(out.substr(address.size()))));
  EXPECT_TRUE(early.is_connected());
  WebClient client(static_cast<std::uint16_t>(std::stoi(out.substr(address.size()))));
  client.send_raw("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(client.read_head(), HasSubstr("200 OK"));
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0) << launch.err();
}

TEST_F(ViewerProcesses, ALateViewerHasTheWholeSceneWithinASecond) {
  launch();
  const test::QuietMachine machine;
  for (int i = 0; i < 3; ++i) {
    WebClient client(port_);
    ASSERT_TRUE(client.open_web_socket());
    const auto begin = std::chrono::steady_clock::now();
    subscribe(client, kScene);
    const auto payload = client.await_data(kScene);
    const auto took = std::chrono::steady_clock::now() - begin;

    ASSERT_TRUE(payload.has_value());
    if (machine.may_check("the scene within a second")) {
      EXPECT_LT(took, 1s);
    }
    const auto scene = decoded<SceneState>(*payload);
    EXPECT_EQ(scene.session_name, "page");
    ASSERT_EQ(scene.tissues.size(), 1u);
    EXPECT_GT(scene.tissues[0].mesh.vertex_count(), 1000u);
    EXPECT_TRUE(scene.pointer.has_value());
  }
  stop();
}

TEST_F(ViewerProcesses, ADragMovesTheHandDeformsTheTissueAndIsFelt) {
  const test::QuietMachine machine;
  launch();
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(file_), links);
  ASSERT_TRUE(watcher.until([&] { return watcher.sees_all_nodes(); }));
  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());

  // a page that does not ask for meshes costs none: 30 times a second nothing is made
  const auto physics = [&]() -> const PhysicsCounters& {
    return watcher.mirror().physics_counters();
  };
  const std::uint64_t skipped_before = physics().meshes_skipped;
  ASSERT_TRUE(watcher.until([&] { return physics().meshes_skipped > skipped_before + 10; }))
      << launch_->err();
  EXPECT_EQ(physics().mesh_frames, 0u);
  subscribe(page, kMesh);
  advertise(page);

  // 10 mm below the surface: the spring of 150 N/m against 200 N/m gives about 0.8 N
  ASSERT_TRUE(watcher.until([&] {
    lead(page, -0.01);
    if (watcher.rows().empty()) return false;
    const auto& device = watcher.rows().back().device;
    return device.measured_tool_position_world_m.z() < 0.0 && device.force_on_hand_newton.z() > 0.3;
  }));

  const auto payload = page.await_data(kMesh);
  ASSERT_TRUE(payload.has_value());
  EXPECT_EQ(decoded<MeshFrame>(*payload).tissue, 0u);
  ASSERT_TRUE(watcher.until([&] { return physics().mesh_frames > 0; }));
  // and nothing is skipped any more, unless physics forgets a viewer that was silent for a second
  const std::uint64_t skipped = physics().meshes_skipped;
  const std::uint64_t ticks = physics().loop.ticks;
  ASSERT_TRUE(watcher.until([&] {
    lead(page, -0.01);  // a page that is silent loses the hand
    return physics().loop.ticks > ticks + 500;
  }));
  if (physics().meshes_skipped == skipped || machine.may_check("no mesh skipped")) {
    EXPECT_EQ(physics().meshes_skipped, skipped);
  }

  // another page may not take the hand, and is told so; once it is let go of, it may
  WebClient other(port_);
  ASSERT_TRUE(other.open_web_socket());
  advertise(other);
  const std::size_t rows = watcher.rows().size();
  ASSERT_TRUE(watcher.until([&] {
    lead(page, -0.01);
    return watcher.rows().size() > rows;
  }));
  lead(other, 0.05);
  EXPECT_THAT(other.await_text("another page leads the hand"), HasSubstr("\"level\":1"));
  lead(page, -0.01, true);
  EXPECT_THAT(other.await_text("removeStatus"), HasSubstr("hand"));
  EXPECT_TRUE(watcher.until([&] {
    lead(other, 0.05);
    return watcher.rows().back().device.measured_hand_position_m.z() > 0.04;
  }));
  stop();
}

// The simulated hand presses on the block of the repository: the full solution and the steps
// between two are at work, pages see the computed surface and its strain, and the compliance is
// kept.
TEST_F(ViewerProcesses, AnElasticBodyIsFeltAndDeformsAsComputed) {
  const test::QuietMachine machine;
  file_ = test::source_dir() + "/deploy/sessions/block_with_tumour.txtpb";
  launch({"--set", "viewer.web.port=0", "--set", "scene.tissue[0].elastic.linear_elements=true"});
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(file_), links);
  ASSERT_TRUE(watcher.until([&] {
    return !watcher.rows().empty() && watcher.rows().back().device.force_on_hand_newton.z() > 0.3;
  })) << launch_->err();
  const PhysicsCounters& physics = watcher.mirror().physics_counters();
  EXPECT_TRUE(watcher.until([&] {
    return physics.elastic_solves > 0 && physics.elastic_residual_ratio < 1e-2 &&
           physics.elastic_bound_newton > 0.0;
  })) << physics.elastic_solves
      << " solutions, residual " << physics.elastic_residual_ratio;

  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());
  subscribe(page, kMesh);
  float lowest_m = 0.0F;  // of the top, which is at 0
  float most_strain = 0.0F;
  const auto deadline = std::chrono::steady_clock::now() + test::patience(Watcher::kAmple);
  while (lowest_m > -0.002F || most_strain < 0.05F) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << lowest_m << " m, " << most_strain;
    const auto payload = page.await_data(kMesh);
    ASSERT_TRUE(payload.has_value());
    const auto frame = decoded<MeshFrame>(*payload);
    ASSERT_EQ(frame.vertex_strain.size(), frame.vertices_m.size() / 3);
    for (std::size_t i = 0; i < frame.vertex_strain.size(); ++i) {
      most_strain = std::max(most_strain, frame.vertex_strain[i]);
      const float z_m = frame.vertices_m[3 * i + 2];
      if (z_m > -0.01F) lowest_m = std::min(lowest_m, z_m);
    }
  }
  stop();
  // physics saves what it has computed at its end, for which launch gives it 2 s
  const bool has_ended_itself =
      launch_->err().find("event=node_stopped node=physics how=\"exit status 0\"") !=
      std::string::npos;
  if (has_ended_itself || machine.may_check("physics saves its columns")) {
    EXPECT_FALSE(std::filesystem::is_empty(run_folder_.cache()));
  }
}

// 10 mm to and fro twice a second: the whole path is seen within half a second.
TEST_F(ViewerProcesses, ALatePageSeesMovingTissueWhereItIs) {
  launch({"--set", "scene.tissue[0].motion={amplitude_m {z: 0.01} frequency_hz: 2}"});
  for (int i = 0; i < 2; ++i) {
    WebClient page(port_);
    ASSERT_TRUE(page.open_web_socket());
    subscribe(page, kMesh);
    double lowest_m = 0.0;
    double highest_m = 0.0;
    while (lowest_m > -0.009 || highest_m < 0.009) {
      const auto payload = page.await_data(kMesh);
      ASSERT_TRUE(payload.has_value());
      const auto frame = decoded<MeshFrame>(*payload);
      EXPECT_TRUE(frame.vertices_m.empty());  // the hand is 20 mm above
      lowest_m = std::min(lowest_m, frame.displacement_world_m.z());
      highest_m = std::max(highest_m, frame.displacement_world_m.z());
      EXPECT_LE(std::abs(frame.displacement_world_m.z()), 0.01 + 1e-12);
    }
  }
  stop();
}

TEST_F(ViewerProcesses, AFloodOfTargetsReachesTheDeviceAtMost120TimesASecondAndEndsWithTheNewest) {
  Program viewer("viewer_node", {"--session", file_, "--quiet"});
  const std::string rest = viewer.await_err("event=web url=http://127.0.0.1:");
  ASSERT_FALSE(rest.empty());
  ProcessLinks links({.priority = 0, .cpu = -1});
  const SteadyClock clock;
  ZmqSource<HandTarget> device(
      links.side, clock,
      bind_to(load_session(file_).side().links.hand_target, "links.hand_target"));
  WebClient page(static_cast<std::uint16_t>(std::stoi(rest)));
  ASSERT_TRUE(page.open_web_socket());
  advertise(page);

  HandTarget target;
  TimePoint received_at;
  const auto begin = std::chrono::steady_clock::now();
  std::size_t sent = 0;
  std::size_t received = 0;
  while (received < 100 && std::chrono::steady_clock::now() - begin < test::patience(20s)) {
    lead(page, 0.01);
    ++sent;
    while (device.receive(target, received_at)) ++received;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_GE(received, 100u);
  EXPECT_LE(static_cast<double>(received), 120.5 * took.count() + 1.0);
  EXPECT_GT(sent, 2 * received);

  lead(page, 0.02);
  while (target.hand_position_m.z() != 0.02 &&
         std::chrono::steady_clock::now() - begin < test::patience(30s)) {
    device.wait_until(clock.now() + 50ms);
    static_cast<void>(device.receive(target, received_at));
  }
  EXPECT_EQ(target.hand_position_m.z(), 0.02);
}

TEST_F(ViewerProcesses, ATargetBeyondTheReachLeadsTheHandToItsEdge) {
  launch();
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(file_), links);
  ASSERT_TRUE(watcher.until([&] { return watcher.sees_all_nodes(); }));
  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());
  advertise(page);

  // the default reach is 0.1 m; on its way at 0.5 m/s a hand of 0.3 kg on a spring of 150 N/m
  // overshoots by less than v √(m/k) = 22 mm
  const auto height_m = [&] {
    return watcher.rows().empty() ? 0.0 : watcher.rows().back().device.measured_hand_position_m.z();
  };
  ASSERT_TRUE(watcher.until([&] {
    lead(page, 1000.0);
    return height_m() > 0.098;
  }));
  const std::size_t first = watcher.rows().size();
  ASSERT_TRUE(watcher.until([&] {
    lead(page, 1000.0);
    return watcher.rows().size() > first + 200;  // a second more
  }));
  for (const TickRow& row : watcher.rows()) {
    ASSERT_LT(row.device.measured_hand_position_m.norm(), 0.122);
  }
  stop();
}

TEST_F(ViewerProcesses, HostileClientsStopNeitherTheServerNorTheTicks) {
  launch();
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(file_), links);
  ASSERT_TRUE(watcher.until([&] { return watcher.sees_all_nodes(); }));
  ASSERT_TRUE(watcher.until_rows(100));
  const std::size_t first = watcher.rows().size();
  const test::QuietMachine machine;

  // more connections than are allowed, each up to something else; none reads an answer
  std::vector<std::unique_ptr<WebClient>> hostile;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const WebClient& client = *hostile.emplace_back(std::make_unique<WebClient>(port_));
    switch (i % 8) {
      case 0:
        break;  // silent
      case 1:
        client.send_raw("GET / HTTP/1.1\r\nHost: local");
        client.send_no_more();
        break;
      case 2:
        client.send_raw("GET / HTTP/1.1\r\nX: " + std::string(100'000, 'x'));
        break;
      case 3:
        client.send_raw(WebClient::upgrade("Origin: http://evil.example\r\n"));
        break;
      case 4:
        client.send_raw(WebClient::upgrade() + WebClient::frame(1, std::string(100'000, '[')));
        break;
      case 5:  // subscribes to all there is
        client.send_raw(WebClient::upgrade());
        for (int channel = 1; channel <= 11; ++channel) subscribe(client, channel);
        break;
      case 6:
        client.send_raw(WebClient::upgrade());
        advertise(client);
        for (int k = 0; k < 100; ++k) lead(client, 1e300);
        break;
      default: {
        Random random(i);
        std::string bytes(1000, '\0');
        for (char& c : bytes) c = static_cast<char>(random.below(256));
        client.send_raw(bytes);
      }
    }
    if (i % 10 == 0) {
      ASSERT_TRUE(watcher.until_rows(2));
    }
  }
  ASSERT_TRUE(watcher.until_rows(400));

  // the device was neither restarted nor left alone
  EXPECT_EQ(watcher.mirror().device_link().sessions, 1u);
  EXPECT_EQ(watcher.mirror().mofc_link().sessions, 1u);
  const auto begin = watcher.rows().begin() + static_cast<std::ptrdiff_t>(first);
  const auto answered = std::count_if(begin, watcher.rows().end(),
                                      [](const auto& row) { return row.device.is_answered; });
  EXPECT_GT(answered, 0);
  if (machine.may_check("90 % of the ticks answered beside hostile clients")) {
    EXPECT_GT(static_cast<double>(answered),
              0.9 * static_cast<double>(watcher.rows().end() - begin));
  }

  hostile.clear();
  std::optional<std::string> scene;
  ASSERT_TRUE(watcher.until([&] {  // a good client is let in again
    WebClient client(port_);
    if (!client.open_web_socket()) return false;
    subscribe(client, kScene);
    scene = client.await_data(kScene);
    return scene.has_value();
  }));
  EXPECT_EQ(decoded<SceneState>(*scene).session_name, "page");
  stop();
}

TEST_F(ViewerProcesses, WithoutPermissionAPageOnlyLooks) {
  file_ = files_.write(
      "look.txtpb", std::string(kSession).replace(std::string(kSession).find("pointer"), 31, ""));
  launch();
  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());
  EXPECT_THAT(page.await_text("serverInfo"), HasSubstr("\"client_topics\":\"/run_request\""));
  advertise(page);
  EXPECT_THAT(page.await_text("status"), HasSubstr("advertise: only /run_request"));
  lead(page, 0.05);
  EXPECT_THAT(page.await_text("status"), HasSubstr("advertised channel"));
  stop();
}

TEST_F(ViewerProcesses, AKilledNodeIsToldOfWithinTwoSeconds) {
  launch();
  const std::string pid = launch_->await_err("event=node_started node=physics pid=");
  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());
  subscribe(page, kHealth);
  const std::string heard = std::string("\x0a\x07") + "physics\x10\x01";
  std::optional<std::string> health;
  do health = page.await_data(kHealth);
  while (health && health->find(heard) == std::string::npos);
  ASSERT_TRUE(health.has_value());

  kill(std::stoi(pid), SIGSTOP);  // silent, and not restarted
  // is_heard, field 2 of the node named physics, is absent when false
  const std::string silent = std::string("\x0a\x07") + "physics\x19";
  const test::QuietMachine machine;
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(test::await([&] {
    const auto payload = page.await_data(kHealth);
    return payload && payload->find(silent) != std::string::npos;
  }));
  if (machine.may_check("told within two seconds")) {
    EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
  }
  kill(std::stoi(pid), SIGCONT);
  stop();
}

// TissueChange, written by hand: field 2 an integer, fields 3 and 4 doubles.
std::string change_of(unsigned char tissue, double k, double b) {
  const auto number = [](char tag, double value) {
    const auto bits = std::bit_cast<std::array<char, 8>>(value);
    return tag + std::string(bits.data(), 8);
  };
  return std::string("\x10") + static_cast<char>(tissue) + number('\x19', k) + number('\x21', b);
}

TEST_F(ViewerProcesses, APageChangesATissueAndAllPagesLearnOfIt) {
  launch({"--set", "viewer.control=true"});
  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());
  page.send_text(R"({"op":"advertise","channels":[{"id":1,"topic":"/tissue_change",)"
                 R"("encoding":"protobuf","schemaName":"palpate.v1.TissueChange"}]})");
  const auto change = [&](unsigned char tissue, double k, double b) {
    page.send_raw(WebClient::frame(2, std::string("\x01\x01\0\0\0", 5) + change_of(tissue, k, b)));
  };
  subscribe(page, kScene);
  const auto first = page.await_data(kScene);
  ASSERT_TRUE(first.has_value()) << launch_->err();
  EXPECT_TRUE(decoded<SceneState>(*first).accepts_changes);

  change(0, 350.0, 2.0);
  SceneState scene;
  while (scene.revision < 2) {
    const auto message = page.next();
    ASSERT_TRUE(message.has_value()) << launch_->err();
    if (message->payload.find("no physics_node to change") != std::string::npos) {
      change(0, 350.0, 2.0);  // the link does not stand yet
    } else if (message->opcode == 2) {
      scene = decoded<SceneState>(message->payload.substr(13));
    }
  }
  EXPECT_EQ(scene.revision, 2u);
  EXPECT_EQ(scene.tissues[0].stiffness_newton_per_m, 350.0);
  EXPECT_EQ(scene.tissues[0].damping_newton_s_per_m, 2.0);

  change(0, 2e6, 2.0);  // refused here
  EXPECT_THAT(page.await_text("status"), HasSubstr("not a valid palpate.v1.TissueChange"));
  change(7, 300.0, 2.0);  // refused by physics_node: there is no such tissue
  WebClient late(port_);
  ASSERT_TRUE(late.open_web_socket());
  subscribe(late, kLog);
  std::string log;
  while (log.find("event=tissue_change_refused") == std::string::npos) {
    const auto line = late.await_data(kLog);
    ASSERT_TRUE(line.has_value()) << log;
    log += *line + "\n";
  }
  EXPECT_THAT(log, HasSubstr("stiffness_newton_per_m=350 damping_newton_s_per_m=2"));
  stop();
}

TEST_F(ViewerProcesses, WithControlServesPagesOfThisMachineOnly) {
  const std::string token = files_.write("token", "0123456789abcdef0123\n");
  std::filesystem::permissions(token, std::filesystem::perms(0600));
  const auto status_of = [&](const std::vector<std::string>& more, const char* why) {
    std::vector<std::string> arguments = {"--session", file_,   "--seconds",
                                          "1",         "--set", "viewer.control=true"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto viewer = test::run_program("viewer_node", arguments);
    EXPECT_THAT(viewer.err, HasSubstr(why));
    return viewer.status;
  };
  EXPECT_EQ(status_of({"--listen", "0.0.0.0:0", "--token-file", token}, "viewer.control"), 2);
  EXPECT_EQ(status_of({"--proxy", "192.0.2.1"}, "viewer.control"), 2);
  Program viewer("viewer_node",
                 {"--session", file_, "--set", "viewer.control=true", "--listen", "127.0.0.1:0"});
  viewer.await_err("event=web url=");
  viewer.send_signal(SIGTERM);
  EXPECT_EQ(viewer.wait(), 0) << viewer.err();
}

TEST_F(ViewerProcesses, ListensElsewhereOnlyWithAToken) {
  const auto open = test::run_program(
      "viewer_node", {"--session", file_, "--listen", "0.0.0.0:0", "--seconds", "1"});
  EXPECT_EQ(open.status, 2);
  EXPECT_THAT(open.err, HasSubstr("--token-file"));

  const auto expect_refused = [&](const std::string& token, unsigned mode, const char* why) {
    const std::string file = files_.write("token", token + "\n");
    std::filesystem::permissions(file, std::filesystem::perms(mode));
    const auto viewer = test::run_program(
        "viewer_node",
        {"--session", file_, "--listen", "0.0.0.0:0", "--token-file", file, "--seconds", "1"});
    EXPECT_EQ(viewer.status, 2);
    EXPECT_THAT(viewer.err, HasSubstr(why));
  };
  expect_refused("0123456789abcdef0123", 0644, "chmod 600");
  expect_refused("short", 0600, "at least 16");

  for (const char* wrong : {"127.0.0.1", "8765", ":1", "127.0.0.1:65536", "127.0.0.1:x"}) {
    const auto listen =
        test::run_program("viewer_node", {"--session", file_, "--listen", wrong, "--seconds", "1"});
    EXPECT_EQ(listen.status, 2) << wrong;
    EXPECT_THAT(listen.err, HasSubstr("ADDRESS:PORT")) << wrong;
  }
}

// What a page marks is in the recording of launch, in its own, and on every page.
TEST_F(ViewerProcesses, APageSetsMarkersAndRecords) {
  const std::string run = (files_.path() / "run.mcap").string();
  const auto info = [](const std::string& file) {
    return test::run_program("palpate", {"info", file, "--json"}).out;
  };
  const auto here = std::filesystem::current_path();
  std::filesystem::current_path(files_.path());  // pages record there
  launch({"--record", run});
  std::filesystem::current_path(here);
  WebClient page(port_);
  ASSERT_TRUE(page.open_web_socket());
  page.send_text(R"({"op":"advertise","channels":[{"id":1,"topic":"/run_request",)"
                 R"("encoding":"protobuf","schemaName":"palpate.v1.RunRequest"}]})");
  // RunRequest, written by hand: field 2 a text, field 6 a bool
  const auto request = [&](const std::string& fields) {
    page.send_raw(WebClient::frame(2, std::string("\x01\x01\0\0\0", 5) + fields));
  };
  subscribe(page, kHealth);
  const auto health_has = [&](const std::string& text) {
    return test::await([&] {
      const auto health = page.await_data(kHealth);
      return health && health->find(text) != std::string::npos;
    });
  };
  request("\x30\x01");
  ASSERT_TRUE(health_has("page-")) << launch_->err();
  ASSERT_TRUE(test::await(
      [&] { return launch_->err().find("event=recording_begun") != std::string::npos; }));
  const std::string begun = launch_->err();
  const std::string name = begun.substr(
      begun.find("file=") + 5, begun.find(".mcap", begun.find("file=")) - begun.find("file="));
  const std::string own = (files_.path() / name).string();
  request("\x12\x05touch");
  ASSERT_TRUE(health_has("touch")) << launch_->err();
  ASSERT_TRUE(
      test::await([&] { return launch_->err().find("marker set: touch") != std::string::npos; }));
  request(std::string("\x30\0", 2));
  launch_->await_err("event=recording_ended");
  stop();

  EXPECT_THAT(info(run), HasSubstr("\"/markers\": 1"));
  EXPECT_THAT(info(own), HasSubstr("\"/markers\": 1"));
  EXPECT_THAT(info(own), HasSubstr("\"/scene_state\": 1")) << "sent before this recording began";
}

}  // namespace
}  // namespace palpate
