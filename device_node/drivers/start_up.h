// start_up.h — what a driver may ask of the person at the device while it opens it.
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>

#include "common/core/time.h"

namespace palpate::device {

struct StartUp {
  /// Tells the person what to do, or what the driver found: one line.
  std::function<void(const std::string& text)> prompt = [](const std::string&) {};
  /// Longest time until the device is ready.
  Duration limit = std::chrono::seconds(20);
  /// Ends the wait.
  std::stop_token stop = {};
};

}  // namespace palpate::device
