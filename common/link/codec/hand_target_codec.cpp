// SPDX-License-Identifier: Apache-2.0
// hand_target_codec.cpp — hop 6: HandTarget.
#include "common/link/codec/wire_format.h"
#include "palpate/v1/hand_target.pb.h"

namespace palpate {

using namespace wire;

template <>
struct WireFormat<HandTarget> {
  using Message = v1::HandTarget;

  static void fill(const HandTarget& m, v1::HandTarget& wire) {
    wire.set_holder_id(m.holder_id);
    put(m.hand_position_m, *wire.mutable_hand_position_m());
    wire.set_is_released(m.is_released);
    wire.set_buttons(m.buttons);
  }

  static void check(const v1::HandTarget& wire, Verdict& verdict) {
    verdict.expect(wire.holder_id() != 0);
    verdict.vector(wire.has_hand_position_m(), wire.hand_position_m(), kMaxPositionM);
  }

  static void read(const v1::HandTarget& wire, HandTarget& m) {
    m.holder_id = wire.holder_id();
    m.hand_position_m = vector(wire.hand_position_m());
    m.is_released = wire.is_released();
    m.buttons = wire.buttons();
  }
};
template class Codec<HandTarget>;

}  // namespace palpate
