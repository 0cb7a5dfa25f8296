// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/haply_emulator.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "device_node/drivers/transport/web_socket.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr Duration kHandshake = 2s;
constexpr Duration kClientSilence = 24h;
constexpr Duration kSend = 1s;

json xyz(const Vector3& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }

/// What a client's message asks for.
struct HaplyRequest {
  std::optional<Vector3> force_newton;  ///< the sum of all forces in it
  bool is_full = false;                 ///< asks for a full frame
};

/// {"vector": {x, y, z}} or {"values": {x, y, z}}
std::optional<Vector3> force_in(const json& command) {
  for (const char* dialect : {"vector", "values"}) {
    if (!command.is_object() || !command.contains(dialect)) continue;
    const json& v = command.at(dialect);
    return Vector3(v.value("x", 0.0), v.value("y", 0.0), v.value("z", 0.0));
  }
  return {};
}

/// Nothing for a text that is no message of the protocol.
std::optional<HaplyRequest> read_request(std::string_view text, const std::string& device_id) {
  const json message = json::parse(text, nullptr, false);
  if (!message.is_object()) return {};
  HaplyRequest request;
  try {
    request.is_full = message.contains("/session/force_render_full_state"_json_pointer);
    for (const json& entry : message.value("inverse3", json::array())) {
      if (entry.value("device_id", std::string()) != device_id) continue;
      const json commands = entry.value("commands", json::object());
      if (!commands.contains("set_cursor_force")) continue;
      const std::optional<Vector3> force = force_in(commands.at("set_cursor_force"));
      if (force) request.force_newton = request.force_newton.value_or(Vector3::Zero()) + *force;
    }
  } catch (const json::exception&) {
    return {};
  }
  return request;
}

/// In full frames, and in every answer while something of it is lacking.
json status_of(const EmulatedDevice& device) {
  return {{"calibrated", !device.has(WireFault::kUncalibrated)},
          {"in_use", true},
          {"power_supply", !device.has(WireFault::kNoSupply)},
          {"ready", true},
          {"started", true}};
}

json device_entry(const EmulatedDevice& device, const DeviceSample& sample, const char* id) {
  return {{"device_id", id},
          {"state",
           {{"cursor_position", xyz(sample.hand_position_m)},
            {"cursor_velocity", xyz(device.velocity_m_per_s())},
            {"current_cursor_position", xyz(sample.hand_position_m)},
            {"current_cursor_force", xyz(device.force_newton())},
            {"angular_position", {{"a0", 0.0}, {"a1", 0.0}, {"a2", 0.0}}},
            {"angular_velocity", {{"a0", 0.0}, {"a1", 0.0}, {"a2", 0.0}}},
            {"body_orientation", {{"w", 1.0}, {"x", 0.0}, {"y", 0.0}, {"z", 0.0}}},
            {"control_domain", "cartesian"},
            {"control_mode", "force"},
            {"transform", json::object()}}}};
}

/// As a hand holds it: it trembles, at 9 Hz by 1 mrad.
Quaternion trembling(const Quaternion& orientation, double time_s) {
  const double angle_rad = 1e-3 * std::sin(2.0 * std::numbers::pi * 9.0 * time_s);
  return orientation * Quaternion(Eigen::AngleAxisd(angle_rad, Vector3::UnitX()));
}

json grip_entry(const DeviceSample& sample, double time_s) {
  const Quaternion q = trembling(sample.orientation, time_s);
  return {{"device_id", HaplyEmulator::kGripId},
          {"state",
           {{"orientation", {{"w", q.w()}, {"x", q.x()}, {"y", q.y()}, {"z", q.z()}}},
            {"buttons",
             {{"a", (sample.buttons & 1U) != 0},
              {"b", (sample.buttons & 2U) != 0},
              {"c", (sample.buttons & 4U) != 0}}}}}};
}

json update(const EmulatedDevice& device, const DeviceSample& sample, const char* id) {
  json entry = device_entry(device, sample, id);
  if (device.has(WireFault::kUncalibrated) || device.has(WireFault::kNoSupply)) {
    entry["status"] = status_of(device);
  }
  return {{"inverse3", json::array({std::move(entry)})},
          {"wireless_verse_grip", json::array({grip_entry(sample, device.now_s())})}};
}

