// SPDX-License-Identifier: Apache-2.0
// A person at a page acknowledges an emulated device, with viewer { control: true } and the token.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <csignal>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "common/link/codec/codec.h"
#include "tests/support/machine/places.h"
#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/web_client.h"
#include "tests/support/wired/acknowledge.h"

namespace palpate {
namespace {

using test::Program;
using test::WebClient;
using testing::HasSubstr;

const std::string kSession = test::source_dir() + "/deploy/sessions/haply.txtpb";
const std::string kToken = "0123456789abcdef0123";
constexpr std::uint8_t kDevice = 3;  // channel of viewer_node
constexpr auto kAdvertise = R"({"op":"advertise","channels":[{"id":1,"topic":"/acknowledgement",)"
                            R"("encoding":"protobuf","schemaName":"palpate.v1.Acknowledgement"}]})";

class PageAcknowledgement : public testing::Test {
 protected:
  PageAcknowledgement() {
    const std::string endpoint = test::HeldPort().endpoint();
    port_ = "device.haply_inverse.port=" + endpoint.substr(endpoint.rfind(':') + 1);
    token_ = files_.write("token", kToken + "\n");
    std::filesystem::permissions(token_, std::filesystem::perms(0600));
  }

  /// The nodes and the emulator, but no viewer. Whether the push is right is tested elsewhere.
  void launch(const std::string& control) {
    launch_.emplace("palpate",
                    std::vector<std::string>{
                        "launch", kSession, "--emulate", "--set", port_, "--set",
                        "device.accept=NO_MOTOR_WATCHDOG", "--set", "device.skip_motor_check=true",
                        "--set", "device.haply_inverse.transfer_limit_ms=1000", "--set",
                        "viewer.control=" + control, "--no-viewer", "--no-realtime"});
    launch_->await_err("event=device_phase phase=calibrated");
  }
  void view(const std::string& control) {
    viewer_.emplace("viewer_node", std::vector<std::string>{"--session", kSession, "--set",
                                                            "viewer.control=" + control, "--listen",
                                                            "127.0.0.1:0", "--token-file", token_});
    web_port_ = static_cast<std::uint16_t>(
        std::stoi(viewer_->await_err("event=web url=http://127.0.0.1:")));
  }
  void end() {
    launch_->send_signal(SIGINT);
    EXPECT_EQ(launch_->wait(), 0) << launch_->err();
  }

