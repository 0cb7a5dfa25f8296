// SPDX-License-Identifier: Apache-2.0
// scene_wire.h — internal header of the codecs: what SceneState and Health both hold.
#pragma once

#include "common/core/pointer_config.h"

namespace palpate::v1 {
class SceneState_PointerHand;
}  // namespace palpate::v1

namespace palpate::wire {

void put(const PointerConfig& pointer, v1::SceneState_PointerHand& to);

}  // namespace palpate::wire
