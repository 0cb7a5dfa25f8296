// SPDX-License-Identifier: Apache-2.0
// Device and clamp on one machine, physics on another: two network namespaces connected by a veth
// pair, isolated from the network. Skipped where namespaces are not permitted.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/link/security/keys.h"
#include "common/session/session_file.h"
#include "tests/support/network/two_networks.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using test::Program;
using test::TempFolder;
using test::text_of;
using test::TwoNetworks;
using test::Watcher;
using testing::HasSubstr;
using testing::Not;

constexpr std::uint16_t kMotionPort = 5551;

/// Text contained in SceneState.
constexpr const char* kTissue = "liver_in_plain_text";

/// A hand that presses 3 mm deep every 2 s.
constexpr const char* kSession = R"(
name: "two_machines_test"
realtime { priority: 0 cpu: -1 }
links {
  tool_motion: "tcp://10.77.0.2:5551"
  interaction: "tcp://10.77.0.2:5552"
  physics_telemetry: "tcp://10.77.0.2:5553"
  device_telemetry: "tcp://10.77.0.1:5554"
  mofc_telemetry: "tcp://10.77.0.1:5555"
}
hand { sinusoid { center_m { z: 0.002 } amplitude_m { z: 0.005 } frequency_hz { z: 0.5 } } }
scene { tissue { name: "liver_in_plain_text" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
)";
constexpr const char* kSecurity = "security { key_folder: \"keys\" }\n";

/// Captures all packets at the bedside's end of the cable.
class Wire {
 public:
  Wire() : socket_(socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, htons(ETH_P_ALL))) {
    sockaddr_ll address{};
    address.sll_family = AF_PACKET;
    address.sll_protocol = htons(ETH_P_ALL);
    address.sll_ifindex = static_cast<int>(if_nametoindex("bedside"));
    const int bytes = 8 << 20;
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof(bytes));
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  }
  ~Wire() { close(socket_); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  void listen() {
    char packet[65536];
    for (ssize_t n = 0; (n = recv(socket_, packet, sizeof(packet), 0)) > 0;) {
      heard_.append(packet, static_cast<std::size_t>(n));
    }
  }
  [[nodiscard]] const std::string& heard() const { return heard_; }

 private:
  int socket_;
  std::string heard_;
};

class TwoMachines : public testing::Test {
 protected:
  void SetUp() override {
    std::string why = networks_.make();
    if (why.empty()) why = networks_.connect();
    if (!why.empty()) GTEST_SKIP() << why;
    run_folder_.use();
    make_key_folder(files_.path() / "keys");
    plain_file_ = files_.write("plain.txtpb", kSession);
    file_ = files_.write("protected.txtpb", std::string(kSession) + kSecurity);
  }

  /// Starts the nodes. @param of_physics  more arguments
  void start_nodes(bool is_protected, const std::vector<std::string>& of_physics = {}) {
    const Session session = load_session(is_protected ? file_ : plain_file_);
    std::vector<std::string> arguments{"--session", session.file};
    if (!is_protected) arguments.emplace_back("--insecure");
    TcpRules rules{.may_be_plain = !is_protected};
    if (is_protected) rules = tcp_rules(session.security, {KeyRole::kViewer});
    links_.emplace(RealtimeConfig{.priority = 0, .cpu = -1}, rules);
    watcher_.emplace(session, *links_);
    watcher_->subscriber().subscribe<SceneState>();
    mofc_.emplace("mofc_node", arguments);
    device_.emplace("device_node", arguments);
    arguments.insert(arguments.end(), of_physics.begin(), of_physics.end());
    physics_.emplace("physics_node", arguments, networks_.workstation());
  }
  void start(bool is_protected) {
    start_nodes(is_protected);
    ASSERT_TRUE(watcher_->until([&] { return watcher_->sees_all_nodes() && is_pressing(); }))
        << physics_->err() << mofc_->err() << device_->err();
  }

  [[nodiscard]] bool is_pressing() const {
    const auto& rows = watcher_->rows();
    return !rows.empty() && rows.back().mofc && rows.back().mofc->state == MofcState::kContact &&
           rows.back().device.force_on_hand_newton.norm() > 0.1;
  }
  [[nodiscard]] bool is_without_physics() const {
    const auto& rows = watcher_->rows();
    // a clamp that is late answers the newest state only
    return rows.size() > 100 && rows.back().mofc &&
           std::all_of(rows.end() - 100, rows.end(), [](const auto& row) {
             return (!row.mofc || row.mofc->state == MofcState::kNoPhysics) &&
                    row.device.force_on_hand_newton.norm() == 0.0;
           });
  }
  [[nodiscard]] std::uint64_t refused_by_physics() const {
    return watcher_->mirror().physics_link().peers_refused;
  }
  [[nodiscard]] std::uint64_t writers() const {
    return watcher_->mirror().physics_counters().tool_motion.sessions;
  }

