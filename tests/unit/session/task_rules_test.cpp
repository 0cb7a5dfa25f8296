// SPDX-License-Identifier: Apache-2.0
// The rules of task { … } in a session: each violated, and kept.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kScene = R"(
  scene {
    tool { tip_radius_m: 0.006 }
    tissue {
      name: "block" tetrahedral_mesh { file: "b.msh" }
      elastic {
        young_pa: 1e4 fixed { half_space { point_m { z: -0.04 } } }
        part { where { sphere { center_m { x: 0.01 z: -0.02 } radius_m: 0.008 } } young_pa: 1e5 }
        part { where { half_space { point_m { z: -0.03 } } } young_pa: 2e4 }
      }
    }
    tissue {
      name: "pad" half_space { point_m { z: -0.1 } }
      kelvin_voigt {
        stiffness_newton_per_m: 300
        inclusion { center_m { z: -0.11 } radius_m: 0.005 stiffness_newton_per_m: 900 }
      }
    }
    tissue {
      name: "beating" sphere { center_m { x: 1 } radius_m: 0.1 }
      kelvin_voigt { stiffness_newton_per_m: 300 }
      motion { amplitude_m { z: 0.01 } frequency_hz: 1 }
    }
  }
)";

std::string session_with(const std::string& task, const std::string& rest = "") {
  return std::string("name: \"x\" ") + kScene + rest + " task { " + task + " }";
}
std::vector<std::string> task_complaints(const std::string& task, const std::string& rest = "") {
  return complaints(session_with(task, rest), {}, "/tmp");
}
auto is_at(const std::string& field, const std::string& words) {
  return AllOf(SizeIs(2),
               Contains(AllOf(StartsWith("x.txtpb:"), HasSubstr(field + ""), HasSubstr(words))));
}

TEST(TaskRules, ASearchIsReadWithItsDefaults) {
  const Session session = parse_session(
      session_with("palpation { tissue: 'block' target { lesion: 0 palpable_newton: 1.5 } "
                   "area { box { size_m { x: 0.05 y: 0.05 z: 0.01 } } } }"),
      "x.txtpb", {}, "/tmp");
  ASSERT_TRUE(session.task);
  const TaskConfig& task = *session.task;
  EXPECT_FALSE(task.is_started_by_person);
  EXPECT_FALSE(task.time_s);
  EXPECT_FALSE(task.most_force_newton);
  EXPECT_TRUE(task.hides_places());
  ASSERT_NE(task.palpation(), nullptr);
  const PalpationTask& search = *task.palpation();
  EXPECT_EQ(search.tissue, 0U);
  EXPECT_EQ(search.least_force_newton, 0.5);
  EXPECT_EQ(search.coverage_radius_m, 0.006);
  EXPECT_EQ(search.mark_tolerance_m, 0.01);
  ASSERT_THAT(search.targets, SizeIs(1));
  EXPECT_EQ(search.targets[0].name, "lesion 1");
  EXPECT_EQ(search.targets[0].center_m, Vector3(0.01, 0.0, -0.02));
  EXPECT_EQ(search.targets[0].radius_m, 0.008);
  EXPECT_EQ(search.targets[0].palpable_newton, 1.5);
  EXPECT_TRUE(std::isnan(search.targets[0].contrast_ratio));
}

TEST(TaskRules, TargetsAreInclusionsTooAndAFreeTaskHasNone) {
  EXPECT_THAT(task_complaints("start: by_person time_s: 60 mark_button: 31 "
                              "palpation { tissue: 'pad' target { lesion: 0 } }"),
              IsEmpty());
  EXPECT_THAT(task_complaints("free {} most_force_newton: 3"), IsEmpty());
  EXPECT_FALSE(parse_session(session_with("free {}"), "x", {}, "/tmp").task->hides_places());
}

TEST(TaskRules, NeedsAKindAndATissueThatRests) {
  EXPECT_THAT(task_complaints(""), is_at("task", "a kind is required"));
  EXPECT_THAT(task_complaints("palpation {}"), is_at("task.palpation.tissue", "name a tissue"));
  EXPECT_THAT(task_complaints("palpation { tissue: 'liver' }"),
              is_at("task.palpation.tissue", "has no tissue of this name"));
  EXPECT_THAT(task_complaints("palpation { tissue: 'beating' }"),
              is_at("task.palpation.tissue", "must be at rest"));
}

