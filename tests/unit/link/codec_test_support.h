// SPDX-License-Identifier: Apache-2.0
// codec_test_support.h — frames to alter, and expectations on how a codec reads them.
#pragma once

#include <google/protobuf/message.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "common/link/codec/codec.h"
#include "palpate/v1/acknowledgement.pb.h"
#include "palpate/v1/exchange.pb.h"
#include "palpate/v1/hand_target.pb.h"
#include "palpate/v1/interaction.pb.h"
#include "palpate/v1/run.pb.h"
#include "palpate/v1/scene.pb.h"
#include "palpate/v1/telemetry.pb.h"
#include "palpate/v1/tissue_change.pb.h"
#include "palpate/v1/tool_motion.pb.h"
#include "tests/support/random_messages.h"

namespace palpate::test {

using Frame = std::vector<std::byte>;

template <class T>
Frame encoded(const T& message) {
  Codec<T> codec;
  Frame frame(codec.encode(message));
  codec.write(frame.data());
  return frame;
}

template <class T>
DecodeError decoded(const Frame& frame, T& message) {
  Codec<T> codec;
  return codec.decode(frame, message);
}

template <class T>
struct Wire;
template <>
struct Wire<DeviceState> {
  using Message = v1::DeviceState;
};
template <>
struct Wire<ForceCommand> {
  using Message = v1::ForceCommand;
};
template <>
struct Wire<ToolMotion> {
  using Message = v1::ToolMotion;
};
template <>
struct Wire<Interaction> {
  using Message = v1::Interaction;
};
template <>
struct Wire<DeviceBatch> {
  using Message = v1::DeviceTelemetry;
};
template <>
struct Wire<MofcBatch> {
  using Message = v1::MofcTelemetry;
};
template <>
struct Wire<PhysicsBatch> {
  using Message = v1::PhysicsTelemetry;
};
template <>
struct Wire<SceneState> {
  using Message = v1::SceneState;
};
template <>
struct Wire<MeshFrame> {
  using Message = v1::MeshFrame;
};
template <>
struct Wire<RunState> {
  using Message = v1::RunState;
};
template <>
struct Wire<RunRequest> {
  using Message = v1::RunRequest;
};
template <>
struct Wire<HandTarget> {
  using Message = v1::HandTarget;
};
template <>
struct Wire<TissueChange> {
  using Message = v1::TissueChange;
};
template <>
struct Wire<Acknowledgement> {
  using Message = v1::Acknowledgement;
};

/// The protobuf message of a frame, to be altered.
template <class T>
typename Wire<T>::Message opened(const Frame& frame) {
  typename Wire<T>::Message wire;
  EXPECT_TRUE(wire.ParseFromArray(frame.data() + 1, static_cast<int>(frame.size() - 1)));
  return wire;
}
template <class T>
Frame closed(const google::protobuf::Message& wire) {
  Frame frame(1 + wire.ByteSizeLong());
  frame[0] = static_cast<std::byte>(kKindOf<T>);
  EXPECT_TRUE(wire.SerializeToArray(frame.data() + 1, static_cast<int>(frame.size() - 1)));
  return frame;
}

/// A valid message without empty parts: at least two rows, contacts and applied forces.
template <class T>
T full_message();
template <>
inline DeviceState full_message() {
  Random random(7);
  DeviceState m;
  do m = random_message<DeviceState>(random);
  while (m.applied_count < 2 || !m.wrist);
  m.applied[0].has_position_at_end = true;
  return m;
}
template <>
inline ForceCommand full_message() {
  Random random(7);
  ForceCommand m;
  do m = random_message<ForceCommand>(random);
  while (m.wrist_torque_newton_m.isZero(0.0));
  return m;
}
template <>
inline ToolMotion full_message() {
  Random random(7);
  return random_message<ToolMotion>(random);
}
template <>
inline Interaction full_message() {
  Random random(7);
  Interaction m;
  do m = random_message<Interaction>(random);
  while (m.contact_count < 2 || m.surface.tile_count == 0 || m.contacts[0].arm_m.isZero(0.0) ||
         m.torque_on_tool_newton_m.isZero(0.0));
  return m;
}
template <class Batch>
Batch full_batch() {
  Random random(7);
  Batch m;
  do m = random_message<Batch>(random);
  while (m.records.size() < 2);
  return m;
}
template <>
inline DeviceBatch full_message() {
  return full_batch<DeviceBatch>();
}
template <>
inline MofcBatch full_message() {
  return full_batch<MofcBatch>();
}
template <>
inline PhysicsBatch full_message() {
  return full_batch<PhysicsBatch>();
}
template <>
inline SceneState full_message() {
  Random random(7);
  SceneState m;
  do m = random_message<SceneState>(random);
  while (m.tissues.size() < 2 || m.tissues[0].mesh.triangles.empty() ||
         m.tissues[0].vertex_stiffness_newton_per_m.empty() || !m.pointer || !m.reach);
  return m;
}
template <>
inline MeshFrame full_message() {
  Random random(7);
  return random_message<MeshFrame>(random);
}
template <>
inline HandTarget full_message() {
  Random random(7);
  return random_message<HandTarget>(random);
}
template <>
inline RunState full_message() {
  Random random(7);
  RunState m;
  do m = random_message<RunState>(random);
  while (m.markers.empty() || !m.replay);
  return m;
}
template <>
inline RunRequest full_message() {
  Random random(7);
  RunRequest m;
  do m = random_message<RunRequest>(random);
  while (!m.marker || !m.seek_s || !m.is_paused || !m.speed_ratio || !m.is_recording);
  return m;
}
template <>
inline TissueChange full_message() {
  Random random(7);
  TissueChange m;
  do m = random_message<TissueChange>(random);
  while (m.restores);
  return m;
}
template <>
inline Acknowledgement full_message() {
  Random random(7);
  return random_message<Acknowledgement>(random);
}

/// Expects that the frame is refused with `error` and leaves the message unchanged.
template <class T>
void expect_refused(const Frame& frame, DecodeError error) {
  Random random(99);
  const T before = random_message<T>(random);
  T message = before;
  EXPECT_STREQ(name(decoded(frame, message)), name(error));
  EXPECT_TRUE(same(message, before)) << "a refused frame changed the message";
}

/// Alters a valid message and expects that it is accepted, or refused as out of range.
template <class T>
void expect_range(const std::function<void(typename Wire<T>::Message&)>& alter, bool is_good) {
  auto wire = opened<T>(encoded(full_message<T>()));
  alter(wire);
  if (is_good) {
    T message;
    EXPECT_STREQ(name(decoded(closed<T>(wire), message)), "none");
  } else {
    expect_refused<T>(closed<T>(wire), DecodeError::kOutOfRange);
  }
}

}  // namespace palpate::test
