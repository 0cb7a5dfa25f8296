#include "device_node/process.h"

#include "common/core/inbox.h"
#include "common/runtime/flight_recorder.h"
#include "common/runtime/rate_loop.h"
#include "common/runtime/realtime.h"
#include "common/runtime/rejection_log.h"
#include "common/runtime/telemetry_publisher.h"
#include "device_node/device_node.h"
#include "device_node/open_device.h"

namespace palpate::device {

void run_process(NodeContext& context, ProcessLinks& links) {
  const Session& session = context.session;
  const auto device =
      open_device(session.device, session.hand, context.clock, stream_seed(session.seed, "hand"));
  if (!device->specification().has_motor_watchdog) {
    context.log.warn("event=no_motor_watchdog device=\"{}\": the guarantee is not available",
                     device->specification().model_name);
  }

  // hops 1 and 4
  ExchangeClient exchange(links.exchange, context.clock,
                          connect_to(session.links.exchange, "links.exchange"));
  Inbox<ForceCommand> force_in(exchange, context.clock, session.faults.force_command,
                               stream_seed(session.seed, "force_command"));

  // hop 5
  ZmqSender<DeviceBatch> telemetry(
      links.side, bind_to(session.links.device_telemetry, "links.device_telemetry"));
  RingSink<DeviceTick> ticks;
  Snapshot<DeviceCounters> counters;
  FlightRecorder<DeviceTick> recorder(flight_files(context, "device"));
  TelemetryPublisher publisher(context.session_id, context.clock, ticks, counters, telemetry,
                               context.log);
  publisher.record_to(recorder);
  RejectionLog refused(context.log, "force_command", exchange.rejections());
  publisher.on_pump = [&](TimePoint now) { refused.note(now); };
  publisher.start();

  // the tick
  DeviceNode node(session.device, *device, context.clock, exchange, force_in, ticks,
                  context.session_id);
  context.log.info("event=realtime {}", enter_realtime(session.realtime).text);
  RateLoop loop(context.clock, session.device.rate_hz);
  std::uint32_t resets = 0;
  loop.run(context.stop, [&](const Tick& tick) {
    const std::uint32_t resets_asked = context.requests.fault_resets;
    if (resets_asked != resets) node.reset_fault();
    resets = resets_asked;
    node.step(tick);
    counters.store(node.counters());
  });
  node.stop();
}

}  // namespace palpate::device
