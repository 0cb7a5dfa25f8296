#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What a hand feels of a half-space over DDS, beside the same half-space on hop 3, in real time.

    tests/bench/ros/ros_bench.py [--seconds S] [--quick] [--faults] [--json FILE] [--csv FILE] [--bin DIR]

Rows: physics_node's own half-space (described to mofc_node); a physics on hop 3 that tells only its force;
the same force from another vendor's DDS at 1 kHz, which answers by the stamp of the pose, and with stamps
of its own clock; then sources that go wrong after a while. T and gain as docs/theory.md defines them, against 400 N/m at the true position, over
samples in which one of the two forces is above 0.05 N. oldest_force_ms: the longest time from a state of
the device to the last tick in which a force that answered it acted; the sources go wrong 1.5 mm deep. Needs cyclonedds-dev, libfastrtps-dev and
libfastcdr-dev at build time (targets palpate_ros, fast_dds_peer, force_half_space).
"""
import argparse
import csv
import json
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
STIFFNESS = 400.0
SESSION = """
name: "ros_bench"
device { rate_hz: 1000 simulated {} }
hand {
  sinusoid { center_m { z: 0 } amplitude_m { z: 0.01 } frequency_hz { z: 1 } phase_rad { z: 1.57 } }
}
mofc { controller: mofc mode: guard }
scene { tool { tip_radius_m: 0 } TISSUE }
physics { rate_hz: 1000 COMMAND }
"""
TISSUE = "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } }"


def start(command, error):
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=error, text=True)


def end(process):
    process.send_signal(signal.SIGTERM)
    return process.communicate(timeout=60)[0]


def rendered(table):
    """T and gain of a table of ticks."""
    shares, along, ideal2, count, oldest_s = 0.0, 0.0, 0.0, 0, 0.0
    with open(table, newline="") as file:
        for row in csv.DictReader(file):
            ideal = STIFFNESS * max(0.0, -float(row["z_m"]))
            force = float(row["fs_z"])
            if force != 0.0 and row["force_age_s"]:
                oldest_s = max(oldest_s, float(row["force_age_s"]))
            if ideal <= 0.05 and abs(force) <= 0.05:
                continue
            count += 1
            shares += min(1.0, max(0.0, force * ideal / ideal**2)) if ideal > 0.0 else 0.0
            along += force * ideal
            ideal2 += ideal**2
    return {"ticks_with_force": count, "transparency": shares / count if count else None,
            "gain": along / ideal2 if ideal2 else None, "oldest_force_ms": 1e3 * oldest_s}


def run(name, options, tissue="", command="", peer=None, fault_after_s=None):
    bin_folder = options.bin
    row = {"physics": name}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        session = folder / "session.txtpb"
        session.write_text(SESSION.replace("TISSUE", tissue).replace("COMMAND", command))
        with open(folder / "log", "w+") as log:
            launch = start([bin_folder / "palpate", "launch", session, "--no-viewer", "--json",
                            folder / "run.json"], log)
            other = start([bin_folder / "fast_dds_peer", options.domain, "palpate", "source", peer],
                          subprocess.DEVNULL) if peer is not None else None
            time.sleep(3)  # discovery, start of the device
            viewer = start([bin_folder / "viewer_node", "--session", session, "--csv", folder / "ticks.csv",
                            "--no-web", "--quiet"], log)
            if fault_after_s is None:
                time.sleep(options.seconds)
            else:
                time.sleep(fault_after_s)
                other.send_signal(signal.SIGUSR1)
                time.sleep(4)
            end(viewer)
            said = end(other) if other else ""
            end(launch)
            log.seek(0)
            text = log.read()
        row.update(rendered(folder / "ticks.csv"))
        summary = json.loads((folder / "run.json").read_text())
        row["min_true_energy_uj"] = 1e6 * summary["min_true_energy_j"]
    counted = re.search(r"event=ros_physics (.*)", text)
    if counted:
        numbers = dict(re.findall(r"(\w+)=(\d+)", counted.group(1)))
        peer_counts = dict(re.findall(r"(\w+)=(\d+)", said))
        row.update({key: int(value) for key, value in numbers.items()})
        row["peer_received"] = int(peer_counts["received"])
        row["peer_sent"] = int(peer_counts["sent"])
    if row["transparency"] is None:
        sys.stderr.write(text)
    if fault_after_s is not None:  # of a source that goes wrong it says nothing
        row["transparency"] = row["gain"] = None
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--faults", action="store_true", help="only the rows of sources that go wrong")
    parser.add_argument("--quick", action="store_true", help="8 s each")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--csv", type=pathlib.Path)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--domain", type=int, default=99)
    options = parser.parse_args()
    if options.quick:
        options.seconds = 8.0
    ros = f'command: ["palpate_ros", "physics", "--domain", "{options.domain}"]'
    rows = [] if options.faults else [
        run("physics_node, described", options, tissue=TISSUE),
        run("force on hop 3", options, command=f'command: ["{options.bin}/force_half_space"]'),
        run("force over DDS, answers by stamp", options, command=ros, peer=""),
        run("force over DDS, own clock", options, command=ros, peer="own_clock"),
    ]
    for fault in ("stop", "repeat", "nan", "huge", "late", "reorder", "flood"):
        rows.append(run("over DDS: " + fault, options, command=ros, peer=fault, fault_after_s=3))
    keys = list(dict.fromkeys(key for row in rows for key in row))
    if options.json:
        options.json.write_text(json.dumps({"schema_version": 1, "seconds": options.seconds, "rows": rows},
                                           indent=2) + "\n")
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            writer = csv.DictWriter(file, keys)
            writer.writeheader()
            writer.writerows(rows)
    for row in rows:
        print(row["physics"])
        for key, value in row.items():
            if key != "physics" and value is not None:
                print(f"  {key:24} {value:.3f}" if isinstance(value, float) else f"  {key:24} {value}")


if __name__ == "__main__":
    main()
