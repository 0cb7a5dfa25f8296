// SPDX-License-Identifier: Apache-2.0
#include "physics_node/library/palpate_tissue.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/time.h"
#include "common/session/session_file.h"
#include "physics_node/display/display_mesh.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/library/batch.h"
#include "physics_node/library/shared_scene.h"

namespace {

using palpate::Duration;
using palpate::SetupError;
using palpate::Vector3;
using palpate::physics::Batch;
using palpate::physics::SharedScene;
using palpate::physics::Simulation;
using palpate::physics::ToolForce;
using palpate::physics::TouchedPlace;

constexpr std::size_t kMostScenes = 1'000'000;
constexpr std::size_t kMostTools = 64;
constexpr std::size_t kMostThreads = 1024;
constexpr std::uint32_t kMostParts = 100'000;
constexpr double kShortestStep_s = 1e-6;
constexpr double kLongestStep_s = 10.0;
constexpr double kFarthest_m = 1000.0;
constexpr double kFastest_m_per_s = 1000.0;
constexpr double kLatest_s = 1e8;
constexpr double kUnit = 1e-3;  // of the length of a quaternion

static_assert(PALPATE_MOST_CONTACTS == palpate::kMaxContacts);

std::string& last_error() {
  thread_local std::string error;
  return error;
}

palpate_tissue_status failed(palpate_tissue_status status, std::string why) {
  last_error() = std::move(why);
  return status;
}

/// Calls `call`; what it throws becomes a status and a message.
template <class Call>
palpate_tissue_status guarded(const Call& call) noexcept {
  try {
    return call();
  } catch (const std::bad_alloc&) {
    try {
      return failed(PALPATE_TISSUE_NO_MEMORY, "memory is exhausted; make fewer copies");
    } catch (...) {
      return PALPATE_TISSUE_NO_MEMORY;
    }
  } catch (const std::exception& error) {
    return failed(PALPATE_TISSUE_FAILED, error.what());
  } catch (...) {
    return failed(PALPATE_TISSUE_FAILED, "an unknown error");
  }
}

template <class Number>
std::string range(const std::string& name, Number value, const std::string& rule) {
  return name + " = " + std::to_string(value) + ": must be " + rule;
}

/// A NULL or an index that is not there.
palpate_tissue_status null_pointer(const char* name) {
  return failed(PALPATE_TISSUE_NULL_POINTER,
                std::string(name) + " is NULL; pass one that was made");
}

palpate_tissue_status no_copy(std::size_t copy, std::size_t count) {
  return failed(PALPATE_TISSUE_OUT_OF_RANGE, "copy " + std::to_string(copy) + ": there are " +
                                                 std::to_string(count) + "; give 0 to " +
                                                 std::to_string(count - 1) +
                                                 ", or PALPATE_EVERY where allowed");
}

/// One of the copies, or all of them.
template <class Act>
void for_copies(std::size_t copy, std::size_t count, const Act& act) {
  if (copy != PALPATE_EVERY) {
    act(copy);
    return;
  }
  for (std::size_t i = 0; i < count; ++i) act(i);
}

bool is_within(const double* numbers, std::size_t count, double most) {
  return std::all_of(numbers, numbers + count,
                     [&](double number) { return std::abs(number) <= most; });
}

/// "" or what is wrong with a tool, and the remedy.
std::string complaint_about(const palpate_tool& tool) {
  if (!is_within(tool.position_m, 3, kFarthest_m)) {
    return "position_m must be finite and within +-1000 m; is it in metres?";
  }
  if (tool.is_velocity_known != 0 && !is_within(tool.velocity_m_per_s, 3, kFastest_m_per_s)) {
    return "velocity_m_per_s must be finite and within +-1000 m/s; leave is_velocity_known 0 where "
           "it is not known";
  }
  const auto& q = tool.orientation_wxyz;
  const double norm = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
  if (norm == 0.0 || std::abs(norm - 1.0) <= kUnit) return {};
  return "orientation_wxyz must have length 1, or be zeros for none; divide it by its length";
}

Vector3 vector_of(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

void write(const Vector3& vector, double* numbers) { std::copy_n(vector.data(), 3, numbers); }

Simulation::Target target_of(const palpate_tool& tool) {
  const auto& q = tool.orientation_wxyz;
  Simulation::Target target{.tool = {.position_m = vector_of(tool.position_m),
                                     .jaw = {.is_closed = tool.are_jaws_closed != 0}},
                            .is_velocity_known = tool.is_velocity_known != 0};
  if (target.is_velocity_known) target.tool.velocity.tip_m_per_s = vector_of(tool.velocity_m_per_s);
  if (q[0] != 0.0 || q[1] != 0.0 || q[2] != 0.0 || q[3] != 0.0) {
    target.tool.orientation = palpate::Quaternion(q[0], q[1], q[2], q[3]);
  }
  return target;
}

void write(const ToolForce& force, palpate_tool_force& out) {
  write(force.force_on_tool_newton, out.force_on_tool_newton);
  write(force.torque_on_tool_newton_m, out.torque_on_tool_newton_m);
  out.stored_energy_joule = force.stored_energy_joule;
  out.error_newton = force.error_newton;
  out.contact_count = force.contact_count;
  out.listed_count = force.place_count;
  for (std::size_t i = 0; i < PALPATE_MOST_CONTACTS; ++i) {
    palpate_contact& contact = out.contacts[i];
    contact = {};
    if (i >= force.place_count) continue;
    const TouchedPlace& place = force.places[i];
    write(place.point_m, contact.point_m);
    write(place.normal, contact.normal);
    write(place.force_on_tool_newton, contact.force_on_tool_newton);
    contact.penetration_m = place.penetration_m;
    contact.error_newton = place.error_newton;
    contact.tissue = place.tissue;
    contact.is_shaft = place.is_shaft ? 1 : 0;
  }
}

struct Shown {
  std::vector<float> vertices_m{};
  std::vector<float> strain{};
  std::vector<std::uint32_t> triangles{};
};

/// The surface of a tissue where no tool touches it.
Shown untouched_surface(const SharedScene& shared, std::size_t tissue) {
  const palpate::TissueConfig& config = shared.config().tissues[tissue];
  const auto body = std::find_if(shared.bodies().begin(), shared.bodies().end(),
                                 [&](const auto& one) { return one->body()->tissue == tissue; });
  palpate::SurfaceMesh mesh =
      body != shared.bodies().end()
          ? palpate::physics::display_mesh(*(*body)->body())
          : palpate::physics::display_mesh(palpate::physics::to_shape(config.geometry), {});
  return {.vertices_m = std::move(mesh.vertices_m),
          .strain = {},
          .triangles = std::move(mesh.triangles)};
}

}  // namespace

struct palpate_scene {
  std::shared_ptr<const SharedScene> shared;
};

struct palpate_batch {
  Batch batch;
  std::shared_ptr<const SharedScene> shared;
  std::vector<palpate_tool> tools;
  std::vector<palpate_tool_force> forces;
  std::vector<Simulation::Target> targets;
  std::vector<ToolForce> answers;
  std::map<std::pair<std::size_t, std::size_t>, Shown> shown;  // by copy and tissue
};

struct palpate_snapshot {
  std::shared_ptr<const SharedScene> shared;
  std::size_t tools;
  Simulation simulation;
};

namespace {

template <class Read>
palpate_scene* read_scene(const char* const* sets, std::size_t set_count, const Read& read) {
  palpate_scene* made = nullptr;
  guarded([&] {
    std::vector<std::string> overrides;
    for (std::size_t i = 0; i < set_count; ++i) {
      if (sets == nullptr || sets[i] == nullptr) return null_pointer("a set");
      overrides.emplace_back(sets[i]);
    }
    const palpate::Session session = read(overrides);
    if (!session.physics_command.empty()) {
      throw SetupError(session.file +
                       ": physics.command names another program as the physics of this session, "
                       "which the library cannot be; take the field out");
    }
    try {
      made = new palpate_scene{
          std::make_shared<const SharedScene>(session.scene, palpate::reach_of(session))};
    } catch (const SetupError& error) {
      throw SetupError(palpate::with_place(session, error.what()));
    }
    return PALPATE_TISSUE_OK;
  });
  return made;
}

}  // namespace

const char* palpate_tissue_version(void) { return PALPATE_TISSUE_VERSION; }

const char* palpate_tissue_error(void) { return last_error().c_str(); }

palpate_scene* palpate_scene_load(const char* file, const char* const* sets, size_t set_count) {
  if (file == nullptr) {
    guarded([] { return null_pointer("file"); });
    return nullptr;
  }
  return read_scene(sets, set_count, [&](const std::vector<std::string>& overrides) {
    return palpate::load_session(file, overrides);
  });
}

palpate_scene* palpate_scene_parse(const char* text, const char* folder, const char* const* sets,
                                   size_t set_count) {
  if (text == nullptr) {
    guarded([] { return null_pointer("text"); });
    return nullptr;
  }
  return read_scene(sets, set_count, [&](const std::vector<std::string>& overrides) {
    // the name of a session matters to its processes only
    std::vector<std::string> named{"name=scene"};
    named.insert(named.end(), overrides.begin(), overrides.end());
    return palpate::parse_session(
        text, "scene", named,
        folder != nullptr ? std::filesystem::path(folder) : std::filesystem::path());
  });
}

void palpate_scene_destroy(palpate_scene* scene) { delete scene; }

size_t palpate_scene_tissue_count(const palpate_scene* scene) {
  return scene != nullptr ? scene->shared->config().tissues.size() : 0;
}

const char* palpate_scene_tissue_name(const palpate_scene* scene, size_t tissue) {
  if (tissue >= palpate_scene_tissue_count(scene)) return nullptr;
  return scene->shared->config().tissues[tissue].name.c_str();
}

double palpate_scene_tip_radius_m(const palpate_scene* scene) {
  return scene != nullptr ? scene->shared->config().tip_radius_m : 0.0;
}

palpate_batch* palpate_batch_create(const palpate_scene* scene, size_t scenes, size_t tools,
                                    size_t threads) {
  palpate_batch* made = nullptr;
  guarded([&] {
    if (scene == nullptr) return null_pointer("scene");
    const auto refuse = [](const char* name, std::size_t value, const char* rule) {
      return failed(PALPATE_TISSUE_OUT_OF_RANGE, range(name, value, rule));
    };
    if (scenes < 1 || scenes > kMostScenes) return refuse("scenes", scenes, "1 to 1000000");
    if (tools < 1 || tools > kMostTools) return refuse("tools", tools, "1 to 64");
    if (threads > kMostThreads) {
      return refuse("threads", threads, "at most 1024; 0 takes one for each processor");
    }
    if (threads == 0) threads = std::max(1U, std::thread::hardware_concurrency());
    made = new palpate_batch{
        .batch = Batch(scene->shared, scenes, tools, std::min(threads, scenes)),
        .shared = scene->shared,
        .tools = std::vector<palpate_tool>(scenes * tools, palpate_tool{}),
        .forces = std::vector<palpate_tool_force>(scenes * tools, palpate_tool_force{}),
        .targets = std::vector<Simulation::Target>(scenes * tools),
        .answers = std::vector<ToolForce>(scenes * tools),
        .shown = {}};
    return PALPATE_TISSUE_OK;
  });
  return made;
}

void palpate_batch_destroy(palpate_batch* batch) { delete batch; }

palpate_tool* palpate_batch_tools(palpate_batch* batch) {
  return batch != nullptr ? batch->tools.data() : nullptr;
}

const palpate_tool_force* palpate_batch_forces(const palpate_batch* batch) {
  return batch != nullptr ? batch->forces.data() : nullptr;
}

palpate_tissue_status palpate_batch_step(palpate_batch* batch, double dt_s, uint32_t parts) {
  return guarded([&] {
    if (batch == nullptr) return null_pointer("batch");
    if (!(dt_s >= kShortestStep_s && dt_s <= kLongestStep_s)) {
      return failed(PALPATE_TISSUE_OUT_OF_RANGE,
                    range("dt_s", dt_s, "1e-6 to 10 s; 0.001 is usual"));
    }
    const Duration dt = palpate::from_seconds(dt_s);
    if (parts < 1 || parts > kMostParts || dt / parts < Duration(1)) {
      return failed(PALPATE_TISSUE_OUT_OF_RANGE,
                    range("parts", parts, "1 to 100000, each of at least 1 ns"));
    }
    const std::size_t per_copy = batch->batch.tools();
    for (std::size_t i = 0; i < batch->tools.size(); ++i) {
      const std::string complaint = complaint_about(batch->tools[i]);
      if (!complaint.empty()) {
        return failed(PALPATE_TISSUE_OUT_OF_RANGE, "copy " + std::to_string(i / per_copy) +
                                                       ", tool " + std::to_string(i % per_copy) +
                                                       ": " + complaint);
      }
      batch->targets[i] = target_of(batch->tools[i]);
    }
    batch->batch.step(batch->targets, dt, parts, batch->answers);
    for (std::size_t i = 0; i < batch->forces.size(); ++i) {
      write(batch->answers[i], batch->forces[i]);
    }
    return PALPATE_TISSUE_OK;
  });
}

double palpate_batch_time_s(const palpate_batch* batch, size_t copy) {
  if (batch == nullptr || copy >= batch->batch.size()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return palpate::seconds_of(batch->batch.at(copy).time());
}

palpate_tissue_status palpate_batch_reset(palpate_batch* batch, size_t copy, double time_s) {
  return guarded([&] {
    if (batch == nullptr) return null_pointer("batch");
    const std::size_t count = batch->batch.size();
    if (copy != PALPATE_EVERY && copy >= count) return no_copy(copy, count);
    if (!(std::abs(time_s) <= kLatest_s)) {
      return failed(PALPATE_TISSUE_OUT_OF_RANGE,
                    range("time_s", time_s, "finite and within +-1e8 s; 0 is usual"));
    }
    for_copies(copy, count,
               [&](std::size_t i) { batch->batch.reset(i, palpate::time_at(time_s)); });
    return PALPATE_TISSUE_OK;
  });
}

palpate_snapshot* palpate_batch_snapshot(const palpate_batch* batch, size_t copy) {
  palpate_snapshot* made = nullptr;
  guarded([&] {
    if (batch == nullptr) return null_pointer("batch");
    if (copy >= batch->batch.size()) return no_copy(copy, batch->batch.size());
    auto kept = std::make_unique<palpate_snapshot>(palpate_snapshot{
        .shared = batch->shared,
        .tools = batch->batch.tools(),
        .simulation = Simulation(batch->shared, batch->batch.tools(), batch->batch.is_folded())});
    kept->simulation.continue_as(batch->batch.at(copy));
    made = kept.release();
    return PALPATE_TISSUE_OK;
  });
  return made;
}

palpate_tissue_status palpate_batch_restore(palpate_batch* batch, size_t copy,
                                            const palpate_snapshot* snapshot) {
  return guarded([&] {
    if (batch == nullptr) return null_pointer("batch");
    if (snapshot == nullptr) return null_pointer("snapshot");
    const std::size_t count = batch->batch.size();
    if (copy != PALPATE_EVERY && copy >= count) return no_copy(copy, count);
    if (snapshot->shared != batch->shared || snapshot->tools != batch->batch.tools()) {
      return failed(PALPATE_TISSUE_OUT_OF_RANGE,
                    "the snapshot is of another scene, or has another number of tools; take one of "
                    "a batch of this scene with as many");
    }
    for_copies(copy, count,
               [&](std::size_t i) { batch->batch.at(i).continue_as(snapshot->simulation); });
    return PALPATE_TISSUE_OK;
  });
}

void palpate_snapshot_destroy(palpate_snapshot* snapshot) { delete snapshot; }

palpate_tissue_status palpate_batch_surface(palpate_batch* batch, size_t copy, size_t tissue,
                                            palpate_surface* surface) {
  return guarded([&] {
    if (batch == nullptr) return null_pointer("batch");
    if (surface == nullptr) return null_pointer("surface");
    if (copy >= batch->batch.size()) return no_copy(copy, batch->batch.size());
    const std::size_t count = batch->shared->config().tissues.size();
    if (tissue >= count) {
      return failed(PALPATE_TISSUE_OUT_OF_RANGE, "tissue " + std::to_string(tissue) +
                                                     ": the scene has " + std::to_string(count) +
                                                     "; count from 0");
    }
    const auto place = batch->shown.find({copy, tissue});
    Shown& shown =
        place != batch->shown.end()
            ? place->second
            : batch->shown
                  .emplace(std::pair{copy, tissue}, untouched_surface(*batch->shared, tissue))
                  .first->second;
    batch->batch.at(copy).read_surface(tissue, shown.vertices_m, shown.strain);
    *surface = {.vertices_m = shown.vertices_m.data(),
                .strain = shown.strain.empty() ? nullptr : shown.strain.data(),
                .triangles = shown.triangles.data(),
                .vertex_count = shown.vertices_m.size() / 3,
                .triangle_count = shown.triangles.size() / 3};
    return PALPATE_TISSUE_OK;
  });
}
