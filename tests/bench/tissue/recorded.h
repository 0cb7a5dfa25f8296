// SPDX-License-Identifier: Apache-2.0
// recorded.h — what others have published about the same bodies: not run here.
#pragma once

#include <array>

namespace palpate::bench {

struct RecordedRow {
  const char* problem;
  const char* program;
  const char* mesh;
  double value;  ///< in the unit of the problem
};

inline constexpr const char* kRecordedFrom =
    "recorded, not run here: AustrianTradingMachine/Newton 9e5d430, docs/STATUS.md and logs/, run "
    "of "
    "2026-06-30 on an A100; XPBD 32 x 10, VBD 10 x 50, semi-implicit 32 substeps (x iterations) a "
    "frame, settled";

/// Why there is no row of it here.
inline constexpr const char* kNoMujoco =
    "MuJoCo: not run here. Debian's 2.2.2 has no flex, which came with 3.0; the figures of 3.3.8 "
    "and "
    "3.14.0 in docs/tissue.md are those of tests/bench/tissue/mujoco/mujoco_flex.mjs";

/// Of the sag and of the press, in mm and N. Of the press Newton's forces are not published: in VBD
/// and in the semi-implicit solver the sphere sinks in by 34 and 33 of the 40 mm.
inline constexpr auto kRecorded = std::to_array<RecordedRow>({
    {"hang", "Newton XPBD", "2,880 linear", 158.86},
    {"hang", "Newton VBD", "2,880 linear", 139.53},
    {"hang", "Newton semi-implicit", "2,880 linear", 84.99},
    {"hang", "FEniCSx", "2,880 linear", 43.20},
    {"hang", "FEniCSx", "576 hexahedra", 43.40},
    {"press", "FEniCSx", "tetrahedra, 3,969 nodes", 309.1},
    {"press", "FEniCSx", "hexahedra, 3,969 nodes", 283.1},
});

}  // namespace palpate::bench
