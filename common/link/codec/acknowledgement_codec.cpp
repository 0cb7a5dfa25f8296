// SPDX-License-Identifier: Apache-2.0
// acknowledgement_codec.cpp — hop 9: Acknowledgement.
#include <algorithm>

#include "common/link/codec/wire_format.h"
#include "palpate/v1/acknowledgement.pb.h"

namespace palpate {

using namespace wire;

template <>
struct WireFormat<Acknowledgement> {
  using Message = v1::Acknowledgement;

  static void fill(const Acknowledgement& m, v1::Acknowledgement& wire) {
    wire.set_device_session_id(m.device_session_id);
    wire.set_phase(static_cast<std::uint32_t>(m.seen.phase));
    wire.set_device_faults(m.seen.device_faults);
  }

  static void check(const v1::Acknowledgement& wire, Verdict& verdict) {
    verdict.expect(wire.device_session_id() != 0);
    const auto phase = static_cast<DevicePhase>(std::min(wire.phase(), std::uint32_t{0xFF}));
    verdict.expect(waits_for_acknowledgement(phase));
  }

  static void read(const v1::Acknowledgement& wire, Acknowledgement& m) {
    m.device_session_id = wire.device_session_id();
    m.seen = {.phase = static_cast<DevicePhase>(wire.phase()),
              .device_faults = wire.device_faults()};
  }
};
template class Codec<Acknowledgement>;

}  // namespace palpate