  static bool open(WebClient& page, const std::string& target) {
    return page.send_raw(WebClient::upgrade({}, target)) &&
           page.read_head().starts_with("HTTP/1.1 101");
  }
  static void subscribe(const WebClient& page) {
    page.send_text(R"({"op":"subscribe","subscriptions":[{"id":3,"channelId":3}]})");
  }
  /// The newest that the page shows of the device in this phase, of another start than `before`.
  static std::optional<DeviceBatch> shown(WebClient& page, DevicePhase phase,
                                          std::uint64_t before = 0) {
    constexpr int kMostBatches = 5000;  // of some 50 a second
    for (int i = 0; i < kMostBatches; ++i) {
      const auto payload = page.await_data(kDevice);
      if (!payload) return std::nullopt;
      const std::string frame = static_cast<char>(MessageKind::kDeviceBatch) + *payload;
      DeviceBatch batch;
      if (Codec<DeviceBatch>().decode(std::as_bytes(std::span(frame)), batch) !=
          DecodeError::kNone) {
        return std::nullopt;
      }
      if (batch.header.session_id != before && batch.counters.phase == phase) return batch;
    }
    return std::nullopt;
  }
  /// An Acknowledgement, written by hand: field 2 of 8 bytes, fields 3 and 4 integers below 128.
  static void acknowledge(const WebClient& page, std::uint64_t device, char phase, char faults) {
    const auto bytes = std::bit_cast<std::array<char, 8>>(device);
    page.send_raw(WebClient::frame(2, std::string("\x01\x01\0\0\0", 5) + "\x11" +
                                          std::string(bytes.data(), 8) + "\x18" + phase + "\x20" +
                                          faults));
  }
  /// Until the line is in the log: the link to device_node may not stand yet.
  bool acknowledges_until(const WebClient& page, std::uint64_t device, char phase, char faults,
                          const std::string& line, int times = 1) {
    return test::await([&] {
      if (test::times_in(launch_->err(), line) >= times) return true;
      acknowledge(page, device, phase, faults);
      usleep(50'000);
      return false;
    });
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string port_;
  std::string token_;
  std::optional<Program> launch_;
  std::optional<Program> viewer_;
  std::uint16_t web_port_ = 0;
};

TEST_F(PageAcknowledgement, EnablesADeviceThatIsStillAsThePageShowedIt) {
  launch("true");
  view("true");
  WebClient stranger(web_port_);
  EXPECT_FALSE(open(stranger, "/?token=0123456789abcdef0124"));
  WebClient page(web_port_);
  ASSERT_TRUE(open(page, "/?token=" + kToken));
  page.send_text(kAdvertise);
  subscribe(page);
  const auto first = shown(page, DevicePhase::kCalibrated);
  ASSERT_TRUE(first.has_value()) << launch_->err();
  const std::uint64_t device = first->header.session_id;

  // a device that is not as it was seen: of another phase, with another number of faults
  EXPECT_TRUE(acknowledges_until(page, device, 5, 0, "event=page_acknowledgement_refused"));
  acknowledge(page, device, 3, 1);
  acknowledge(page, device, 4, 0);  // no phase that waits
  EXPECT_FALSE(page.await_text("not a valid palpate.v1.Acknowledgement").empty());
  EXPECT_EQ(test::times_in(launch_->err(), "phase=enabled"), 0);
  EXPECT_TRUE(acknowledges_until(page, device, 3, 0, "event=device_phase phase=enabled"))
      << launch_->err();
  EXPECT_THAT(launch_->err(), HasSubstr("event=acknowledged_by_page count=1"));
  const auto enabled = shown(page, DevicePhase::kEnabled);
  ASSERT_TRUE(enabled.has_value());
  EXPECT_EQ(enabled->counters.page_acknowledgements, 1U) << "in every recording";

  // a restart: what was seen of the process before it counts no more
  kill(std::stoi(launch_->await_err("event=node_started node=device pid=")), SIGKILL);
  launch_->await_err("event=device_phase phase=calibrated", 2);
  const auto second = shown(page, DevicePhase::kCalibrated, device);
  ASSERT_TRUE(second.has_value()) << launch_->err();
  acknowledge(page, device, 3, 0);
  EXPECT_FALSE(page.await_text("no such device_node").empty());
  EXPECT_TRUE(acknowledges_until(page, second->header.session_id, 3, 0,
                                 "event=device_phase phase=enabled", 2))
      << launch_->err();
  end();
}

TEST_F(PageAcknowledgement, IsRefusedWithoutControl) {
  launch("false");
  view("false");
  WebClient page(web_port_);
  ASSERT_TRUE(open(page, "/?token=" + kToken));
  page.send_text(kAdvertise);
  const std::string complaint =
      "advertise: only /run_request, protobuf palpate.v1.RunRequest is accepted";
  EXPECT_FALSE(page.await_text(complaint).empty());

  // nor by a viewer that has it: device_node does not listen
  view("true");
  WebClient other(web_port_);
  ASSERT_TRUE(open(other, "/?token=" + kToken));
  other.send_text(kAdvertise);
  subscribe(other);
  const auto seen = shown(other, DevicePhase::kCalibrated);
  ASSERT_TRUE(seen.has_value()) << launch_->err();
  acknowledge(other, seen->header.session_id, 3, 0);
  EXPECT_FALSE(other.await_text("no such device_node").empty());
  ASSERT_TRUE(shown(other, DevicePhase::kCalibrated).has_value());
  end();
}

// A page may then change nothing else of a real device.
TEST_F(PageAcknowledgement, GrantsNoChangeOfTissueWithARealDevice) {
  launch("true");
  view("true");
  WebClient page(web_port_);
  ASSERT_TRUE(open(page, "/?token=" + kToken));
  page.send_text(R"({"op":"advertise","channels":[{"id":1,"topic":"/tissue_change",)"
                 R"("encoding":"protobuf","schemaName":"palpate.v1.TissueChange"}]})");
  EXPECT_FALSE(page.await_text("advertise: only /run_request").empty());
  page.send_text(kAdvertise);  // is accepted
  page.send_text(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":1}]})");
  const auto payload = page.await_data(1);
  ASSERT_TRUE(payload.has_value()) << launch_->err();
  const std::string frame = static_cast<char>(MessageKind::kSceneState) + *payload;
  SceneState scene;
  ASSERT_EQ(Codec<SceneState>().decode(std::as_bytes(std::span(frame)), scene), DecodeError::kNone);
  EXPECT_FALSE(scene.accepts_changes);
  end();
}

}  // namespace
}  // namespace palpate
