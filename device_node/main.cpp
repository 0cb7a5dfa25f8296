// device_node: reads the haptic device, asks mofc_node, applies the force it is sent.
// All logic is in the library; this file only connects it to the world.
#include "device_node/process.h"

int main(int argc, char** argv) {
  return palpate::run_node(
      argc, argv, {.name = "device", .description = "Owns the haptic device and its motors."},
      [](palpate::NodeContext& context) {
        palpate::ProcessLinks links(context.session.realtime);
        palpate::device::run_process(context, links);
      });
}
