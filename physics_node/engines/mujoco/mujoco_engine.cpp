// SPDX-License-Identifier: Apache-2.0
#include "physics_node/engines/mujoco/mujoco_engine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <stdexcept>

namespace palpate::engines {
namespace {

using sdk::Vector3;

/// Row `index` of one of MuJoCo's arrays of vectors.
Vector3 vector(const mjtNum* array, int index) {
  return Eigen::Map<const Vector3>(array + std::ptrdiff_t{3} * index);
}

/// Writes a pose as MuJoCo has it.
void write(const sdk::Motion& motion, mjtNum* position, mjtNum* quaternion) {
  Eigen::Map<Vector3>{position} = motion.position_m;
  const Eigen::Quaterniond& q = motion.orientation;
  Eigen::Map<Eigen::Vector4d>{quaternion} = Eigen::Vector4d(q.w(), q.x(), q.y(), q.z());
}

}  // namespace

MujocoEngine::MujocoEngine(const sdk::Setup& setup, const std::string& scene_file) {
  std::array<char, 1000> error{};
  model_.reset(mj_loadXML(scene_file.c_str(), nullptr, error.data(), error.size()));
  if (!model_) {
    throw sdk::SetupError(scene_file + ": " + error.data() + "; give an MJCF file of MuJoCo " +
                          mj_versionString());
  }
  find_tool(scene_file);
  // whole steps, none longer than the scene says
  steps_ =
      std::max(1, static_cast<int>(std::ceil(1.0 / (setup.rate_hz * model_->opt.timestep) - 1e-6)));
  model_->opt.timestep = 1.0 / (setup.rate_hz * steps_);
  data_.reset(mj_makeData(model_.get()));
  if (!data_) throw sdk::SetupError(scene_file + ": no memory for it; make it smaller");
  mj_forward(model_.get(), data_.get());
  surfaces_.emplace(*model_, *data_, [this](int geom) { return is_tool(geom); });
}

void MujocoEngine::find_tool(const std::string& scene_file) {
  tool_ = mj_name2id(model_.get(), mjOBJ_BODY, "tool");
  if (tool_ < 0 || model_->body_mocapid[tool_] < 0) {
    throw sdk::SetupError(scene_file +
                          ": no mocap body of the name tool; give it one, as "
                          "<body name=\"tool\" mocap=\"true\">, its tip at the origin");
  }
  probe_ = tool_;
  for (int i = 0; i < model_->neq; ++i) {
    const int type = model_->eq_type[i];
    if (type != mjEQ_WELD && type != mjEQ_CONNECT) continue;
    if (model_->eq_obj1id[i] == tool_) probe_ = model_->eq_obj2id[i];
    if (model_->eq_obj2id[i] == tool_) probe_ = model_->eq_obj1id[i];
  }
  for (int geom = 0; geom < model_->ngeom; ++geom) {
    if (is_tool(geom)) return;
  }
  throw sdk::SetupError(scene_file +
                        ": the tool touches nothing; give the body tool, or the one that a weld "
                        "ties to it, a geom");
}

bool MujocoEngine::is_tool(int geom) const {
  const int body = model_->geom_bodyid[geom];
  return body == tool_ || body == probe_;
}

std::uint32_t MujocoEngine::tissue_of(int geom) const {
  const int root = model_->body_rootid[model_->geom_bodyid[geom]];
  return static_cast<std::uint32_t>(root == 0 ? model_->nbody + geom : root);
}

void MujocoEngine::move_tool(const sdk::Motion& motion) {
  const int mocap = model_->body_mocapid[tool_];
  write(motion, data_->mocap_pos + std::ptrdiff_t{3} * mocap,
        data_->mocap_quat + std::ptrdiff_t{4} * mocap);
  if (!is_placed_) place_probe(motion);
  is_placed_ = true;
}

/// Where the tool begins: the weld would else pull the probe there from its place in the file.
void MujocoEngine::place_probe(const sdk::Motion& motion) {
  if (model_->body_jntnum[probe_] != 1) return;
  const int joint = model_->body_jntadr[probe_];
  if (model_->jnt_type[joint] != mjJNT_FREE) return;
  mjtNum* const pose = data_->qpos + model_->jnt_qposadr[joint];
  write(motion, pose, pose + 3);
}

std::optional<sdk::Contact> MujocoEngine::contact_of(int contact) const {
  const mjContact& touch = data_->contact[contact];
  const bool is_second = is_tool(touch.geom2);
  if (is_tool(touch.geom1) == is_second) return std::nullopt;
  // the frame's rows are the axes of the contact; the first points from geom1 to geom2, and the
  // force acts on geom2
  const double sign = is_second ? 1.0 : -1.0;
  std::array<mjtNum, 6> wrench{};
  mj_contactForce(model_.get(), data_.get(), contact, wrench.data());
  Vector3 force = Vector3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    force += sign * wrench.at(static_cast<std::size_t>(axis)) * vector(touch.frame, axis);
  }
  const Vector3 normal = sign * vector(touch.frame, 0).normalized();
  // a probe stays outside while the tool is pressed in
  const Vector3 lag = vector(data_->xpos, probe_) - vector(data_->xpos, tool_);
  return sdk::Contact{.normal = normal,
                      .penetration_m = normal.dot(lag) - touch.dist,
                      .tissue = tissue_of(is_second ? touch.geom1 : touch.geom2),
                      .force_on_tool_newton = force};
}

std::vector<sdk::Contact> MujocoEngine::contacts() const {
  std::vector<sdk::Contact> touching;
  std::vector<sdk::Contact> nearest;  // of each tissue, without force
  const auto of_tissue = [](std::vector<sdk::Contact>& list, std::uint32_t tissue) {
    return std::find_if(list.begin(), list.end(),
                        [&](const sdk::Contact& contact) { return contact.tissue == tissue; });
  };
  for (int i = 0; i < data_->ncon; ++i) {
    const std::optional<sdk::Contact> contact = contact_of(i);
    if (!contact) continue;
    if (!contact->force_on_tool_newton->isZero(0.0)) {
      touching.push_back(*contact);
      continue;
    }
    const auto known = of_tissue(nearest, contact->tissue);
    if (known == nearest.end()) {
      nearest.push_back(*contact);
    } else if (contact->penetration_m > known->penetration_m) {
      *known = *contact;
    }
  }
  const auto touches = [&](const sdk::Contact& contact) {
    return of_tissue(touching, contact.tissue) != touching.end();
  };
  std::vector<sdk::Contact> all = touching;
  std::remove_copy_if(nearest.begin(), nearest.end(), std::back_inserter(all), touches);
  return all;
}

sdk::Answer MujocoEngine::step(const sdk::Motion& motion) {
  move_tool(motion);
  for (int i = 0; i < steps_; ++i) mj_step(model_.get(), data_.get());
  for (const mjtWarning kind : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
    if (data_->warning[kind].number > 0) {
      throw std::runtime_error("the scene has diverged; give it a smaller timestep");
    }
  }
  return {.contacts = contacts()};
}

std::vector<sdk::Surface> MujocoEngine::surfaces() { return surfaces_->at_rest(); }

bool MujocoEngine::deformed(std::size_t surface, std::vector<float>& vertices_m) {
  return surfaces_->update(*data_, surface, vertices_m);
}

}  // namespace palpate::engines
