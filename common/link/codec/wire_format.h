// SPDX-License-Identifier: Apache-2.0
// wire_format.h — internal header of the codecs: conversion and checks of single values, and the
// members of Codec<T>. The file of each hop specialises WireFormat for its messages and
// instantiates their codecs.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/coupling/wave_channel.h"
#include "common/link/codec/codec.h"
#include "palpate/v1/common.pb.h"

namespace palpate {

namespace wire {

// Limits of the .proto comments that several hops share.
inline constexpr double kMaxPositionM = 1e3;
inline constexpr double kMaxVelocityMPerS = 1e3;
inline constexpr double kMaxVelocityRadPerS = 1e3;
inline constexpr double kUnitTolerance = 1e-6;
/// 73 years: the difference of two time stamps within this range does not overflow.
inline constexpr std::int64_t kMaxTimeNs = std::int64_t{1} << 61;
/// |v|² of a vector that its sender normalised differs from 1 by a few roundings of 2e-16 each.
inline constexpr double kRounding = 4e-15;

// --- single values ----------------------------------------------------------------------------

inline std::int64_t ns(TimePoint t) { return t.time_since_epoch().count(); }
inline TimePoint time(std::int64_t ns) { return TimePoint(Duration(ns)); }

inline void put(const Vector3& v, v1::Vector3& to) {
  to.set_x(v.x());
  to.set_y(v.y());
  to.set_z(v.z());
}
inline Vector3 vector(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

inline void put(const Quaternion& q, v1::Quaternion& to) {
  to.set_w(q.w());
  to.set_x(q.x());
  to.set_y(q.y());
  to.set_z(q.z());
}

/// Normalises `v` unless its norm is 1 to within rounding. So a message received over a socket
/// equals one received over a memory link.
template <class V>
V unit(V v) {
  if (std::abs(v.squaredNorm() - 1.0) > kRounding) v.normalize();
  return v;
}
inline Quaternion quaternion(const v1::Quaternion& q) {
  return unit(Quaternion(q.w(), q.x(), q.y(), q.z()));
}

inline void put(const Header& header, v1::Header& to) {
  to.set_protocol_major(kProtocolMajor);
  to.set_session_id(header.session_id);
  to.set_sequence(header.sequence);
  to.set_sampled_at_ns(ns(header.sampled_at));
}
inline Header header(const v1::Header& h) {
  return {.session_id = h.session_id(),
          .sequence = h.sequence(),
          .sampled_at = time(h.sampled_at_ns())};
}

inline void put_stamp(std::uint64_t session_id, std::uint64_t sequence, TimePoint sampled_at,
                      v1::DeviceStamp& to) {
  to.set_session_id(session_id);
  to.set_sequence(sequence);
  to.set_sampled_at_ns(ns(sampled_at));
}

// Packed integers: little-endian, `bytes` of a string each.
inline void put_integer(std::uint32_t value, std::size_t bytes, std::string& to) {
  for (std::size_t i = 0; i < bytes; ++i) {
    to.push_back(static_cast<char>(static_cast<std::uint8_t>(value >> (8U * i))));
  }
}
inline std::uint32_t integer(const std::string& from, std::size_t at, std::size_t bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i) {
    value |= std::uint32_t{static_cast<std::uint8_t>(from[at + i])} << (8U * i);
  }
  return value;
}

/// Collects the errors of a message. Every field is checked; error() reports a missing field before
/// a value that is not finite, and that before a value out of range.
class Verdict {
 public:
  void require(bool is_present) { is_missing_ |= !is_present; }
  void expect(bool is_in_range) { is_out_of_range_ |= !is_in_range; }
  void finite(double x) { is_not_finite_ |= !std::isfinite(x); }
  void finite_or_nan(double x) { is_not_finite_ |= std::isinf(x); }
  void number(double x, double low, double high) {
    finite(x);
    expect(x >= low && x <= high);
  }
  void time(std::int64_t ns) { expect(ns >= -kMaxTimeNs && ns <= kMaxTimeNs); }

  /// Each component within ±limit.
  void vector(bool is_present, const v1::Vector3& v, double limit) {
    require(is_present);
    for (const double x : {v.x(), v.y(), v.z()}) number(x, -limit, limit);
  }
  void unit_vector(bool is_present, const v1::Vector3& v) {
    require(is_present);
    for (const double x : {v.x(), v.y(), v.z()}) finite(x);
    number(Vector3(v.x(), v.y(), v.z()).norm(), 1.0 - kUnitTolerance, 1.0 + kUnitTolerance);
  }
  void orientation(bool is_present, const v1::Quaternion& q) {
    require(is_present);
    for (const double x : {q.w(), q.x(), q.y(), q.z()}) finite(x);
    number(Quaternion(q.w(), q.x(), q.y(), q.z()).norm(), 1.0 - kUnitTolerance,
           1.0 + kUnitTolerance);
  }
  void header(const v1::Header& h) {
    expect(h.session_id() != 0);
    time(h.sampled_at_ns());
  }
  void stamp(bool is_present, const v1::DeviceStamp& s) {
    require(is_present);
    expect(s.session_id() != 0);
    time(s.sampled_at_ns());
  }

