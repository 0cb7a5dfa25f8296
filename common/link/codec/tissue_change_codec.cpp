// SPDX-License-Identifier: Apache-2.0
// tissue_change_codec.cpp — hop 8: TissueChange.
#include "common/link/codec/wire_format.h"
#include "palpate/v1/tissue_change.pb.h"

namespace palpate {

using namespace wire;

template <>
struct WireFormat<TissueChange> {
  using Message = v1::TissueChange;

  static void fill(const TissueChange& m, v1::TissueChange& wire) {
    wire.set_tissue(m.tissue);
    wire.set_stiffness_newton_per_m(m.stiffness_newton_per_m);
    wire.set_damping_newton_s_per_m(m.damping_newton_s_per_m);
    wire.set_restores(m.restores);
  }

  static void check(const v1::TissueChange& wire, Verdict& verdict) {
    verdict.number(wire.stiffness_newton_per_m(), 0.0, kMaxStiffnessNewtonPerM);
    verdict.number(wire.damping_newton_s_per_m(), 0.0, kMaxDampingNewtonSPerM);
    verdict.expect((wire.stiffness_newton_per_m() + wire.damping_newton_s_per_m() > 0.0) !=
                   wire.restores());
  }

  static void read(const v1::TissueChange& wire, TissueChange& m) {
    m.tissue = wire.tissue();
    m.stiffness_newton_per_m = wire.stiffness_newton_per_m();
    m.damping_newton_s_per_m = wire.damping_newton_s_per_m();
    m.restores = wire.restores();
  }
};
template class Codec<TissueChange>;

}  // namespace palpate
