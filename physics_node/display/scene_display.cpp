// SPDX-License-Identifier: Apache-2.0
#include "physics_node/display/scene_display.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <variant>

#include "common/contact/tissue_motion.h"
#include "physics_node/display/display_mesh.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {
namespace {

constexpr Duration kChangeInterval = std::chrono::milliseconds(200);  // a scene may have megabytes
constexpr std::size_t kVerticesPerFrame = 100'000;  // 1.2 MB; a larger range is sent in parts
constexpr std::size_t kMovedAtOnce = 12;  // with some dents, within the link's high-water mark

double relaxation_s(double k, double b) {
  if (b == 0.0) return 0.0;
  return k > 0.0 ? b / k : std::numeric_limits<double>::infinity();
}

/// Displacement of the whole tissue at the time of the tick.
Vector3 displacement_m(const TissueConfig& tissue, const PhysicsTick& tick) {
  return displacement(tissue.motion, to_seconds(tick.stepped_at.time_since_epoch())).position_m;
}

}  // namespace

SceneDisplay::SceneDisplay(const Session& session, std::uint64_t session_id,
                           Sender<SceneState>& scene_out, Sender<MeshFrame>& mesh_out,
                           std::shared_ptr<ElasticTissues> elastic)
    : session_(session),
      elastic_(std::move(elastic)),
      scene_out_(scene_out),
      mesh_out_(mesh_out),
      scene_(scene_of(session, session_id)) {
  frame_.header.session_id = session_id;
  for (const TissueConfig& tissue : session.scene.tissues) {
    const ElasticTissue* const body = this->elastic(shapes_.size());
    shapes_.push_back(body != nullptr ? body->body().shape : to_shape(tissue.geometry));
    bodies_.push_back(body != nullptr ? body->whole() : nullptr);
  }
}

/// nullptr: it is not elastic.
ElasticTissue* SceneDisplay::elastic(std::size_t tissue) const {
  if (!elastic_) return nullptr;
  for (const auto& one : elastic_->tissues()) {
    if (one->body().tissue == tissue) return one.get();
  }
  return nullptr;
}

void SceneDisplay::build() {
  if (scene_.revision > 0) return;
  scene_.revision = 1;
  scene_.accepts_changes = may_change_tissue(session_);
  const DisplayArea area = display_area_of(session_);
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const TissueConfig& tissue = session_.scene.tissues[i];
    const Shape& shape = shapes_[i];
    const auto view_of = [&shape](const Vector3& point_m) { return shape.view(point_m); };
    TissueSurface& surface = scene_.tissues.emplace_back();
    surface.name = tissue.name;
    surface.shape = shape_of(tissue.geometry);
    surface.is_restorable = scene_.accepts_changes && is_restorable(session_.scene, tissue);
    surface.mesh = bodies_[i] ? display_mesh(*bodies_[i]) : display_mesh(shape, area);
    std::optional<DentedSurface>& dent = dents_.emplace_back();
    const auto* material = std::get_if<KelvinVoigtMaterial>(&tissue.material);
    if (material == nullptr) continue;
    surface.stiffness_newton_per_m = material->stiffness_newton_per_m;
    surface.damping_newton_s_per_m = material->damping_newton_s_per_m;
    if (surface.stiffness_newton_per_m + surface.damping_newton_s_per_m == 0.0) continue;
    map_stiffness(i);
    dent.emplace(surface.mesh, view_of, session_.scene.tip_radius_m,
                 relaxation_s(surface.stiffness_newton_per_m, surface.damping_newton_s_per_m));
  }
  add_elastic_surfaces();
  frame_.scene_revision = scene_.revision;
  for (const auto& [tissue, constants] : changed_) update_material(tissue);
}

/// Parts come after all tissues, so that the indices of these are those of the session.
void SceneDisplay::add_elastic_surfaces() {
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    if (!bodies_[i]) continue;
    const ElasticBody& body = *bodies_[i];
    scene_.tissues[i].vertex_stiffness_newton_per_m = display_stiffness_newton_per_m(body);
    elastic_surfaces_.push_back({i, i, 0, body.surface_nodes.size()});
    for (const BodyPart& part : body.parts) {
      elastic_surfaces_.push_back({scene_.tissues.size(), i, part.first_node, part.node_count});
      TissueSurface& surface = scene_.tissues.emplace_back();
      surface.name = scene_.tissues[i].name + ", part " + std::to_string(part.region);
      surface.shape = TissueShape::kTetrahedra;
      surface.mesh = display_mesh(body, part);
      const elastic::Material& material = body.body->description().materials[part.region];
      surface.vertex_stiffness_newton_per_m.assign(
          part.node_count,
          static_cast<float>(hertz_slope_newton_per_m(material, body.tip_radius_m)));
    }
  }
}

