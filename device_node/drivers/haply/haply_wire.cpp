// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/haply/haply_wire.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "device_node/drivers/haply/json_reader.h"

namespace palpate::device {
namespace {

using nlohmann::json;

/// A part of a transform and its value that changes nothing: of a rotation that of x, y and z.
struct TransformPart {
  const char* name;
  double neutral;
};
constexpr TransformPart kPosition{"position", 0.0};
constexpr TransformPart kRotation{"rotation", 0.0};
constexpr TransformPart kScale{"scale", 1.0};
constexpr std::array kTransformParts{kPosition, kRotation, kScale};

bool is_neutral(double value, const TransformPart& part) noexcept {
  return std::abs(value - part.neutral) <= 1e-6;
}

/// {"x": …, "y": …, "z": …}
bool read_vector(JsonReader& reader, std::optional<Vector3>& value) noexcept {
  std::array<std::optional<double>, 3> found;
  const bool is_read = reader.object([&](std::string_view key, JsonReader& member) noexcept {
    if (key.size() != 1 || key[0] < 'x' || key[0] > 'z') return member.skip();
    return member.number(found[static_cast<std::size_t>(key[0] - 'x')].emplace());
  });
  if (!is_read || !found[0] || !found[1] || !found[2]) return false;
  value = Vector3(*found[0], *found[1], *found[2]);
  return true;
}

/// {"w": …, "x": …, "y": …, "z": …}, made a unit.
bool read_orientation(JsonReader& reader, std::optional<Quaternion>& value) noexcept {
  std::array<std::optional<double>, 4> found;  // w, x, y, z
  const bool is_read = reader.object([&](std::string_view key, JsonReader& member) noexcept {
    if (key.size() != 1 || key[0] < 'w' || key[0] > 'z') return member.skip();
    return member.number(found[static_cast<std::size_t>(key[0] - 'w')].emplace());
  });
  if (!is_read || !found[0] || !found[1] || !found[2] || !found[3]) return false;
  const Quaternion read(*found[0], *found[1], *found[2], *found[3]);
  if (!(read.norm() > 0.5 && read.norm() < 2.0)) return false;
  value = read.normalized();
  return true;
}

/// The wired grip's true or false, or {"a": …, "b": …, "c": …} of the wireless one.
bool read_buttons(JsonReader& reader, std::string_view key,
                  std::optional<std::uint32_t>& value) noexcept {
  bool is_held = false;
  if (key == "button") {
    if (!reader.boolean(is_held)) return false;
    value = is_held ? 1U : 0U;
    return true;
  }
  std::uint32_t held = 0;
  const bool is_read = reader.object([&](std::string_view name, JsonReader& member) noexcept {
    if (name.size() != 1 || name[0] < 'a' || name[0] > 'c') return member.skip();
    if (!member.boolean(is_held)) return false;
    if (is_held) held |= 1U << static_cast<unsigned>(name[0] - 'a');
    return true;
  });
  if (is_read) value = held;
  return is_read;
}

/// A part of a transform: one number or {"x": …, "y": …, "z": …}, of a rotation with w.
bool read_part(JsonReader& reader, const TransformPart& part, bool& is_transformed) noexcept {
  double value = part.neutral;
  JsonReader number = reader;
  if (number.number(value)) {
    is_transformed = is_transformed || !is_neutral(value, part);
    reader = number;
    return true;
  }
  return reader.object([&](std::string_view axis, JsonReader& member) noexcept {
    if (!member.number(value)) return false;
    is_transformed = is_transformed || (axis != "w" && !is_neutral(value, part));
    return true;
  });
}

/// {"position": …, "rotation": …, "scale": …}; what changes nothing may be left out.
bool read_transform(JsonReader& reader, bool& is_transformed) noexcept {
  return reader.object([&](std::string_view key, JsonReader& value) noexcept {
    for (const TransformPart& part : kTransformParts) {
      if (key == part.name) return read_part(value, part, is_transformed);
    }
    return value.skip();
  });
}

/// {"calibrated": …, "power_supply": …, "ready": …} or, of a grip, {"connected": …}
bool read_status(JsonReader& reader, HaplyState& state) noexcept {
  return reader.object([&](std::string_view key, JsonReader& value) noexcept {
    std::optional<bool>* const flag = key == "calibrated"     ? &state.is_calibrated
                                      : key == "power_supply" ? &state.is_powered
                                      : key == "ready"        ? &state.is_ready
                                      : key == "connected"    ? &state.is_grip_connected
                                                              : nullptr;
    return flag != nullptr ? value.boolean(flag->emplace()) : value.skip();
  });
}

bool read_device(JsonReader& reader, HaplyState& state) noexcept {
  return reader.object([&](std::string_view key, JsonReader& value) noexcept {
    if (key == "cursor_position") return read_vector(value, state.cursor_position_m);
    if (key == "cursor_velocity") return read_vector(value, state.cursor_velocity_m_per_s);
    if (key == "current_cursor_force") return read_vector(value, state.cursor_force_newton);
    if (key == "transform") return read_transform(value, state.is_transformed);
    return value.skip();
  });
}

bool read_grip(JsonReader& reader, HaplyState& state) noexcept {
  return reader.object([&](std::string_view key, JsonReader& value) noexcept {
    if (key == "orientation") return read_orientation(value, state.orientation);
    if (key == "button" || key == "buttons") return read_buttons(value, key, state.buttons);
    return value.skip();
  });
}

/// An array of {"device_id": …, "state": {…}, "status": {…}, …}: those of the one with that id,
/// whichever member comes first.
template <class ReadState>
bool read_entry(JsonReader& reader, std::string_view id, HaplyState& state, bool& is_found,
                const ReadState& read_state) noexcept {
  return reader.array([&](JsonReader& entry) noexcept {
    HaplyState read = state;
    bool is_it = false;
    const bool is_read = entry.object([&](std::string_view key, JsonReader& value) noexcept {
      if (key == "state") return read_state(value, read);
      if (key == "status") return read_status(value, read);
      if (key != "device_id") return value.skip();
      std::string_view found;
      if (!value.string(found)) return false;
      is_it = found == id;
      return true;
    });
    if (is_read && is_it) state = read;
    is_found = is_found || is_it;
    return is_read;
  });
}

/// The entry of `found` with that id, or its only one.
const json* chosen(const json& found, const std::string& id, const char* what) {
  if (!found.is_array() || found.empty()) return nullptr;
  std::string ids;
  for (const json& entry : found) {
    const std::string other = entry.at("device_id").get<std::string>();
    if (other == id || (id.empty() && found.size() == 1)) return &entry;
    ids += (ids.empty() ? "" : ", ") + other;
  }
  throw std::runtime_error(
      id.empty() ? std::string("there are several ") + what + ": " + ids + "; choose one by its id"
                 : std::string("there is no ") + what + " \"" + id + "\"; there are " + ids);
}

std::optional<bool> flag(const json& object, const char* name) {
  if (!object.is_object() || !object.contains(name) || !object.at(name).is_boolean()) return {};
  return object.at(name).get<bool>();
}

double number_at(const json& object, const json::json_pointer& path) {
  return object.contains(path) && object.at(path).is_number() ? object.at(path).get<double>() : 0.0;
}

/// Whether a part of {"position": …, "rotation": …, "scale": …} changes something.
bool has_part(const json& transform, const TransformPart& part) {
  if (!transform.is_object() || !transform.contains(part.name)) return false;
  const json& found = transform.at(part.name);
  const auto is_other = [&](const json& value) {
    return value.is_number() && !is_neutral(value.get<double>(), part);
  };
  if (!found.is_object()) return is_other(found);
  for (const auto& [axis, value] : found.items()) {
    if (axis != "w" && is_other(value)) return true;
  }
  return false;
}

/// Refuses what makes the counted work another one than that of the hand.
void refuse_transforms(const std::string& device_id, const json& mount, const json& workspace,
                       HaplyDialect dialect) {
  const auto refuse = [&](const std::string& what, const std::string& why,
                          const std::string& remedy) {
    throw std::runtime_error("the Inverse Service " + what + " Inverse3 " + device_id + ": " + why +
                             "; " + remedy);
  };
  if (has_part(mount, kScale)) {
    refuse("scales the positions of", "the work of the hand would be counted wrongly",
           "set the scale of its mount to 1");
  }
  for (const TransformPart& part : kTransformParts) {
    if (!has_part(workspace, part)) continue;
    refuse(std::string("has a workspace transform (") + part.name + ") for",
           "positions would move without the hand, and its work would be counted wrongly",
           "reset it in the service (set_transform), and end its navigation");
  }
  if (dialect == HaplyDialect::kValues && has_part(mount, kRotation)) {
    refuse("turns the mount of",
           "of services before 3.5 it is not documented that forces are turned, too",
           "set the rotation to none there and give it in device.haply_inverse.mount, or use 3.5");
  }
}

}  // namespace

bool read_haply_state(std::string_view text, std::string_view device_id, std::string_view grip_id,
                      HaplyState& state) noexcept {
  state = {};
  JsonReader reader(text);
  bool is_listed = false;
  bool has_list = false;
  bool has_grip = false;
  const bool is_read = reader.object([&](std::string_view key, JsonReader& value) noexcept {
    if (key == "inverse3") {
      has_list = true;
      return read_entry(value, device_id, state, is_listed, read_device);
    }
    if (!grip_id.empty() && (key == "verse_grip" || key == "wireless_verse_grip")) {
      return read_entry(value, grip_id, state, has_grip, read_grip);
    }
    return value.skip();
  });
  state.is_gone = is_read && reader.ends() && has_list && !is_listed;
  return is_read && reader.ends() && state.cursor_position_m.has_value();
}

HaplySnapshot read_haply_snapshot(const std::string& text, const std::string& device_id,
                                  const std::string& grip_id, HaplyDialect dialect) {
  const json all = json::parse(text, nullptr, false);
  if (!all.is_object()) throw std::runtime_error("the service's first message is not JSON");
  try {
    const json devices = all.value("inverse3", json::array());
    const json* const device = chosen(devices, device_id, "Inverse3");
    if (device == nullptr) throw std::runtime_error("the service knows no Inverse3");
    HaplySnapshot snapshot;
    snapshot.device_id = device->at("device_id").get<std::string>();
    const json config = device->value("config", json::object());
    const json status = device->value("status", json::object());
    refuse_transforms(snapshot.device_id, config.value("mount", json::object()),
                      device->value("state", json::object()).value("transform", json::object()),
                      dialect);
    snapshot.is_calibrated = flag(status, "calibrated");
    snapshot.is_powered = flag(status, "power_supply");
    snapshot.is_ready = flag(status, "ready");
    snapshot.force_gate_gain = number_at(config, "/filters/force_gate/gain"_json_pointer);
    snapshot.damping = number_at(config, "/filters/damping/scalar"_json_pointer);
    snapshot.compensates_gravity =
        flag(config.value("gravity_compensation", json::object()), "enabled").value_or(false);

    for (const auto& [kind, is_wireless] :
         {std::pair{"wireless_verse_grip", true}, {"verse_grip", false}}) {
      const json grips = all.value(kind, json::array());
      if (!grips.is_array() || grips.empty() || !snapshot.grip_id.empty()) continue;
      if (!grip_id.empty() && std::none_of(grips.begin(), grips.end(), [&](const json& grip) {
            return grip.value("device_id", std::string()) == grip_id;
          })) {
        continue;
      }
      snapshot.grip_id = chosen(grips, grip_id, "grip")->at("device_id").get<std::string>();
      snapshot.is_wireless_grip = is_wireless;
    }
    if (!grip_id.empty() && snapshot.grip_id.empty()) {
      throw std::runtime_error("there is no grip \"" + grip_id + "\"");
    }
    return snapshot;
  } catch (const json::exception& error) {
    throw std::runtime_error(std::string("the service's first message is not as expected: ") +
                             error.what());
  }
}

std::string haply_hello(std::string_view profile) {
  return json{{"session", {{"configure", {{"profile", {{"name", profile}}}}}}}}.dump();
}

std::size_t write_haply_force(std::string_view device_id, HaplyDialect dialect,
                              const Vector3& force_newton, std::span<char> out) noexcept {
  const int written = std::snprintf(
      out.data(), out.size(),
      R"({"inverse3":[{"device_id":"%.*s","commands":{"set_cursor_force":{"%s":{"x":%.6f,"y":%.6f,"z":%.6f}}}}]})",
      static_cast<int>(device_id.size()), device_id.data(),
      dialect == HaplyDialect::kVector ? "vector" : "values", force_newton.x(), force_newton.y(),
      force_newton.z());
  return written > 0 && static_cast<std::size_t>(written) < out.size()
             ? static_cast<std::size_t>(written)
             : 0;
}

}  // namespace palpate::device
