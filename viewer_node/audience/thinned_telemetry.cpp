// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/audience/thinned_telemetry.h"

#include <algorithm>
#include <utility>

#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {
namespace {

/// Enough for curves of a minute on a screen.
constexpr double kTicksPerSecond = 50.0;

std::uint64_t stride_of(double rate_hz) {
  return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(rate_hz / kTicksPerSecond));
}

// the halves of one device tick are kept or left out together
std::uint64_t number_of(const DeviceTick& tick) { return tick.sequence; }
std::uint64_t number_of(const MofcTick& tick) { return tick.device_sequence; }
std::uint64_t number_of(const PhysicsTick& tick) { return tick.sequence; }

}  // namespace

ThinnedTelemetry::ThinnedTelemetry(const Session& session, WebServer& server, Duration interval)
    : server_(server), interval_(interval) {
  const std::size_t sides = session.sides.size();
  device_.resize(sides);
  mofc_.resize(sides);
  physics_.resize(sides);
  for (std::size_t side = 0; side < sides; ++side) {
    const std::uint64_t stride = stride_of(session.sides[side].device.rate_hz);
    device_[side].channel = index_of(WebChannel::kDevice, side);
    device_[side].stride = stride;
    mofc_[side].channel = index_of(WebChannel::kMofc, side);
    mofc_[side].stride = stride;
    physics_[side].channel = index_of(WebChannel::kPhysics, side);
    physics_[side].stride = stride_of(session.physics.rate_hz);
  }
}

template <class Batch>
void ThinnedTelemetry::keep(Node<Batch>& node, const Batch& batch) {
  if (!server_.has_subscriber(node.channel)) {
    node.next.reset();
    return;
  }
  if (!node.next) node.next.emplace();
  Batch& next = *node.next;
  auto records = std::exchange(next.records, {});
  const bool is_restart = next.header.session_id != batch.header.session_id;
  if (is_restart) records.clear();
  for (const auto& record : batch.records) {
    if (number_of(record) % node.stride == 0) records.push_back(record);
  }
  next = batch;
  next.records = std::move(records);
}

template <class Batch>
void ThinnedTelemetry::publish(Node<Batch>& node) {
  if (!node.next) return;
  node.next->header.sequence = node.sent++;  // gaps tell a page what it missed itself
  server_.publish(node.channel, wall_clock_ns(), make_payload(payload_of(node.codec, *node.next)));
  node.next.reset();
}

void ThinnedTelemetry::pump(TimePoint now) {
  if (now < next_at_) return;
  next_at_ = std::max(next_at_ + interval_, now);
  for (auto& node : device_) publish(node);
  for (auto& node : mofc_) publish(node);
  for (auto& node : physics_) publish(node);
}

}  // namespace palpate::viewer