  /// Keys of `palpate keygen` for one role.
  [[nodiscard]] LinkKeys keys_of(KeyRole role) const {
    return load_link_keys(files_.path() / "keys", std::array{role});
  }
  /// Connects to the motion link of physics with these rules; physics must refuse and log `reason`.
  void expect_refused(const TcpRules& rules, const std::string& reason) {
    const std::uint64_t before = refused_by_physics();
    ZmqContext context(RealtimeConfig{.priority = 0, .cpu = -1}, rules);
    ZmqSender<ToolMotion> foreign(context, connect_to("tcp://10.77.0.2:5551", "links.tool_motion"));
    EXPECT_THAT(physics_->await_err("event=peer_refused link=links.tool_motion"),
                HasSubstr(reason));
    EXPECT_TRUE(watcher_->until([&] { return refused_by_physics() > before; }));
    EXPECT_FALSE(foreign.has_subscriber());
    EXPECT_EQ(writers(), 1u);
  }

  test::RunFolder run_folder_;
  TempFolder files_;
  TwoNetworks networks_;
  std::string file_;
  std::string plain_file_;
  std::optional<ProcessLinks> links_;
  std::optional<Watcher> watcher_;
  std::optional<Program> physics_;
  std::optional<Program> mofc_;
  std::optional<Program> device_;
};

// --- the session works ----------------------------------------------------------------------

TEST_F(TwoMachines, ACutCableEndsTheForceAndAMendedOneBringsItBack) {
  start(true);
  ASSERT_FALSE(HasFailure());

  ASSERT_TRUE(networks_.cut());
  EXPECT_TRUE(watcher_->until([&] { return is_without_physics(); }));
  ASSERT_TRUE(networks_.mend());
  EXPECT_TRUE(watcher_->until([&] { return is_pressing(); }));

  EXPECT_EQ(writers(), 1u);  // the same processes
  EXPECT_EQ(watcher_->mirror().mofc_counters().interaction.sessions, 1u);
  EXPECT_EQ(refused_by_physics(), 0u);
}

// As after a reboot: the services start before the network gives the machine its address.
TEST_F(TwoMachines, ANodeThatStartsBeforeItsAddressExistsWaitsForIt) {
  ASSERT_TRUE(networks_.remove_address());
  start_nodes(true, {"--wait-for-address"});
  EXPECT_THAT(physics_->await_err("event=waiting_for_address"), HasSubstr("tcp://10.77.0.2:555"));
  EXPECT_TRUE(watcher_->until([&] { return is_without_physics(); }));

  ASSERT_TRUE(networks_.add_address());

  EXPECT_TRUE(watcher_->until([&] { return is_pressing(); })) << physics_->err();
}

TEST_F(TwoMachines, ANodeThatWaitsForItsAddressCanBeStopped) {
  ASSERT_TRUE(networks_.remove_address());
  start_nodes(true, {"--wait-for-address"});
  physics_->await_err("event=waiting_for_address");

  physics_->send_signal(SIGTERM);

  EXPECT_EQ(physics_->wait(), 0);
}

TEST_F(TwoMachines, WithoutTheOptionAMissingAddressIsASetupError) {
  ASSERT_TRUE(networks_.remove_address());
  start_nodes(true);

  EXPECT_EQ(physics_->wait(), 2);
  EXPECT_THAT(physics_->err(), HasSubstr("does not have that address"));
}

