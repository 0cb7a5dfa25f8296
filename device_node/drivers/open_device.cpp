#include "device_node/drivers/open_device.h"

namespace palpate::device {

std::unique_ptr<HapticDevice> open_device(const SimulatedDeviceConfig& config, const HandConfig& hand,
                                          const Clock& clock, std::uint64_t seed,
                                          HandGoals* goals) {
  return std::make_unique<SimulatedDevice>(config, hand, clock, seed, goals);
}

}  // namespace palpate::device
