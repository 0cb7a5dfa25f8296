// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/profile_file.h"

#include <google/protobuf/descriptor.h>

#include <cmath>

#include "common/core/user/files.h"
#include "common/session/file/session_fields.h"
#include "common/session/file/session_text.h"

namespace palpate {

namespace {

namespace pb = google::protobuf;

constexpr std::uintmax_t kMaxProfileFileBytes = 100'000;

/// Reports each field of the message except the allowed one.
void refuse_others(const pb::Message& message, const std::string& path, const char* allowed,
                   const SessionText& text, Problems& problems) {
  std::vector<const pb::FieldDescriptor*> given;
  message.GetReflection()->ListFields(message, &given);
  for (const pb::FieldDescriptor* field : given) {
    if (field->name() == allowed) continue;
    const std::string child = child_path(path, field->name(), field->is_repeated() ? 0 : -1);
    problems.add(text.place(child),
                 child + ": a profile contains device.profile only; move it into the session");
  }
}

}  // namespace

DeviceProfile parse_profile(std::string_view text, const std::string& file_name, const Place& place,
                            Problems& problems) {
  Problems own(file_name, {});
  DeviceProfile profile;
  SessionText written(own);
  if (written.read(text)) {
    written.check_numbers();
    refuse_others(written.message(), "", "device", written, own);
    refuse_others(written.message().device(), "device", "profile", written, own);

    // no defaults: a bound that is forgotten must not become a guess
    const Fields fields = Fields(written, own).message("device").message("profile");
    profile = {.viscous_newton_s_per_m = fields.required_number("viscous_newton_s_per_m"),
               .coulomb_newton = fields.required_number("coulomb_newton"),
               .position_resolution_m = fields.required_number("position_resolution_m"),
               .per_axis = read_friction_per_axis(fields, {})};
    check_isotropic_bound(fields, profile);
  }
  problems.add_file(place, own);
  return profile;
}

std::optional<FrictionPerAxis> read_friction_per_axis(
    const Fields& fields, const std::optional<FrictionPerAxis>& fallback) {
  const char* const viscous = "viscous_per_axis_newton_s_per_m";
  const char* const coulomb = "coulomb_per_axis_newton";
  if (!fields.has(viscous) && !fields.has(coulomb)) return fallback;
  const auto read = [&](const char* name, const char* other) {
    if (!fields.has(name)) {
      fields.problem(name, std::string("required beside ") + other + "; give x, y and z");
    }
    return fields.vector(name);
  };
  return FrictionPerAxis{.viscous_newton_s_per_m = read(viscous, coulomb),
                         .coulomb_newton = read(coulomb, viscous)};
}

void check_isotropic_bound(const Fields& profile_fields, const DeviceProfile& profile) {
  if (!profile.per_axis) return;
  const double least = profile.per_axis->coulomb_newton.minCoeff();
  if (profile.coulomb_newton > least) {
    profile_fields.problem("coulomb_newton", "must be ≤ each of coulomb_per_axis_newton, here " +
                                                 shown(least) +
                                                 ": no axis may be pushed harder by the fallback");
  }
}

DeviceProfile load_profile(const std::filesystem::path& file, const Place& place,
                           Problems& problems) {
  const FileContent content = read_text_file(file, kMaxProfileFileBytes);
  if (!content.complaint.empty()) {
    problems.add(place, "device.profile_file: " + one_line(file.string()) + ": " +
                            content.complaint + " (a path is relative to the session's folder)");
    return {};
  }
  return parse_profile(content.bytes, file.string(), place, problems);
}

std::string profile_text(const DeviceProfile& profile, const std::vector<std::string>& comment) {
  const auto bound = [](double value) { return shown(std::floor(value * 1e6) / 1e6); };
  const auto bounds = [&](const Vector3& v) {
    return "{ x: " + bound(v.x()) + " y: " + bound(v.y()) + " z: " + bound(v.z()) + " }";
  };
  std::string text;
  for (const std::string& line : comment) text += "# " + one_line(line) + "\n";
  text += "device {\n  profile {\n    viscous_newton_s_per_m: " +
          bound(profile.viscous_newton_s_per_m) +
          "\n    coulomb_newton: " + bound(profile.coulomb_newton) +
          "\n    position_resolution_m: " + shown(profile.position_resolution_m) + "\n";
  if (profile.per_axis) {
    text += "    viscous_per_axis_newton_s_per_m " +
            bounds(profile.per_axis->viscous_newton_s_per_m) + "\n    coulomb_per_axis_newton " +
            bounds(profile.per_axis->coulomb_newton) + "\n";
  }
  return text + "  }\n}\n";
}

}  // namespace palpate
