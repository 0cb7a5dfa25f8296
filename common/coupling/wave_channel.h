// SPDX-License-Identifier: Apache-2.0
/// @file
/// wave_channel.h — the shared half of wave variables: what both ends of a delayed channel do with
/// the waves they send and receive. Eigen only; installed with the controllers.
///
///     u = (b v + f)/√(2b)   towards the tissue        w = (b v − f)/√(2b)   back to the hand
///     f v = (u² − w²)/2     f the force into the channel, v the velocity, b the impedance
///
/// A message carries sums since the stream began, so a lost or late one is no loss of motion: until
/// the next arrives the wave is zero, then the sum has grown by all of it. What a receiver passes
/// on is covered by the energy that arrived, so that a channel of any delay, varying or not, with
/// losses and reordering, generates nothing. Lemma: wave_channel. Source: [Niemeyer91]; sums of
/// wave and energy: [Niemeyer98].
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

/// Palpate: what its parts share.
namespace palpate {

/// One direction of the channel as a message carries it.
struct Wave {
  std::uint64_t stream = 0;                       ///< changes when the sums begin anew
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();  ///< ∫ u dt [√W·s]
  double energy_joule = 0.0;                      ///< ∫ |u|²/2 dt, ≥ 0
  double impedance_newton_s_per_m = 0.0;          ///< b > 0; 0: there is no wave

  /// False: a message without a wave.
  [[nodiscard]] bool is_present() const noexcept { return impedance_newton_s_per_m > 0.0; }
};

/// The sending end of one direction. No allocation, no throw.
class WaveSender {
 public:
  /// Starts sums at zero.
  /// @param stream  differs from that of earlier sums   @param impedance_newton_s_per_m  b > 0
  void begin(std::uint64_t stream, double impedance_newton_s_per_m) noexcept {
    wave_ = {.stream = stream, .impedance_newton_s_per_m = impedance_newton_s_per_m};
  }
  /// Adds the wave of one period.
  /// @param part  u T [√W·s]   @param T  > 0 [s]
  void send(const Eigen::Vector3d& part, double T) noexcept {
    wave_.sum += part;
    wave_.energy_joule += part.squaredNorm() / (2.0 * T);
  }
  /// What the next message carries.
  [[nodiscard]] const Wave& wave() const noexcept { return wave_; }

 private:
  Wave wave_;
};

/// The receiving end of one direction. No allocation, no throw.
class WaveReceiver {
 public:
  /// Starts with this message: what its sums already contain counts as passed on.
  void begin(const Wave& wave) noexcept {
    last_ = wave;
    pending_.setZero();
    energy_joule_ = 0.0;
  }
  /// Takes in the newest message of the same stream; the same one again changes nothing.
  void receive(const Wave& wave) noexcept {
    pending_ += wave.sum - last_.sum;
    energy_joule_ = std::max(0.0, energy_joule_ + wave.energy_joule - last_.energy_joule);
    last_ = wave;
  }
  /// u T [√W·s], the wave of a period of T > 0 [s]: all that waits, or as much as the energy that
  /// arrived covers; the rest waits.
  [[nodiscard]] Eigen::Vector3d take(double T) noexcept {
    const double needed_joule = pending_.squaredNorm() / (2.0 * T);
    const double share =
        needed_joule > energy_joule_ ? std::sqrt(energy_joule_ / needed_joule) : 1.0;
    Eigen::Vector3d part = share * pending_;
    pending_ -= part;
    energy_joule_ = std::max(0.0, energy_joule_ - share * share * needed_joule);
    return part;
  }
  /// Stream of the newest message.
  [[nodiscard]] std::uint64_t stream() const noexcept { return last_.stream; }
  /// The newest message carries a wave.
  [[nodiscard]] bool has_begun() const noexcept { return last_.is_present(); }

 private:
  Wave last_;
  Eigen::Vector3d pending_ = Eigen::Vector3d::Zero();
  double energy_joule_ = 0.0;
};

}  // namespace palpate
