// SPDX-License-Identifier: Apache-2.0
// wave_end.h — the physics' end of wave variables: the tool is not where hop 2 says but where the
// waves move it.
//
//   √(2b) u = b v + f(p + T v, v)     p ← p + T v     w = u − √(2/b) f
//
// solved with the contact model of the last step, because the engine is asked once a step; p and w
// then follow from the force that it gave, so that f·v = (|u|² − |w|²)/2 holds exactly whatever the
// model was. Source: [Niemeyer91].
#pragma once

#include "common/core/messages.h"
#include "common/coupling/wave_channel.h"

namespace palpate::physics {

/// One tool. advance() before the engine's step, answer() after it. No allocation, no throw.
class WaveEnd {
 public:
  /// The motion for the engine: of hop 2, but for the position and the velocity of the tool if it
  /// carries waves. A new stream begins at the tool's position.
  /// @param last    answer to the last step
  /// @param now     of this step, physics' clock
  [[nodiscard]] const ToolMotion& advance(const ToolMotion& motion, const Interaction& last,
                                          TimePoint now) noexcept;
  /// Adds the wave that goes back.
  void answer(Interaction& interaction) noexcept;

 private:
  ToolMotion motion_;
  WaveReceiver receiver_;
  WaveSender sender_;
  std::uint64_t device_session_id_ = 0;
  std::uint64_t mofc_session_id_ = 0;
  TimePoint stepped_at_{};
  double T_ = 0.0;                        // since the last step [s]; 0: nothing to answer
  Vector3 arrived_ = Vector3::Zero();     // u T
  Vector3 position_m_ = Vector3::Zero();  // p, W
};

}  // namespace palpate::physics