/// Into the scene: the bodies of the newest surfaces.
void SceneDisplay::take_bodies() {
  bool is_new = false;
  for (const auto& [tissue, newest] : deformed_) {
    if (!newest.body || newest.body == bodies_[tissue]) continue;
    bodies_[tissue] = newest.body;
    scene_.tissues[tissue].mesh = display_mesh(*newest.body);
    is_new = true;
  }
  if (!is_new) return;
  scene_.tissues.resize(shapes_.size());
  elastic_surfaces_.clear();
  add_elastic_surfaces();
}

void SceneDisplay::set_material(std::size_t tissue, double stiffness_newton_per_m,
                                double damping_newton_s_per_m) {
  changed_[tissue] = {stiffness_newton_per_m, damping_newton_s_per_m};
  if (scene_.revision == 0) return;
  update_material(tissue);
  is_change_due_ = true;
}

void SceneDisplay::update_material(std::size_t tissue) {
  const Constants& now = changed_.at(tissue);
  TissueSurface& surface = scene_.tissues[tissue];
  surface.stiffness_newton_per_m = now.stiffness_newton_per_m;
  surface.damping_newton_s_per_m = now.damping_newton_s_per_m;
  map_stiffness(tissue);
  if (!dents_[tissue]) return;
  dents_[tissue]->set_relaxation(
      relaxation_s(now.stiffness_newton_per_m, now.damping_newton_s_per_m));
}

/// The stiffness of each vertex, where a property of the file varies it.
void SceneDisplay::map_stiffness(std::size_t tissue) {
  const auto* file = std::get_if<FileGeometry>(&session_.scene.tissues[tissue].geometry);
  if (file == nullptr || file->stiffness_property.empty()) return;
  TissueSurface& surface = scene_.tissues[tissue];
  surface.vertex_stiffness_newton_per_m.clear();
  for (std::size_t v = 0; v < surface.mesh.vertices_m.size(); v += 3) {
    const float* at = &surface.mesh.vertices_m[v];
    surface.vertex_stiffness_newton_per_m.push_back(
        static_cast<float>(surface.stiffness_newton_per_m *
                           shapes_[tissue].view(Vector3(at[0], at[1], at[2])).stiffness_ratio));
  }
}

void SceneDisplay::send_scene(TimePoint now) {
  scene_.header.sampled_at = now;
  is_too_large_ = scene_out_.send(scene_) == SendResult::kDropped;
  ++scene_.header.sequence;
}

