// SPDX-License-Identifier: Apache-2.0
// A relay between the nodes and viewers: CURVE on both sides, one receiver at each node.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/web_client.h"

namespace palpate {
namespace {

using test::Program;
using test::WebClient;
using testing::HasSubstr;

/// Telemetry over tcp, so that it needs keys; the hand dents the tissue twice a second.
constexpr const char* kRelaySession = R"(
name: "relayed"
realtime { priority: 0 cpu: -1 }
device { monitor: off rate_hz: 200 lease_us: 12500 }
hand { sinusoid { center_m { z: 0 } amplitude_m { z: 0.008 } frequency_hz { z: 2 } } }
mofc { controller: none stale_after_ms: 200 }
links { physics_telemetry: "tcp://127.0.0.1:PORT" }
scene {
  tool { tip_radius_m: 0.003 }
  tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 damping_newton_s_per_m: 1 } }
}
security { key_folder: "keys" }
viewer { web { port: 0 } }
)";

class RelayTest : public testing::Test {
 protected:
  RelayTest() {
    std::string session = kRelaySession;
    const std::string address = "tcp://127.0.0.1:PORT";
    session.replace(session.find(address), address.size(), test::HeldPort().endpoint());
    file_ = files_.write("relayed.txtpb", session);
    EXPECT_EQ(test::run_program("palpate", {"keygen", keys()}).status, 0);
  }
  [[nodiscard]] std::string keys() const { return (files_.path() / "keys").string(); }
  [[nodiscard]] std::uint16_t port_of(Program& viewer) const {
    const std::string rest = viewer.await_err("event=web url=http://127.0.0.1:");
    return static_cast<std::uint16_t>(rest.empty() ? 0 : std::stoi(rest));
  }
  [[nodiscard]] std::vector<std::string> viewer(std::vector<std::string> more) const {
    more.insert(more.begin(), {"--session", file_, "--quiet", "--listen", "127.0.0.1:0"});
    return more;
  }
  static void subscribe(const WebClient& client, int channel) {
    client.send_text(R"({"op":"subscribe","subscriptions":[{"id":)" + std::to_string(channel) +
                     R"(,"channelId":)" + std::to_string(channel) + "}]}");
  }
  /// Scene, meshes and telemetry arrive.
  static void expect_everything(std::uint16_t port, const std::string& mesh_topic) {
    WebClient client(port);
    ASSERT_TRUE(client.open_web_socket());
    EXPECT_THAT(client.await_text("advertise"), HasSubstr(mesh_topic));
    for (const int channel : {1, 2, 3, 4, 5}) {
      subscribe(client, channel);
      EXPECT_TRUE(client.await_data(static_cast<std::uint8_t>(channel)).has_value()) << channel;
    }
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string file_;
};

TEST_F(RelayTest, FollowersGetEverythingAlsoThoseThatComeLate) {
  Program nodes("palpate", {"launch", file_, "--no-realtime", "--no-viewer"});
  Program relay("viewer_node", viewer({"--publish", "tcp://127.0.0.1:*"}));
  const std::string rest = relay.await_err("event=relay endpoint=");
  const std::string endpoint = rest.substr(0, rest.find_first_of(" \n"));
  ASSERT_THAT(endpoint, HasSubstr("tcp://127.0.0.1:"));

  Program first("viewer_node", viewer({"--follow", endpoint}));
  expect_everything(port_of(first), "\"/mesh\"");
  // the scene and the meshes were sent already; the relay sends them again
  Program late("viewer_node", viewer({"--follow", endpoint, "--audience", "20"}));
  expect_everything(port_of(late), "\"/mesh_steps\"");
  expect_everything(port_of(relay), "\"/mesh\"");
  EXPECT_THAT(relay.err(), testing::Not(HasSubstr("peer_refused")));

  // each end needs a key of its own: that of the audience opens no node, a viewer's not the relay
  for (const auto& [option, role] :
       {std::pair{"--publish", "relay"}, std::pair{"--follow", "audience"}}) {
    std::filesystem::remove(keys() + "/" + role + ".key_secret");
    const test::Outcome keyless =
        test::run_program("viewer_node", {"--session", file_, option, endpoint, "--no-web"});
    EXPECT_EQ(keyless.status, 2);
    EXPECT_THAT(keyless.err, HasSubstr(std::string(role) + ".key_secret"));
  }
}

}  // namespace
}  // namespace palpate
