// SPDX-License-Identifier: Apache-2.0
// stations.ts: the tasks of many stations as one table, for a teacher. `palpate stations --web-port`
// serves it, and says at /task what it prints on the terminal.
import { make, write } from "../card";

interface Station {
  name: string;
  state: string;
  cells: string[]; // in the order of the columns after the state
}

const kEvery_ms = 1000;
const kTroubles = ["absent", "not understood"];

function row_of({ name, state, cells }: Station): HTMLTableRowElement {
  const row = make("tr");
  row.dataset.state = state;
  const heading = make("th", "", name);
  heading.scope = "row";
  row.append(heading, make("td", kTroubles.includes(state) ? "error" : "", state), ...cells.map((cell) => make("td", "", cell)));
  return row;
}

/** "3 stations: 1 running, 2 ended" */
function summary_of(stations: Station[]): string {
  const counts = new Map<string, number>();
  for (const { state } of stations) counts.set(state, (counts.get(state) ?? 0) + 1);
  const parts = [...counts].map(([state, count]) => `${count} ${state}`);
  return `${stations.length} ${stations.length === 1 ? "station" : "stations"}: ${parts.join(", ")}`;
}

let shown = ""; // a table that did not change is left alone
async function renew(): Promise<void> {
  const summary = document.getElementById("summary")!;
  try {
    const answer = await fetch("task", { cache: "no-store", signal: AbortSignal.timeout(3 * kEvery_ms) });
    const text = await answer.text();
    const { stations } = JSON.parse(text) as { stations: Station[] };
    if (text !== shown) document.getElementById("stations")!.replaceChildren(...stations.map(row_of));
    shown = text;
    write(summary, summary_of(stations));
  } catch {
    write(summary, "The table is not renewed any more: palpate stations has ended.");
  }
}

async function keep_renewing(): Promise<void> {
  for (;;) {
    await renew();
    await new Promise((resolve) => setTimeout(resolve, kEvery_ms));
  }
}
void keep_renewing();