// A port where nobody listens refuses after one round trip.
TEST_F(TwoMachines, ADisturbedCableDelaysEachPacket) {
  constexpr Duration kDelay = 20ms;
  if (const std::string why = networks_.connect(test::PacketDisturbance{.delay = kDelay});
      !why.empty()) {
    GTEST_SKIP() << why;
  }
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(kMotionPort);
  inet_pton(AF_INET, TwoNetworks::kWorkstation, &address.sin_addr);

  const SteadyClock clock;
  const TimePoint begin = clock.now();
  EXPECT_NE(connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_EQ(errno, ECONNREFUSED);
  EXPECT_GE(clock.now() - begin, 2 * kDelay);
  close(socket);
}

// --- supervised -----------------------------------------------------------------------------

/// A launch on each machine, with the keys of its own roles only.
class Supervised : public TwoMachines {
 protected:
  void SetUp() override {
    TwoMachines::SetUp();
    if (IsSkipped()) return;
    const Session session = load_session(file_);
    links_.emplace(RealtimeConfig{.priority = 0, .cpu = -1},
                   tcp_rules(session.security, {KeyRole::kViewer}));
    watcher_.emplace(session, *links_);
    workstation_file_ = workstation_files_.write("protected.txtpb", text_of(file_));
    fs::create_directory(workstation_files_.path() / "keys");
    for (const char* key : {"allowed.keys", "physics.key_secret"}) {
      fs::copy(files_.path() / "keys" / key, workstation_files_.path() / "keys" / key);
    }
  }

  void launch_bedside(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"launch", file_, "--nodes", "device,mofc"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    bedside_.emplace("palpate", arguments);
  }
  void launch_workstation(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"launch", workstation_file_, "--nodes", "physics"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    workstation_run_folder_.use();
    workstation_.emplace("palpate", arguments, networks_.workstation());
    run_folder_.use();
  }

  static void kill_node(Program& launch, const std::string& node) {
    const std::string pid = launch.await_err("event=node_started node=" + node + " pid=");
    ASSERT_FALSE(pid.empty());
    kill(std::stoi(pid), SIGKILL);
    launch.await_err("event=node_died node=" + node);
    launch.await_err("event=node_started node=" + node, 2);
  }

  TempFolder workstation_files_;
  test::RunFolder workstation_run_folder_;
  std::string workstation_file_;
  std::optional<Program> bedside_;
  std::optional<Program> workstation_;
};

TEST_F(Supervised, EachMachineKeepsItsOwnNodesRunning) {
  const std::string bedside_json = (files_.path() / "run.json").string();
  const std::string workstation_json = (workstation_files_.path() / "run.json").string();
  const viewer::TelemetryMirror& mirror = watcher_->mirror();

  // the bedside does not wait for the workstation: the device is answered, without a force
  launch_bedside({"--json", bedside_json});
  ASSERT_TRUE(watcher_->until([&] { return is_without_physics(); })) << bedside_->err();
  launch_workstation({"--json", workstation_json});
  ASSERT_TRUE(watcher_->until([&] { return is_pressing(); })) << workstation_->err();

  // each machine restarts its own nodes
  kill_node(*workstation_, "physics");
  EXPECT_TRUE(watcher_->until([&] {
    return mirror.physics_link().sessions == 2 && mirror.mofc_counters().interaction.sessions == 2;
  }));
  EXPECT_TRUE(watcher_->until([&] { return is_pressing(); }));
  kill_node(*bedside_, "mofc");
  EXPECT_TRUE(watcher_->until([&] { return mirror.mofc_link().sessions == 2; }));
  EXPECT_TRUE(watcher_->until([&] { return is_pressing(); }));

  // each summarises its own nodes and the figures that its keys permit
  for (Program* launch : {&*bedside_, &*workstation_}) {
    launch->send_signal(SIGTERM);
    EXPECT_EQ(launch->wait(), 0) << launch->err();
  }
  const json bedside = json::parse(text_of(bedside_json));
  EXPECT_EQ(bedside["restarts"], json({{"mofc", 1}, {"device", 0}}));
  EXPECT_GT(bedside["max_force_n"], 0.1);
  EXPECT_THAT(bedside_->out(), HasSubstr("answered in time"));
  const json workstation = json::parse(text_of(workstation_json));
  EXPECT_EQ(workstation["restarts"], json({{"physics", 1}}));
  EXPECT_FALSE(workstation.contains("max_force_n"));
  EXPECT_THAT(workstation_->out(), HasSubstr("no figures without the viewer's key"));
  EXPECT_THAT(workstation_->err(), HasSubstr("has no viewer.key_secret"));
}

// A recording needs telemetry. The error is reported before any node starts.
TEST_F(Supervised, WithoutTheViewersKeyNothingIsRecorded) {
  launch_workstation({"--record", (workstation_files_.path() / "run.mcap").string()});

  EXPECT_EQ(workstation_->wait(), 2);
  EXPECT_THAT(workstation_->err(), HasSubstr("viewer.key_secret: No such file"));
  EXPECT_THAT(workstation_->err(), Not(HasSubstr("event=node_started")));
}

// --- foreign peers --------------------------------------------------------------------------

TEST_F(TwoMachines, APeerWithoutAKeyIsRefused) {
  start(true);
  // the end that detects the mismatch first closes the connection
  expect_refused({.may_be_plain = true}, "plain text");
}

TEST_F(TwoMachines, AnUnknownKeyIsRefused) {
  start(true);
  LinkKeys keys = keys_of(KeyRole::kDevice);
  keys.own[static_cast<std::size_t>(KeyRole::kDevice)] = new_key_pair();
  expect_refused({.keys = std::make_shared<const LinkKeys>(keys)}, "unknown key");
}

TEST_F(TwoMachines, AViewersKeyDoesNotReachACommandSocket) {
  start(true);
  LinkKeys keys = keys_of(KeyRole::kDevice);
  keys.own[static_cast<std::size_t>(KeyRole::kDevice)] =
      keys_of(KeyRole::kViewer).of(KeyRole::kViewer);
  expect_refused({.keys = std::make_shared<const LinkKeys>(keys)}, "a key of another role");
}

TEST_F(TwoMachines, AClientThatExpectsAnotherServerKeyIsRefused) {
  start(true);
  const KeyPair device = *keys_of(KeyRole::kDevice).of(KeyRole::kDevice);
  const LinkKeys keys{
      .allowed = parse_allowed_keys(
          "device " + device.public_key + "\nphysics " + new_key_pair().public_key + "\n", "test"),
      .own = {device}};
  expect_refused({.keys = std::make_shared<const LinkKeys>(keys)}, "expects another key");
}

TEST_F(TwoMachines, PlainTextIsRefused) {
  start(true);
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(kMotionPort);
  inet_pton(AF_INET, TwoNetworks::kWorkstation, &address.sin_addr);
  ASSERT_EQ(connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  // ZMTP 1.0, which has no keys: an empty identity, then a subscription to everything
  const std::string hello("\x01\x00\x02\x00\x01", 5);
  ASSERT_EQ(write(socket, hello.data(), hello.size()), 5);

  EXPECT_THAT(physics_->await_err("event=peer_refused link=links.tool_motion"),
              HasSubstr("not a ZeroMQ 4 peer"));
  EXPECT_TRUE(watcher_->until([&] { return refused_by_physics() > 0; }));
  // the answer is a greeting at most, then the connection ends
  std::string answer;
  char bytes[256];
  pollfd readable{.fd = socket, .events = POLLIN, .revents = 0};
  ssize_t n = 0;
  const auto silence = static_cast<int>(test::patience(10s).count());
  while (poll(&readable, 1, silence) == 1 && (n = read(socket, bytes, sizeof(bytes))) > 0) {
    answer.append(bytes, static_cast<std::size_t>(n));
  }
  EXPECT_LE(n, 0);
  EXPECT_LE(answer.size(), 64u);
  EXPECT_EQ(writers(), 1u);
  close(socket);
}

TEST_F(TwoMachines, ASecondClampWithTheRightKeyIsIgnoredAndCounted) {
  const test::QuietMachine machine;
  start(true);
  ZmqContext context(RealtimeConfig{.priority = 0, .cpu = -1},
                     {.keys = std::make_shared<const LinkKeys>(keys_of(KeyRole::kDevice))});
  ZmqSender<ToolMotion> second(context, connect_to("tcp://10.77.0.2:5551", "links.tool_motion"));
  ASSERT_TRUE(second.wait_for_peer(test::patience(10s)));  // so the key is accepted

  ToolMotion motion;
  motion.header.session_id = 42;
  motion.device_session_id = 43;
  motion.tool_position_world_m = Vector3(0, 0, -1);
  const auto ignored = [&] { return watcher_->mirror().physics_counters().tool_motion.rejected; };
  const std::uint64_t before = ignored();
  EXPECT_TRUE(watcher_->until([&] {
    ++motion.header.sequence;
    second.send(motion);
    return ignored() > before + 10;
  }));
  // the first clamp was never silent for so long that the second took its place
  if (writers() > 1 && machine.may_check("one writer")) {
    ADD_FAILURE() << writers() << " writers";
  }
  physics_->await_err("event=frame_refused link=tool_motion");
}

// --- the wire -------------------------------------------------------------------------------

class OnTheWire : public TwoMachines, public testing::WithParamInterface<bool> {};

TEST_P(OnTheWire, PlainTextIsVisibleOnlyWithoutKeys) {
  const bool is_protected = GetParam();
  std::optional<Wire> wire;
  wire.emplace();
  start(is_protected);
  ASSERT_TRUE(watcher_->until([&] {
    wire->listen();
    return watcher_->mirror().physics_counters().loop.ticks > 2000;
  }));

  // hundreds of motions and interactions, the scene and telemetry
  EXPECT_GT(wire->heard().size(), 100'000u);
  EXPECT_EQ(wire->heard().find(kTissue) != std::string::npos, !is_protected);
  EXPECT_EQ(wire->heard().find("two_machines_test") != std::string::npos, !is_protected);
}

INSTANTIATE_TEST_SUITE_P(Keys, OnTheWire, testing::Bool(), [](const auto& with) {
  return std::string(with.param ? "Protected" : "Insecure");
});

// --- no keys --------------------------------------------------------------------------------

TEST_F(TwoMachines, WithoutKeysTheNetworkNeedsInsecure) {
  for (const char* node : {"physics_node", "device_node", "mofc_node", "viewer_node"}) {
    Program program(node, {"--session", plain_file_, "--seconds", "10"},
                    std::string(node) == "physics_node" ? networks_.workstation() : -1);
    EXPECT_EQ(program.wait(), 2) << node;
    EXPECT_THAT(program.err(), HasSubstr("plain text")) << node;
    EXPECT_THAT(program.err(), HasSubstr("palpate keygen")) << node;
  }
}

}  // namespace
}  // namespace palpate
