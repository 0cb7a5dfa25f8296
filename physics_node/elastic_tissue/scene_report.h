// SPDX-License-Identifier: Apache-2.0
// scene_report.h — what a person should know of elastic tissues besides their meshes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

/// A line for each tissue that a body is tied to, and for each that it touches, whichever of the
/// two names the other: whether that gives way, and the gap or overlap of the two as the session
/// places them, between nodes and surfaces: before the body finds its rest, in which nothing
/// overlaps.
/// @param bodies  of the scene
[[nodiscard]] std::vector<std::string> touching_lines(
    const std::vector<std::shared_ptr<const ElasticBody>>& bodies, const ElasticBody& body,
    const SceneConfig& scene);

/// A sentence for each of elastic.attached that tears, but not with its toughness: elements keep it
/// only while the zone in which the bed softens, about young_pa/stiffness_pa_per_m long, is longer
/// than their edges.
[[nodiscard]] std::vector<std::string> tearing_warnings(const ElasticBody& body,
                                                        const ElasticMaterial& material);

}  // namespace palpate::physics