  [[nodiscard]] DecodeError error() const {
    if (is_missing_) return DecodeError::kMissingField;
    if (is_not_finite_) return DecodeError::kNotFinite;
    return is_out_of_range_ ? DecodeError::kOutOfRange : DecodeError::kNone;
  }

 private:
  bool is_missing_ = false;
  bool is_not_finite_ = false;
  bool is_out_of_range_ = false;
};

// --- wave variables, on hops 2 and 3 ----------------------------------------------------------

inline constexpr double kMaxWaveSum = 1e6;
inline constexpr double kMaxWaveJoule = 1e9;
inline constexpr double kMinImpedanceNewtonSPerM = 1e-3;
inline constexpr double kMaxImpedanceNewtonSPerM = 1e4;

inline void put(const Wave& wave, v1::Wave& to) {
  to.set_stream(wave.stream);
  put(wave.sum, *to.mutable_sum());
  to.set_energy_joule(wave.energy_joule);
  to.set_impedance_newton_s_per_m(wave.impedance_newton_s_per_m);
}
inline void check_wave(const v1::Wave& wave, Verdict& verdict) {
  verdict.vector(wave.has_sum(), wave.sum(), kMaxWaveSum);
  verdict.number(wave.energy_joule(), 0.0, kMaxWaveJoule);
  verdict.number(wave.impedance_newton_s_per_m(), kMinImpedanceNewtonSPerM,
                 kMaxImpedanceNewtonSPerM);
}
inline Wave wave(const v1::Wave& wave) {
  return {.stream = wave.stream(),
          .sum = vector(wave.sum()),
          .energy_joule = wave.energy_joule(),
          .impedance_newton_s_per_m = wave.impedance_newton_s_per_m()};
}

}  // namespace wire

// --- codec ------------------------------------------------------------------------------------

/// How a message T is converted. A specialisation has the protobuf type `Message` and three
/// functions, all without the header:
///   fill(const T&, Message&)         T to protobuf; the Message is clear
///   check(const Message&, wire::Verdict&)  the rules of the .proto comments
///   read(const Message&, T&)         protobuf to T, once check() found no error
template <class T>
struct WireFormat;

template <class T>
struct Codec<T>::Wire {
  typename WireFormat<T>::Message outgoing;
  typename WireFormat<T>::Message incoming;
};

template <class T>
Codec<T>::Codec() : wire_(std::make_unique<Wire>()) {}
template <class T>
Codec<T>::~Codec() = default;
template <class T>
Codec<T>::Codec(Codec&&) noexcept = default;
template <class T>
Codec<T>& Codec<T>::operator=(Codec&&) noexcept = default;

template <class T>
std::size_t Codec<T>::encode(const T& message) {
  auto& proto = wire_->outgoing;
  proto.Clear();
  wire::put(message.header, *proto.mutable_header());
  WireFormat<T>::fill(message, proto);
  return 1 + proto.ByteSizeLong();
}

template <class T>
void Codec<T>::write(std::byte* to) const {
  *to = static_cast<std::byte>(kKindOf<T>);
  wire_->outgoing.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(to + 1));
}

template <class T>
DecodeError Codec<T>::decode(std::span<const std::byte> frame, T& message) {
  // checks that need no parsing
  if (frame.size() > kMaxFrameBytes<T>) return DecodeError::kTooLarge;
  if (frame.empty()) return DecodeError::kMalformed;
  if (frame[0] != static_cast<std::byte>(kKindOf<T>)) return DecodeError::kWrongKind;
  auto& proto = wire_->incoming;
  if (!proto.ParseFromArray(frame.data() + 1, static_cast<int>(frame.size() - 1))) {
    return DecodeError::kMalformed;
  }

  // version first: a newer contract may change the meaning of other fields
  const std::uint32_t major = proto.header().protocol_major();
  if (major == 0) return DecodeError::kMissingField;
  if (major != kProtocolMajor) {
    peer_major_ = major;
    return DecodeError::kWrongVersion;
  }

  wire::Verdict verdict;
  verdict.header(proto.header());
  WireFormat<T>::check(proto, verdict);
  if (verdict.error() != DecodeError::kNone) return verdict.error();

  message.header = wire::header(proto.header());
  WireFormat<T>::read(proto, message);
  return DecodeError::kNone;
}

}  // namespace palpate