TEST(TaskRules, ATargetIsABallOfTheTissueAndOnlyOnce) {
  const auto target = [](const std::string& fields) {
    return task_complaints("palpation { tissue: 'block' target { " + fields + " } }");
  };
  EXPECT_THAT(target(""), is_at("task.palpation.target[0].lesion", "give the index"));
  EXPECT_THAT(target("lesion: 2"), is_at("target[0].lesion", "has 2 parts or inclusions"));
  EXPECT_THAT(target("lesion: 1"), is_at("target[0].lesion", "must be a ball"));
  EXPECT_THAT(target("lesion: 0 } target { lesion: 0"),
              is_at("target[1].lesion", "another target is this one too"));
  EXPECT_THAT(target("lesion: 0 palpable_newton: -1"), is_at("palpable_newton", "must be"));
}

TEST(TaskRules, ALimitIsOfATissueThatRestsAndOnlyOnce) {
  const auto limit = [](const std::string& fields) {
    return task_complaints("free {} tissue_limit { " + fields + " }");
  };
  EXPECT_THAT(limit("tissue: 'pad' most_force_newton: 2 most_damage_newton_s: 0.5"), IsEmpty());
  EXPECT_THAT(limit("most_force_newton: 2"), is_at("task.tissue_limit[0].tissue", "name a tissue"));
  EXPECT_THAT(limit("tissue: 'pad'"), is_at("most_force_newton", "give the largest force"));
  EXPECT_THAT(limit("tissue: 'liver' most_force_newton: 2"), is_at("tissue", "of this name"));
  EXPECT_THAT(limit("tissue: 'beating' most_force_newton: 2"), is_at("tissue", "must be at rest"));
  EXPECT_THAT(limit("tissue: 'pad' most_force_newton: 2 } tissue_limit { tissue: 'pad' "
                    "most_force_newton: 3"),
              is_at("tissue_limit[1].tissue", "has a limit already"));
  const Session session = parse_session(
      session_with("free {} tissue_limit { tissue: 'pad' most_force_newton: 2 }"), "x", {}, "/tmp");
  ASSERT_EQ(session.task->tissue_limits.size(), 1U);
  EXPECT_EQ(session.task->tissue_limits[0].tissue, 1U);
  EXPECT_FALSE(session.task->tissue_limits[0].most_damage_newton_s);
}

TEST(TaskRules, RangesAndPlaces) {
  EXPECT_THAT(task_complaints("free {} time_s: 0.5"), is_at("task.time_s", "must be"));
  EXPECT_THAT(task_complaints("free {} most_force_newton: 0"),
              is_at("task.most_force_newton", "must be > 0"));
  EXPECT_THAT(task_complaints("free {} mark_button: 32"), is_at("task.mark_button", "32 buttons"));
  EXPECT_THAT(task_complaints("free {} briefing: '" + std::string(1001, 'a') + "'"),
              is_at("task.briefing", "at most 1000 bytes"));
  EXPECT_THAT(task_complaints("palpation { tissue: 'block' area { tag: 'top' } }"),
              is_at("task.palpation.area.tag", "half_space, sphere or box"));
}

TEST(TaskRules, IsForOneDeviceAndOurPhysics) {
  EXPECT_THAT(task_complaints("free {}", "side { name: 'left' } side { name: 'right' }"),
              Contains(HasSubstr("is for one device; leave it out of a session with sides")));
  EXPECT_THAT(task_complaints("palpation { tissue: 'pad' }", "physics { command: 'mine' }"),
              Contains(HasSubstr("needs physics_node")));
}

// --- a needle ---

