// SPDX-License-Identifier: Apache-2.0
// elastic_wire.h — internal header of the codecs: the part of hop 3 with which mofc_node solves the
// contact with elastic bodies itself.
#pragma once

#include "common/core/elastic/elastic_patch.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/interaction.pb.h"

namespace palpate::wire {

void put(const ElasticNews& news, v1::ElasticNews& to);
/// The rules of the .proto comments; also that no slot is listed twice.
void check_elastic(const v1::ElasticNews& news, Verdict& verdict);
/// @param news  passed check_elastic()
void read_elastic(const v1::ElasticNews& news, ElasticNews& to);

}  // namespace palpate::wire
