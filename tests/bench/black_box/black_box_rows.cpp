// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/black_box/black_box_rows.h"

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/tissue_scenes.h"
#include "tests/support/black_box/black_box.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

using test::Told;

struct Scene {
  std::string name;
  std::function<Session(const std::vector<std::string>&)> session;
  double seconds;
};

// Pressed to 10 mm and left every 0.7 s: the surface is known after the first touch.
constexpr const char* kPalpated = R"(
name: "palpated"
device { simulated {} }
hand {
  sinusoid {
    amplitude_m { z: 0.01 }
    frequency_hz { z: 1.5 }
    phase_rad { z: 1.57 }
  }
}
scene {
  tissue {
    half_space {}
    kelvin_voigt { stiffness_newton_per_m: 500 damping_newton_s_per_m: 1 }
  }
}
)";

std::vector<Scene> scenes() {
  std::vector<Scene> all{{"half-space 500 N/m, 1.5 Hz",
                          [](const std::vector<std::string>& overrides) {
                            return parse_session(kPalpated, "palpated", overrides);
                          },
                          10.0}};
  for (const TissueScene& scene : tissue_scenes()) {
    const std::string name = scene.name;
    if (name != "500 N/m" && name != "2000 N/m" && name != "stiffening" && name != "sphere 50 mm" &&
        name != "soft/stiff edge") {
      continue;
    }
    all.push_back({name == "500 N/m" || name == "2000 N/m" ? "half-space " + name + ", once" : name,
                   [scene](const std::vector<std::string>& overrides) {
                     return session_of(scene, overrides);
                   },
                   scene.seconds});
  }
  for (const char* file : {"default", "liver"}) {
    const std::string path = test::source_dir() + "/deploy/sessions/" + file + ".txtpb";
    all.push_back({file,
                   [path](const std::vector<std::string>& overrides) {
                     return load_session(path, overrides);
                   },
                   10.0});
  }
  return all;
}

struct Way {
  const char* name;
  const char* interaction;
  bool is_black_box;
  Told told;
};
constexpr Way kWays[] = {{"force, held", "held", true, Told::kForce},
                         {"force, estimated", "local", true, Told::kForce},
                         {"force anywhere, estimated", "local", true, Told::kField},
                         {"points, estimated", "local", true, Told::kPoints},
                         {"own model", "local", false, Told::kForce}};

RunReport run(const Scene& scene, const Way& way) {
  const Session session = scene.session({"physics.rate_hz=100", "faults.tool_motion.delay_ms=20",
                                         "faults.interaction.delay_ms=20",
                                         std::string("mofc.interaction=") + way.interaction});
  LoopbackOptions options{.seconds = scene.seconds};
  if (way.is_black_box) {
    options.lockstep.make_engine = [told = way.told](const Session& of) {
      return test::black_box(of, told);
    };
  }
  return run_loopback(session, options);
}

}  // namespace

void run_black_box(const BenchOptions& options) {
  Table table({{"tissue", "tissue", ""},
               {"known", "known of it", ""},
               {"capped_transparency", "transp.", "{:.3f}"},
               {"gain", "gain", "{:.3f}"},
               {"force_error_percent", "error %", "{:.1f}"},
               {"beyond_jnd_percent", "> JND %", "{:.1f}"},
               {"path_rms_mm", "path mm", "{:.3f}"},
               {"excess_reversals", "exc. rev.", "{:.0f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  for (const Scene& scene : scenes()) {
    for (const Way& way : kWays) {
      const RunStatistics s = run(scene, way).statistics;
      table.add({scene.name, std::string(way.name), s.ideal_transparency(), s.gain(),
                 100.0 * s.force_error_rms_ratio(), 100.0 * s.beyond_jnd_ratio(),
                 1e3 * s.path_deviation_rms_m(), static_cast<double>(s.excess_reversals()),
                 100.0 * s.clamp_ratio(), 1e6 * s.minimum_true_energy_joule()});
    }
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "\nPhysics 100 Hz, 20 ms away each way, mode guard. Transparency: projected, capped, against "
      "the continuous tissue.\n");
}

}  // namespace palpate::bench