constexpr const char* kLayers = R"(
  name: "x"
  scene {
    tool { tip_radius_m: 0.0007 shaft_length_m: 0.1 }
    tissue { name: "skin" half_space {} kelvin_voigt { stiffness_newton_per_m: 900 puncture_newton: 1 } }
    tissue {
      name: "flavum" box { center_m { z: -0.02 } size_m { x: 0.1 y: 0.1 z: 0.01 } }
      hunt_crossley { stiffness_newton_per_m: 900 puncture_newton: 2 }
    }
    tissue {
      name: "dura" sphere { center_m { z: -0.05 } radius_m: 0.02 }
      kelvin_voigt { stiffness_newton_per_m: 900 puncture_newton: 1 }
    }
    tissue { name: "bone" half_space { point_m { z: -0.1 } } kelvin_voigt { stiffness_newton_per_m: 9000 } }
    tissue {
      name: "file" triangle_surface { file: "a.stl" }
      kelvin_voigt { stiffness_newton_per_m: 900 puncture_newton: 1 }
    }
    tissue {
      name: "beating" sphere { center_m { x: 1 } radius_m: 0.1 }
      kelvin_voigt { stiffness_newton_per_m: 300 puncture_newton: 1 }
      motion { amplitude_m { z: 0.01 } frequency_hz: 1 }
    }
  }
)";

std::string needle_session(const std::string& needle) {
  return std::string(kLayers) + " task { needle { " + needle + " } }";
}
std::vector<std::string> needle_complaints(const std::string& needle) {
  return complaints(needle_session(needle), {}, "/tmp");
}

TEST(TaskRules, ANeedleIsReadWithItsDefaults) {
  const Session session = parse_session(
      needle_session("layer: ['skin', 'flavum', 'dura'] membrane: 'flavum' spared: 'dura'"), "x",
      {}, "/tmp");
  const NeedleTask* needle = session.task->needle();
  ASSERT_NE(needle, nullptr);
  EXPECT_TRUE(session.task->hides_places());
  ASSERT_THAT(needle->layers, SizeIs(3));
  EXPECT_EQ(needle->layers[1].tissue, 1U);
  EXPECT_EQ(needle->layers[1].material.puncture_newton, 2.0);
  EXPECT_FALSE(needle->layers[1].is_spared);
  EXPECT_TRUE(needle->layers[2].is_spared);
  EXPECT_EQ(needle->membrane, 1U);
  EXPECT_EQ(needle->direction, Vector3(0, 0, -1));
  EXPECT_FALSE(needle->most_overshoot_m);
  EXPECT_THAT(needle_complaints("layer: 'dura' membrane: 'dura' direction { x: 1 z: -1 } "
                                "most_overshoot_m: 0.002"),
              IsEmpty());
}

TEST(TaskRules, LayersCanBePuncturedAndRest) {
  EXPECT_THAT(needle_complaints("membrane: 'skin'"),
              is_at("task.needle.layer", "name the tissues"));
  const auto layer = [](const std::string& name) {
    return needle_complaints("layer: ['flavum', '" + name + "'] membrane: 'flavum'");
  };
  EXPECT_THAT(layer("liver"), is_at("task.needle.layer[1]", "has no tissue of this name"));
  EXPECT_THAT(layer("bone"), is_at("task.needle.layer[1]", "cannot be punctured"));
  EXPECT_THAT(layer("file"), is_at("task.needle.layer[1]", "whose far side is known"));
  EXPECT_THAT(layer("beating"), is_at("task.needle.layer[1]", "must be at rest"));
  EXPECT_THAT(layer("flavum"), is_at("task.needle.layer[1]", "twice"));
}

TEST(TaskRules, ANeedleMeetsItsLayersOneAfterTheOther) {
  EXPECT_THAT(needle_complaints("layer: ['flavum', 'skin'] membrane: 'flavum'"),
              is_at("task.needle.layer[1]", "skin: begins before flavum on the way"));
  EXPECT_THAT(needle_complaints("layer: ['skin', 'flavum'] membrane: 'flavum' direction { z: 1 }"),
              is_at("task.needle.layer[0]", "skin: direction leads out of it"));
}