json full_frame(const EmulatedDevice& device, const DeviceSample& sample, const char* id) {
  json frame = update(device, sample, id);
  frame["session_id"] = 1;
  frame["verse_grip"] = json::array();
  frame["custom_verse_grip"] = json::array();
  json& inverse = frame["inverse3"][0];
  inverse["config"] = {
      {"type", "inverse3"},
      {"port", "emulated"},
      {"device_info", {{"major_version", 3}, {"minor_version", 0}, {"id", 0}, {"device_type", 4}}},
      {"gravity_compensation", {{"enabled", false}, {"scaling_factor", 0.0}}},
      {"handedness", "right"},
      {"torque_scaling", {{"enabled", false}}},
      {"home_return", {{"enabled", false}}},
      {"preset", "defaults"},
      {"basis", {{"permutation", "XYZ"}}},
      {"filters", {{"force_gate", {{"gain", 0.0}}}, {"damping", {{"scalar", 0.0}}}}}};
  inverse["status"] = status_of(device);
  frame["wireless_verse_grip"][0]["config"] = json::object();
  frame["wireless_verse_grip"][0]["status"] = {{"connected", true}};
  return frame;
}

/// @param last  as it was before it was lost
void spoil_grip(const EmulatedDevice& device, json& grips, json& last) {
  const bool is_off = device.has(WireFault::kGripOff);
  if (device.has(WireFault::kGripGone)) {
    grips = json::array();
  } else if (is_off || device.has(WireFault::kGripFrozen)) {
    grips[0]["state"] = last["state"];
    if (is_off) grips[0]["status"] = {{"connected", false}};
  } else {
    last = grips[0];
  }
}

}  // namespace

HaplyEmulator::HaplyEmulator(EmulatedDevice& device, std::uint16_t port)
    : device_(device), listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  const int on = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  socklen_t size = sizeof(address);
  if (::bind(listener_, reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
      ::listen(listener_, 4) != 0) {
    const std::string reason = std::strerror(errno);
    ::close(listener_);
    throw SetupError("port " + std::to_string(port) + " of 127.0.0.1: " + reason +
                     "; give another --port, or end what uses it");
  }
  getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
}

HaplyEmulator::~HaplyEmulator() { ::close(listener_); }

void HaplyEmulator::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    pollfd entry{.fd = listener_, .events = POLLIN, .revents = 0};
    if (::poll(&entry, 1, 50) <= 0) continue;
    const int socket = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket < 0) continue;
    if (device_.fault() == WireFault::kUnplugged) {
      ::close(socket);
      continue;
    }
    serve(socket, stop);
    device_.let_go();
  }
}

bool HaplyEmulator::send(WebSocket& client, const std::string& answer) {
  // a WebSocket carries messages: those that come in one transfer stay apart
  const std::string before = std::exchange(last_answer_, answer);
  if (device_.has(WireFault::kMerged) && client.send(before, kSend) != Transfer::kDone)
    return false;
  const std::size_t times = device_.transfers_of(std::as_bytes(std::span(answer))).size();
  for (std::size_t i = 0; i < times; ++i) {
    if (client.send(answer, kSend) != Transfer::kDone) return false;
  }
  return true;
}

void HaplyEmulator::serve(int socket, const std::stop_token& stop) {
  std::unique_ptr<WebSocket> client;
  try {
    client = WebSocket::accept(socket, kHandshake);
  } catch (const std::exception&) {
    return;  // no WebSocket: nothing to serve
  }
  const std::stop_callback interrupts(stop, [&] { client->interrupt(); });
  json last_grip = grip_entry(device_.read(), device_.now_s());
  std::string answer = full_frame(device_, device_.read(), kDeviceId).dump();
  for (;;) {
    if (!send(*client, answer)) return;
    std::string_view text;
    std::optional<HaplyRequest> request;
    do {  // every message has one answer, except one that is not understood
      if (client->receive(text, kClientSilence) != Transfer::kDone) return;
      request = read_request(text, kDeviceId);
    } while (!request);

    // a message without a force ends the one before: commands hold for one tick of the service
    const DeviceSample sample = device_.switch_to(request->force_newton.value_or(Vector3::Zero()));
    const WireFault fault = device_.fault();
    if (fault == WireFault::kUnplugged) return;
    if (fault == WireFault::kDelayed) std::this_thread::sleep_for(5ms);
    if (fault == WireFault::kSilent) {
      while (device_.fault() == WireFault::kSilent && !stop.stop_requested()) {
        std::this_thread::sleep_for(1ms);
      }
    }
    const char* const id = fault == WireFault::kWrongId ? "FFFF" : kDeviceId;
    json frame = request->is_full ? full_frame(device_, sample, id) : update(device_, sample, id);
    spoil_grip(device_, frame["wireless_verse_grip"], last_grip);
    if (device_.has(WireFault::kUnlisted)) frame["inverse3"] = json::array();
    answer = frame.dump();
    if (fault == WireFault::kShort) answer.resize(answer.size() / 2);
    if (fault == WireFault::kGarbage) answer = "\x01not JSON";
  }
}

}  // namespace palpate::device