void SceneDisplay::publish(const Watchers& watchers, std::span<const PhysicsTick> newest,
                           TimePoint now) {
  bool is_new_watcher = watchers.mesh_subscriptions > served_.mesh_subscriptions;
  if (is_change_due_ && now >= next_change_at_) {
    is_change_due_ = false;
    next_change_at_ = now + kChangeInterval;
    take_bodies();
    frame_.scene_revision = ++scene_.revision;
    send_scene(now);
    is_new_watcher = true;  // a new revision begins at rest
  } else if (watchers.scene_subscriptions > served_.scene_subscriptions) {
    build();
    send_scene(now);
  }
  served_.scene_subscriptions = watchers.scene_subscriptions;

  if (!watchers.has_mesh_watcher) {
    forget();
    served_.mesh_subscriptions = watchers.mesh_subscriptions;
  }
  if (newest.empty() || (now < next_frames_at_ && !is_new_watcher)) return;
  next_frames_at_ = std::max(next_frames_at_ + kFrameInterval, now);
  if (!watchers.has_mesh_watcher) {
    ++frames_skipped_;
    return;
  }
  served_.mesh_subscriptions = watchers.mesh_subscriptions;

  build();
  const double elapsed_s = advanced_at_ ? to_seconds(now - *advanced_at_) : 0.0;
  advanced_at_ = now;
  send_elastic(is_new_watcher, newest.front(), now);
  std::size_t moved = 0;  // tissues sent that moved without a dent
  const std::size_t first = next_turn_;
  for (std::size_t k = 0; k < dents_.size(); ++k) {
    const std::size_t i = (first + k) % dents_.size();
    const TissueConfig& tissue = session_.scene.tissues[i];
    // the tool relative to the tissue, which may itself move
    const auto tip_m = [&tissue](const PhysicsTick& tick) {
      return Vector3(tick.tool_position_world_m - displacement_m(tissue, tick));
    };
    std::optional<VertexRange> range;
    if (dents_[i]) {
      DentedSurface& dent = *dents_[i];
      dent.advance(tip_m(newest.front()), elapsed_s);
      for (const PhysicsTick& other : newest.subspan(1)) dent.press(tip_m(other));
      range = is_new_watcher ? dent.take_dented() : dent.take_moved();
    }
    if (range) {
      send(i, *range, newest.front(), now);
    } else if (is_moving(tissue.motion) && moved < kMovedAtOnce) {
      send(i, {}, newest.front(), now);
      if (++moved == kMovedAtOnce) next_turn_ = i + 1;
    }
  }
}

void SceneDisplay::send_elastic(bool is_new_watcher, const PhysicsTick& tick, TimePoint now) {
  for (std::size_t i = 0; elastic_ && i < elastic_->tissues().size(); ++i) {
    ElasticTissue& body = *elastic_->tissues()[i];
    const std::size_t tissue = body.body().tissue;
    Deformed& newest = deformed_[tissue];
    auto taken = body.take_surface(newest.vertices_m, newest.strain);
    const bool is_new = taken != nullptr;
    if (is_new) newest.body = std::move(taken);
    if (newest.vertices_m.empty() || !(is_new || is_new_watcher)) continue;
    if (newest.body != bodies_[tissue]) {  // the viewers have another mesh
      is_change_due_ = true;
      continue;
    }
    for (const ElasticSurface& surface : elastic_surfaces_) {
      if (surface.of_body != tissue) continue;
      send(surface.tissue, {0, surface.node_count}, tick, now, &surface);
    }
  }
}

/// After the last subscriber has left, the next one starts with tissue at rest.
void SceneDisplay::forget() {
  if (!advanced_at_) return;
  advanced_at_.reset();
  for (auto& dent : dents_) {
    if (dent) dent->reset();
  }
}

void SceneDisplay::send(std::size_t tissue, const VertexRange& range, const PhysicsTick& tick,
                        TimePoint now, const ElasticSurface* elastic) {
  frame_.tissue = static_cast<std::uint32_t>(tissue);
  frame_.device_sequence = tick.device_sequence;
  frame_.displacement_world_m =
      displacement_m(session_.scene.tissues[elastic != nullptr ? elastic->of_body : tissue], tick);
  frame_.header.sampled_at = now;
  std::size_t left = range.count;
  do {
    const VertexRange part{range.first + range.count - left, std::min(kVerticesPerFrame, left)};
    frame_.first_vertex = static_cast<std::uint32_t>(part.first);
    frame_.vertex_strain.clear();
    if (elastic != nullptr) {
      const auto first = static_cast<std::ptrdiff_t>(elastic->first_node + part.first);
      const auto end = first + static_cast<std::ptrdiff_t>(part.count);
      const Deformed& newest = deformed_.at(elastic->of_body);
      frame_.vertices_m.assign(newest.vertices_m.begin() + 3 * first,
                               newest.vertices_m.begin() + 3 * end);
      frame_.vertex_strain.assign(newest.strain.begin() + first, newest.strain.begin() + end);
    } else {
      frame_.vertices_m = part.count > 0 ? dents_[tissue]->vertices_m(part) : std::vector<float>{};
    }
    mesh_out_.send(frame_);
    ++frame_.header.sequence;
    ++frames_made_;
    left -= part.count;
  } while (left > 0);
}

void SceneDisplay::count_into(PhysicsCounters& counters) const {
  counters.mesh_frames = frames_made_;
  counters.meshes_skipped = frames_skipped_;
}

}  // namespace palpate::physics
