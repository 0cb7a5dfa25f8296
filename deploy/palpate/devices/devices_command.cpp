// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "deploy/palpate/commands.h"
#include "deploy/palpate/devices/permission.h"
#include "device_node/drivers/transport/web_socket.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

/// A device that one of the drivers may be able to open.
struct FoundDevice {
  std::string what;
  std::string how;  ///< session field, or what is in the way
};

std::string first_line(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

std::string permission(const fs::path& file) {
  const std::string remedy = permission_remedy(file);
  return remedy.empty() ? "" : "\n    no permission: " + remedy;
}

/// The file of a device on USB, by its folder below /sys/bus/usb/devices.
fs::path usb_file(const fs::path& device) {
  const auto padded = [&](const char* name) {
    const std::string number = first_line(device / name);
    return std::string(number.size() < 3 ? 3 - number.size() : 0, '0') + number;
  };
  return fs::path("/dev/bus/usb") / padded("busnum") / padded("devnum");
}

void find_inverse_service(std::vector<FoundDevice>& found) {
  try {
    static_cast<void>(device::WebSocket::connect("127.0.0.1", 10001, 500ms));
    found.push_back({"Haply Inverse Service at 127.0.0.1:10001",
                     "device { haply_inverse { motors { … } mount { … } … } }"});
  } catch (const std::exception&) {
    // no service: nothing to list
  }
}

/// Boards with a serial port of their own: CDC ACM.
void find_serial_boards(const fs::path& dev, std::vector<FoundDevice>& found) {
  std::error_code error;
  std::vector<fs::path> ports;
  for (const fs::directory_entry& entry : fs::directory_iterator(dev, error)) {
    if (entry.path().filename().string().starts_with("ttyACM")) ports.push_back(entry.path());
  }
  std::sort(ports.begin(), ports.end());
  for (const fs::path& port : ports) {
    const fs::path usb = fs::path("/sys/class/tty") / port.filename() / "device" / ".." / "product";
    const std::string product = first_line(usb);
    found.push_back({port.string() + (product.empty() ? "" : " (" + product + ")"),
                     "device { hapi { port: \"" + port.string() + "\" … } } if it is a hAPI board" +
                         permission(port)});
  }
}

/// Devices on USB whose drivers are known by name.
void find_usb(std::vector<FoundDevice>& found) {
  struct Known {
    const char* vendor;
    const char* product;
    const char* name;
    const char* how;
  };
  static constexpr Known kKnown[] = {
      {"0403", "cb48", "Novint Falcon", "device { falcon { motors { … } mount { … } … } }"},
      {"16c0", "0486", "WoodenHaptics / Polhem board",
       "device { wooden { motors { … } mount { … } … } } if its firmware is the open one"},
      {"1451", "", "Force Dimension device",
       "device { plugin { library: \"force_dimension.so\" … } }"},
      {"0301", "2988", "3D Systems Touch", "device { plugin { library: \"open_haptics.so\" … } }"},
      {"2988", "", "3D Systems Touch", "device { plugin { library: \"open_haptics.so\" … } }"}};
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator("/sys/bus/usb/devices", error)) {
    const std::string vendor = first_line(entry.path() / "idVendor");
    const std::string product = first_line(entry.path() / "idProduct");
    for (const Known& known : kKnown) {
      if (vendor == known.vendor && (*known.product == '\0' || product == known.product)) {
        found.push_back({std::string(known.name) + " (" + vendor + ":" + product + ")",
                         known.how + permission(usb_file(entry.path()))});
      }
    }
  }
}

struct DevicesCommand {
  static void add_to(CLI::App& app) {
    app.footer(
        "Drivers: simulated, haply_inverse, hapi, falcon, wooden, plugin. None has been run on "
        "hardware.");
  }

  static int run() {
    std::vector<FoundDevice> found;
    find_inverse_service(found);
    find_serial_boards("/dev", found);
    find_usb(found);
    for (const FoundDevice& device : found) {
      std::printf("%s\n    %s\n", device.what.c_str(), device.how.c_str());
    }
    if (found.empty()) {
      std::puts(
          "No haptic device is connected that a driver of this program can open.\n"
          "`palpate emulate SESSION` stands in for one.");
    }
    return 0;
  }
};

}  // namespace

Command add_devices_command(CLI::App& app) {
  return add_command<DevicesCommand>(
      app, "devices", "list the haptic devices that are connected and how to open them");
}

}  // namespace palpate