TEST(TaskRules, TheMembraneIsALayerAndWhatIsSparedLiesBehindIt) {
  const std::string layers = "layer: ['skin', 'flavum', 'dura'] ";
  EXPECT_THAT(needle_complaints(layers), is_at("task.needle.membrane", "name one of the layers"));
  EXPECT_THAT(needle_complaints(layers + "membrane: 'bone'"),
              is_at("task.needle.membrane", "is none of the layers"));
  EXPECT_THAT(needle_complaints(layers + "membrane: 'skin'"),
              is_at("task.needle.membrane", "has no far side"));
  EXPECT_THAT(needle_complaints(layers + "membrane: 'flavum' spared: 'skin'"),
              is_at("task.needle.spared[0]", "behind the membrane"));
  EXPECT_THAT(needle_complaints(layers + "membrane: 'flavum' most_overshoot_m: 1"),
              is_at("most_overshoot_m", "must be"));
  EXPECT_THAT(
      complaints(needle_session(layers + "membrane: 'flavum'") + " physics { command: 'mine' }", {},
                 "/tmp"),
      Contains(HasSubstr("needs physics_node")));
}

// --- traction ---

std::string traction_session(const std::string& traction, const std::string& tool = "gripper {}",
                             const std::string& more = "") {
  return "name: \"x\" scene { tool { tip_radius_m: 0.006 " + tool + R"( }
    tissue { name: "block" tetrahedral_mesh { file: "b.msh" }
      elastic { young_pa: 1e4 fixed { half_space { point_m { z: -0.04 } } } } } }
    task { )" +
         more + "traction { " + traction + " } }";
}

TEST(TaskRules, ATractionIsReadWithItsDefaults) {
  const Session session =
      parse_session(traction_session("target_m { z: 0.02 }"), "x.txtpb", {}, "/tmp");
  const TractionTask* traction = session.task->traction();
  ASSERT_NE(traction, nullptr);
  EXPECT_FALSE(session.task->hides_places());
  EXPECT_EQ(traction->target_m, Vector3(0, 0, 0.02));
  EXPECT_EQ(traction->tolerance_m, 0.003);
  EXPECT_EQ(traction->hold_s, 5.0);
}

TEST(TaskRules, ATractionNeedsATargetAGripperAndElasticTissue) {
  const auto wrong = [](const std::string& session) { return complaints(session, {}, "/tmp"); };
  const std::string target = "target_m { z: 0.02 }";
  EXPECT_THAT(wrong(traction_session("")), is_at("task.traction.target_m", "give the place in W"));
  EXPECT_THAT(wrong(traction_session(target, "")), is_at("task.traction", "gripper"));
  EXPECT_THAT(wrong(traction_session(target + " hold_s: 0")),
              is_at("task.traction.hold_s", "leave it out"));
  EXPECT_THAT(wrong(traction_session(target + " tolerance_m: 1")),
              is_at("task.traction.tolerance_m", "leave it out"));
  EXPECT_THAT(wrong(traction_session(target, "gripper {}", "mark_button: 1 ")),
              is_at("task.mark_button", "marks nothing with traction"));
  EXPECT_THAT(wrong(traction_session(target) + " physics { command: 'mine' }"),
              Contains(AllOf(HasSubstr("task.traction"), HasSubstr("needs physics_node"))));
  const std::string hard = R"(name: "x" scene { tool { tip_radius_m: 0.006 gripper {} }
    tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 300 } } } task { traction { )";
  EXPECT_THAT(wrong(hard + target + " } }"), Contains(HasSubstr("needs tissue that can be held")));
}

TEST(TaskRules, TargetsAndTheirLesionsAreTakenOut) {
  const Session whole =
      parse_session(session_with("palpation { tissue: 'block' target { lesion: 0 } }",
                                 "hand { press { until_s: 1 } }"),
                    "x", {}, "/tmp");
  const Session rest = parse_session(without_targets(whole.text), "x", {}, "/tmp");
  EXPECT_THAT(rest.task->palpation()->targets, IsEmpty());
  const auto& parts = std::get<ElasticMaterial>(rest.scene.tissues[0].material).parts;
  ASSERT_THAT(parts, SizeIs(1));  // the one that is no target stays
  EXPECT_EQ(parts[0].young_pa, 2e4);
  EXPECT_THAT(whole.side().hand.presses, SizeIs(1));
  EXPECT_THAT(rest.side().hand.presses, IsEmpty());
  EXPECT_EQ(without_targets("{"), "");
}

}  // namespace
}  // namespace palpate
