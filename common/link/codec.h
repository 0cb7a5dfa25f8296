// codec.h — the border between bytes and messages. Past decode() every number is present, finite
// and in range; no other code repeats those checks.
//
// A frame is one byte that says which message it is, then the protobuf message of
// proto/palpate/v1. The byte stands outside the message so that two endpoints wired to each other
// by mistake refuse each other's frames at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "common/core/messages.h"
#include "common/core/scene_messages.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// The version of proto/palpate/v1.
inline constexpr std::uint32_t kProtocolMajor = 1;

/// First byte of a frame. Values are part of the wire contract: never reused.
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
};
inline constexpr std::size_t kMessageKinds = 11;  ///< above the largest

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

/// Hop 5.
template <class T>
inline constexpr bool kIsTelemetry =
    kKindOf<T> >= MessageKind::kDeviceBatch&& kKindOf<T> <= MessageKind::kMeshFrame;

/// A larger frame is refused before it is parsed. An Interaction of eight contacts with friction
/// nearly fills its frame, the other loop messages take at most 1 kB; a telemetry record takes at most 250 bytes, so 4000 ticks fit one batch; a
/// vertex takes 12 bytes, a triangle 12.
template <class T>
inline constexpr std::size_t kMaxFrameBytes = kIsTelemetry<T> ? std::size_t{1} << 20 : 4096;
template <>
inline constexpr std::size_t kMaxFrameBytes<SceneState> = std::size_t{16} << 20;
template <>
inline constexpr std::size_t kMaxFrameBytes<MeshFrame> = std::size_t{4} << 20;

/// What is wrong with a frame. The first that applies, in this order.
enum class DecodeError : std::uint8_t {
  kNone,
  kTooLarge,      ///< longer than kMaxFrameBytes
  kWrongKind,     ///< another message: endpoints are cross-wired
  kMalformed,     ///< not one protobuf message
  kWrongVersion,  ///< protocol_major is not kProtocolMajor
  kMissingField,
  kNotFinite,   ///< NaN or infinity where the contract does not allow it
  kOutOfRange,  ///< a limit of the .proto comments is broken
};
inline constexpr std::size_t kDecodeErrors = 8;
[[nodiscard]] const char* name(DecodeError error);

/// One sentence for the log: what it means and what to do.
/// @param peer_major  protocol_major of the refused frame; used by kWrongVersion only
[[nodiscard]] std::string explain(DecodeError error, std::uint32_t peer_major = 0);

/// Converts one kind of message both ways. Owns the protobuf message and reuses it: in steady state
/// neither way allocates. Not thread-safe. Instantiated for the messages of MessageKind.
template <class T>
class Codec {
 public:
  Codec();
  ~Codec();
  Codec(Codec&&) noexcept;
  Codec& operator=(Codec&&) noexcept;

  /// Takes the message over and returns the length of its frame [bytes]; write() then puts it
  /// there. Does not check: the receiver's decode() does.
  [[nodiscard]] std::size_t encode(const T& message);
  /// Writes the frame of the last encode(). @param to  room for as many bytes as encode() returned
  void write(std::byte* to) const;

  /// The message in `frame`, whole or not at all: on any error `message` is untouched. Fields that
  /// this version does not know are ignored. Quaternions and normals come out with norm 1; those
  /// that have it already to within rounding come out as they were sent, to the bit.
  [[nodiscard]] DecodeError decode(std::span<const std::byte> frame, T& message);

  /// protocol_major of the last frame refused with kWrongVersion; 0 before.
  [[nodiscard]] std::uint32_t peer_major() const { return peer_major_; }

 private:
  struct Wire;
  std::unique_ptr<Wire> wire_;
  std::uint32_t peer_major_ = 0;
};

}  // namespace palpate
