// SPDX-License-Identifier: Apache-2.0
// codec.h — conversion between messages and bytes. After decode() every required value is present,
// finite and in range; no other code repeats these checks.
//
// A frame consists of one byte, the kind of message, and the protobuf message of proto/palpate/v1.
// The kind is outside the protobuf message so that two endpoints that were connected by mistake
// refuse each other's frames at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "common/core/messages.h"
#include "common/core/scene_messages.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// The protocol version of proto/palpate/v1.
inline constexpr std::uint32_t kProtocolMajor = 1;

/// First byte of a frame. The values are part of the wire contract and are never reused.
enum class MessageKind : std::uint8_t {
  kDeviceState = 1,
  kForceCommand = 2,
  kToolMotion = 3,
  kInteraction = 4,
  kDeviceBatch = 5,
  kMofcBatch = 6,
  kPhysicsBatch = 7,
  kSceneState = 8,
  kMeshFrame = 9,
  kHandTarget = 10,
  kSubscription = 11,  ///< no protobuf message follows, but the kinds that the peer wants
  kRunState = 12,
  kRunRequest = 13,
  kTissueChange = 14,
  kAcknowledgement = 15,
};
inline constexpr std::size_t kMessageKinds = 16;  ///< largest value + 1

template <class T>
inline constexpr MessageKind kKindOf = MessageKind{};
template <>
inline constexpr MessageKind kKindOf<DeviceState> = MessageKind::kDeviceState;
template <>
inline constexpr MessageKind kKindOf<ForceCommand> = MessageKind::kForceCommand;
template <>
inline constexpr MessageKind kKindOf<ToolMotion> = MessageKind::kToolMotion;
template <>
inline constexpr MessageKind kKindOf<Interaction> = MessageKind::kInteraction;
template <>
inline constexpr MessageKind kKindOf<DeviceBatch> = MessageKind::kDeviceBatch;
template <>
inline constexpr MessageKind kKindOf<MofcBatch> = MessageKind::kMofcBatch;
template <>
inline constexpr MessageKind kKindOf<PhysicsBatch> = MessageKind::kPhysicsBatch;

template <>
inline constexpr MessageKind kKindOf<SceneState> = MessageKind::kSceneState;
template <>
inline constexpr MessageKind kKindOf<MeshFrame> = MessageKind::kMeshFrame;
template <>
inline constexpr MessageKind kKindOf<HandTarget> = MessageKind::kHandTarget;
template <>
inline constexpr MessageKind kKindOf<RunState> = MessageKind::kRunState;
template <>
inline constexpr MessageKind kKindOf<RunRequest> = MessageKind::kRunRequest;
template <>
inline constexpr MessageKind kKindOf<TissueChange> = MessageKind::kTissueChange;
template <>
inline constexpr MessageKind kKindOf<Acknowledgement> = MessageKind::kAcknowledgement;

/// Whether T belongs to hop 5.
template <class T>
inline constexpr bool kIsTelemetry = kKindOf<T> == MessageKind::kRunState ||
                                     (kKindOf<T> >= MessageKind::kDeviceBatch &&
                                      kKindOf<T> <= MessageKind::kMeshFrame);

/// Larger frames are refused before they are parsed. An Interaction of eight contacts with friction
/// takes 4 kB, its surface 3.5 kB more; a DeviceState of 64 applied forces takes 7 kB; the other
/// messages of the loop take at most 1 kB. A telemetry record takes at most 250 bytes, so that a
/// batch can hold 4000 ticks. A vertex takes 12 bytes, a triangle 12.
template <class T>
inline constexpr std::size_t kMaxFrameBytes = kIsTelemetry<T> ? std::size_t{2} << 20 : 4096;
template <>
inline constexpr std::size_t kMaxFrameBytes<DeviceState> = 8192;
template <>
inline constexpr std::size_t kMaxFrameBytes<Interaction> = 8192;
template <>
inline constexpr std::size_t kMaxFrameBytes<SceneState> = std::size_t{16} << 20;
template <>
inline constexpr std::size_t kMaxFrameBytes<MeshFrame> = std::size_t{4} << 20;

/// The error of a frame: the first one that applies, in this order.
enum class DecodeError : std::uint8_t {
  kNone,
  kTooLarge,      ///< longer than kMaxFrameBytes
  kWrongKind,     ///< another message: endpoints are mixed up
  kMalformed,     ///< not one protobuf message
  kWrongVersion,  ///< protocol_major is not kProtocolMajor
  kMissingField,
  kNotFinite,   ///< NaN or infinity where the contract does not allow it
  kOutOfRange,  ///< violates a limit of the .proto comments
};
inline constexpr std::size_t kDecodeErrors = 8;
[[nodiscard]] const char* name(DecodeError error);

/// One sentence for the log: cause and remedy.
/// @param peer_major  protocol_major of the refused frame; used by kWrongVersion only
[[nodiscard]] std::string explain(DecodeError error, std::uint32_t peer_major = 0);

/// Converts one kind of message in both directions. Reuses its protobuf messages, so that it does
/// not allocate in steady state. Not thread-safe. Instantiated for the messages of MessageKind.
template <class T>
class Codec {
 public:
  Codec();
  ~Codec();
  Codec(Codec&&) noexcept;
  Codec& operator=(Codec&&) noexcept;

  /// Converts the message to protobuf and returns the length of its frame [bytes], which write()
  /// then writes. Values are not checked here but by the receiver's decode().
  [[nodiscard]] std::size_t encode(const T& message);
  /// Writes the frame of the last encode(). @param to  a buffer of the size encode() returned
  void write(std::byte* to) const;

  /// Reads the message in `frame`. On an error `message` is unchanged. Fields unknown to this
  /// version are ignored. Quaternions and normals are normalised; those whose norm is 1 to within
  /// rounding are left unchanged, bit by bit.
  [[nodiscard]] DecodeError decode(std::span<const std::byte> frame, T& message);

  /// protocol_major of the last frame refused with kWrongVersion; 0 before.
  [[nodiscard]] std::uint32_t peer_major() const { return peer_major_; }

 private:
  struct Wire;
  std::unique_ptr<Wire> wire_;
  std::uint32_t peer_major_ = 0;
};

}  // namespace palpate
