// SPDX-License-Identifier: Apache-2.0
// surface_wire.h — internal header of the codecs: the part of hop 3 with which mofc_node evaluates
// tissue itself.
#pragma once

#include "common/core/tissue.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/interaction.pb.h"

namespace palpate::wire {

void put(const SurfaceNews& news, v1::SurfaceNews& to);
/// The rules of the .proto comments; of a tile also that every index has its vertex and that no
/// triangle is flat.
void check_surface(const v1::SurfaceNews& news, Verdict& verdict);
/// @param news  passed check_surface()
void read_surface(const v1::SurfaceNews& news, SurfaceNews& to);

}  // namespace palpate::wire
