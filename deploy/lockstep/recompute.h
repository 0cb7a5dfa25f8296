// SPDX-License-Identifier: Apache-2.0
// recompute.h — `palpate report --recompute`: the energies and the figures of a recorded run,
// computed again from what acted.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "common/session/session.h"
#include "common/telemetry/metrics.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// A figure as recorded and as computed again; NaN: not known.
struct Twice {
  double recorded = kNaN;
  double recomputed = kNaN;
};

struct Recomputed {
  std::uint64_t ticks = 0;

  /// Why the motion of the hand cannot be computed again; empty: it was, and what follows is known.
  std::string not_moved;
  double largest_position_difference_m = 0.0;    ///< of the true tool, over all ticks
  double largest_energy_difference_joule = 0.0;  ///< of the true energy, over all ticks
  Twice least_true_energy_joule;
  /// Rendered against ideal force. Nothing recorded: a run without the ideal, or of a version that
  /// did not keep its comparison.
  ForceComparison recorded_to_ideal;
  ForceComparison to_ideal;

  /// Rendered against requested force, as mofc_node counted it and from the ticks.
  Twice transparency;
  /// The controller's ledger without the limits of its credit: a lower bound of the energy that the
  /// hand put in, which a recorded ledger never exceeds. Known from the first tick of a device
  /// session on, until ticks are missing; NaN: nowhere, or the controller has none.
  Twice last_ledger_joule;
  double largest_ledger_excess_joule = kNaN;  ///< recorded less recomputed, over all ticks

  /// Whether all that was recorded and computed again is the same: true energy and position to the
  /// last bit, integrals to 1e-9 of themselves, the ledger nowhere more than 1 nJ above.
  [[nodiscard]] bool is_same() const;
};

/// Reads the chosen side. The hand is moved again under the forces that acted, as the simulated
/// device did it, and the tissue of the session is evaluated along its way: for recordings of
/// `palpate loopback`, whose clock begins with the hand. The ledger is that of the session's
/// controller.
/// @param session  of this side alone   @param on_progress  see report_html()
[[nodiscard]] Recomputed recompute(RecordingFile& recording, const Session& session,
                                   const std::function<void(double)>& on_progress = {});

/// For a terminal: each figure twice, and whether they are the same.
[[nodiscard]] std::string recomputed_text(const Recomputed& recomputed);

}  // namespace palpate
