#include "device_node/open_device.h"

namespace palpate::device {

std::unique_ptr<HapticDevice> open_device(const DeviceConfig& config, const HandConfig& hand,
                                          const Clock& clock, std::uint64_t seed,
                                          HandGoals* goals) {
  return std::make_unique<SimulatedDevice>(config.simulated, hand, clock, seed, goals);
}

}  // namespace palpate::device
