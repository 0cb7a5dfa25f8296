// SPDX-License-Identifier: Apache-2.0
// unheard.h — a subscriber to whom nobody publishes, for what is handed its messages by a test.
#pragma once

#include "common/core/clock.h"
#include "common/link/telemetry_subscriber.h"

namespace palpate::test {

struct Unheard {
  SteadyClock clock;
  ZmqContext context;
  TelemetrySubscriber subscriber{
      context, clock, {connect_to("inproc://nobody", "links.physics_telemetry")}};
};

}  // namespace palpate::test
