#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Follows the first pages of the documents: takes the commands from a page's own code blocks, runs them one after the
other in a shell, and checks that each does what the page says.

    follow.py --build FOLDER PAGE           with the programs of a build, in a temporary folder
    follow.py --root FOLDER TREE PAGE ...   in the root file system of a fresh Debian, with a copy of TREE (run)

A page is followed in namespaces of its own for processes and network, so that its `pkill` and its ports meet nothing
else. What a person does is done here: Ctrl-C, a second terminal, the two addresses, the cable. With --build no packages
are installed. With --root the commands that all pages begin with are run once, with network; then each page goes on in
a copy of what they made. Exit status 0: each page reaches what it promises; 1: it does not; 77: namespaces are refused.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Callable, Optional

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))
from machine import DEADLINE_S, QuietMachine  # noqa: E402


class Broken(Exception):
    """A page does not reach what it promises."""


def commands_of(page: Path) -> list[str]:
    """The commands in the shell blocks of a page, in order."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").split("\n")
    return [line for line in lines if line.strip() and not line.startswith("#")]


class Terminal:
    """A shell in which commands are run one after the other."""

    def __init__(self, enter: list[str], folder: str, home: str, network: bool, log: Path) -> None:
        self.log = log
        self._background: list[tuple[str, str]] = []  # variable of the process id, file of the output
        self._started = 0
        kept = {name: os.environ[name] for name in ("NODE_EXTRA_CA_CERTS", "SSL_CERT_FILE") if name in os.environ}
        self._shell = subprocess.Popen(
            [*enter, "bash", "--norc", "--noprofile"], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, env={**kept, "HOME": home, "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"})
        self.run(f"cd '{folder}' && set -m && mkdir -p .terminal", status=0)
        if not network:
            self.run("ip link set lo up", status=0)

    def run(self, command: str, status: Optional[int] = None) -> tuple[int, str]:
        """Exit status and output of a command, run to its end.

        @param status  that it must have
        """
        assert self._shell.stdin and self._shell.stdout
        self._shell.stdin.write(f"{{ {command}\n}} < /dev/null" + "\nprintf '\\n--status %d\\n' $?\n")
        self._shell.stdin.flush()
        output = ""
        for line in self._shell.stdout:
            if line.startswith("--status "):
                break
            output += line
        else:
            raise Broken(f"the shell ended in `{command}`:\n{output}")
        with self.log.open("a") as log:
            log.write(f"$ {command}\n{output}")
        found = int(line.split()[1])
        if status is not None and found != status:
            raise Broken(f"`{command}` ends with status {found} instead of {status}:\n{output}")
        return found, output

    def start(self, command: str) -> None:
        """Begins a command that a person leaves running."""
        self._started += 1
        number = self._started
        # of its own and there before it is read: the shell opens it only once the background process runs
        output = f".terminal/{number}"
        self.run(f": > {output}; {{ {command}\n}} > {output} 2>&1 & p{number}=$!; :")
        self._background.append((f"p{number}", output))

    def output(self, number: int = -1) -> str:
        return self.run(f"cat {self._background[number][1]}")[1]

    def wait_for(self, pattern: str, number: int = -1, after: int = 0) -> int:
        """Until a command that runs has printed the pattern.

        @param after  characters of its output that do not count
        @return       characters of its output up to the end of the match
        """
        until = time.monotonic() + 3 * DEADLINE_S
        while True:
            text = self.output(number)
            if match := re.compile(pattern).search(text, after):
                return match.end()
            if time.monotonic() > until:
                raise Broken(f"`{pattern}` never comes:\n{text}")
            time.sleep(0.2)

    def end(self, status: int = 0) -> str:
        """Ctrl-C in the terminal of the last command that runs; what it has printed."""
        variable, _ = self._background[-1]
        # the supervisor asks its programs to stop; the group is that of the terminal
        self.run(f"kill -INT -- -${variable}")
        self.run(f"wait ${variable}", status=status)
        output = self.output()
        self._background.pop()
        return output

    def close(self) -> None:
        assert self._shell.stdin
        self._shell.stdin.close()
        self._shell.wait()


Step = Callable[[Terminal, str], None]


def works(terminal: Terminal, command: str) -> None:
    terminal.run(command, status=0)


def says(*patterns: str, statuses: tuple[int, ...] = (0,)) -> Step:
    def step(terminal: Terminal, command: str) -> None:
        status, output = terminal.run(command)
        if status not in statuses:
            raise Broken(f"`{command}` ends with status {status}:\n{output}")
        for pattern in patterns:
            if not re.search(pattern, output):
                raise Broken(f"`{command}` does not say `{pattern}`:\n{output}")

    return step


def in_real_time(*patterns: str) -> Step:
    """Ends with 1 at most where the machine was busy."""

    def step(terminal: Terminal, command: str) -> None:
        with QuietMachine() as machine:
            status, _ = terminal.run(command)
            if status == 1 and not machine.may_check(f"`{command}`"):
                return
        says(*patterns)(terminal, command)

    return step


def begins(pattern: str) -> Step:
    def step(terminal: Terminal, command: str) -> None:
        terminal.start(command)
        terminal.wait_for(pattern)

    return step


MICROJOULE = {"J": 1e6, "mJ": 1e3, "µJ": 1.0, "nJ": 1e-3}


def summary_of(figures: dict[str, float], name: str) -> Step:
    """Keeps the figures of a run in lockstep that the page asks to compare."""

    def step(terminal: Terminal, command: str) -> None:
        output = terminal.run(command, status=0)[1]
        for key, pattern in {
            "energy": r"least true energy +(\S+ .?J)\b",
            "reversals": r"velocity reversals +\d+, (\d+) more",
            "transparency": r"transparency, vector .*requested\), (\S+) \(rendered / ideal",
            "peak": r"largest force +(\S+) N",
        }.items():
            match = re.search(pattern, output)
            if not match:
                raise Broken(f"`{command}` does not say `{pattern}`:\n{output}")
            number, *unit = match[1].split()
            figures[f"{name} {key}"] = float(number) * MICROJOULE[unit[0]] if unit else float(number)

    return step


def holds(is_so: bool, claim: str, figures: dict[str, float]) -> None:
    if not is_so:
        raise Broken(f"not so: {claim}: {figures}")


NO_ENERGY = r"good  the hand extracted no energy"
SET_UP: list[tuple[str, Step]] = [
    ("./deploy/demo.sh", says(r"least true energy +\S+ .?J \(0 or more: passive\)")),
    ("cmake --build build/release", works),
    ("PATH=", works),
]


def first_device(terminal: Terminal) -> list[tuple[str, Step]]:
    def acknowledge(terminal: Terminal, command: str) -> None:
        # a busy machine may make the stand-in late: a fault, acknowledged as any other
        after = 0
        for _ in range(10):
            terminal.run(command, status=0)
            after = terminal.wait_for("phase=enabled|event=device_fault reason", after=after)
            if terminal.output()[:after].endswith("phase=enabled"):
                felt = r"answered \S+ %  contact  \|F\| (0\.[1-9]|[1-9])"
                after = terminal.wait_for(felt + "|event=device_fault reason", after=after)
                if not terminal.output()[:after].endswith("event=device_fault reason"):
                    break
            after = terminal.wait_for("FAULT: ", after=after)
        output = terminal.end()
        if not re.search(r"emulated device: \d+ messages, least true energy 0 µJ", output):
            raise Broken(f"the emulated hand was given energy:\n{output}")

    def own_driver(terminal: Terminal, command: str) -> None:
        begins(r"device_phase phase=calibrated")(terminal, command)
        terminal.end()

    return [
        ("palpate loopback", says(r"transparency", r"clamped", r"least true energy +0 µJ", NO_ENERGY)),
        ("palpate scene check", says(": ok")),
        ("palpate launch deploy/sessions/haply.txtpb --emulate", begins("phase=calibrated.*send SIGUSR2")),
        ("pkill -USR2", acknowledge),
        ("cp ", works),
        ("palpate devices", works),
        ("palpate doctor mine.txtpb", says(r"TO DO  device +haply_inverse does not open.*palpate emulate", statuses=(1,))),
        ("cmake --install build/release", works),
        ("cc ", works),
        ("palpate launch deploy/sessions/default.txtpb", own_driver),
    ]


def first_workstation(terminal: Terminal) -> list[tuple[str, Step]]:
    def copied(terminal: Terminal, command: str) -> None:
        terminal.run(command, status=0)
        terminal.run("sed -i 's/192.168.1.20/127.0.0.2/; s/192.168.1.10/127.0.0.3/' mine.txtpb")  # insert the two addresses

    def on_the_workstation(terminal: Terminal, command: str) -> None:
        # another machine has its own sockets
        terminal.run("mkdir -p -m 700 .workstation")
        terminal.start(f'XDG_RUNTIME_DIR="$PWD/.workstation" {command}')

    def at_the_bedside(terminal: Terminal, command: str) -> None:
        terminal.start(command)
        after = terminal.wait_for(r"contact  \|F\| (0\.[1-9]|[1-9])")
        terminal.run("kill -STOP $(pgrep -x physics_node)")  # pull the cable
        after = terminal.wait_for(r"no physics  \|F\| 0\.00", after=after)
        terminal.run("kill -CONT $(pgrep -x physics_node)")
        terminal.wait_for(r"contact  \|F\| (0\.[1-9]|[1-9])", after=after)
        if "least true energy   0 µJ" not in (output := terminal.end()):
            raise Broken(f"the hand was given energy:\n{output}")
        terminal.end()

    return [
        ("palpate loopback", says(r"transparency", r"force error", r"clamped", NO_ENERGY)),
        ("cp ", copied),
        ("palpate keygen", works),
        ("palpate doctor", says(r"ok +links.tool_motion +tcp://127.0.0.2:5551 is free", r"ok +keys", statuses=(0, 1))),
        ("palpate launch mine.txtpb --nodes physics", on_the_workstation),
        ("palpate launch mine.txtpb --nodes device,mofc,viewer", at_the_bedside),
        ("cmake --build build/release", works),
        ("cmake --install build/release", works),
        ("cmake -B", works),
        ("cmake --build build/half_space", works),
        ("palpate conform physics", in_real_time(r"good  energy: closed paths give the hand no energy")),
    ]


def first_lesson(terminal: Terminal) -> list[tuple[str, Step]]:
    figures: dict[str, float] = {}

    def wall_is_tamed(terminal: Terminal, command: str) -> None:
        summary_of(figures, "tame")(terminal, command)
        holds(figures["wild energy"] < -100 and figures["tame energy"] >= 0, "only the wall without a clamp gives energy", figures)
        holds(figures["wild reversals"] >= figures["tame reversals"] > 0, "the clamp does not make a late wall tremble more", figures)
        columns, *rows = terminal.run("cat wild.csv", status=0)[1].split()
        holds(len(rows) == 10_000 and {"z_m", "fe_z", "fs_z"} <= set(columns.split(",")), "a row per millisecond", figures)
        # the question below them
        rates = re.search(r"`--set (physics.rate_hz)=(\d+)`, (\d+), (\d+)", (ROOT / "docs/first_lesson.md").read_text())
        if not rates:
            raise Broken("the question names no rates")
        wild = next(c for c in commands_of(ROOT / "docs/first_lesson.md") if "--csv wild.csv" in c)
        for rate in rates.groups()[1:]:
            asked = re.sub(r" --csv \S+", "", wild).replace("physics.rate_hz=50", f"physics.rate_hz={rate}")
            summary_of(figures, rate)(terminal, asked)
        counts = [figures[f"{rate} reversals"] for rate in rates.groups()[1:]]
        holds(counts == sorted(counts, reverse=True) and counts[0] > 0 == counts[-1], "faster walls are quieter", figures)

    def safety_has_a_price(terminal: Terminal, command: str) -> None:
        summary_of(figures, "held far")(terminal, command)
        holds(figures["held energy"] >= 0 and figures["held far energy"] >= 0, "both are passive", figures)
        holds(figures["held far transparency"] < 0.7 * figures["held transparency"], "transparency falls", figures)

    def description_arrives(terminal: Terminal, command: str) -> None:
        summary_of(figures, "described")(terminal, command)
        holds(figures["described transparency"] > 0.95, "the description of the tissue is not late", figures)

    def report(terminal: Terminal, command: str) -> None:
        terminal.run(command, status=0)
        html = terminal.run("cat far.html", status=0)[1]
        holds(all(word in html for word in ("ideal", "requested", "rendered")), "the report draws the three forces", {})
        terminal.run("palpate explain passive", status=0)

    return [
        ("palpate loopback", summary_of(figures, "wild")),
        ("palpate loopback", wall_is_tamed),
        ("palpate loopback", summary_of(figures, "held")),
        ("palpate loopback", safety_has_a_price),
        ("palpate loopback", description_arrives),
        ("palpate loopback", summary_of(figures, "recorded")),
        ("palpate report", report),
    ]


PAGES = {"first_device": first_device, "first_workstation": first_workstation, "first_lesson": first_lesson}


def check_order(name: str, commands: list[str]) -> None:
    """That each command of the page has its check here."""
    beginnings = [beginning for beginning, _ in SET_UP + PAGES[name](None)]  # type: ignore[arg-type]
    for i in range(max(len(commands), len(beginnings))):
        command = commands[i] if i < len(commands) else "(the page ends)"
        beginning = beginnings[i] if i < len(beginnings) else "(no further command)"
        if not command.startswith(beginning):
            raise Broken(f"docs/{name}.md, command {i + 1}: `{command}`: {Path(__file__).name} has checks for "
                         f"`{beginning}` there; change it with the page")


def follow(terminal: Terminal, steps: list[tuple[str, Step]], commands: list[str]) -> None:
    for (_, step), command in zip(steps, commands):
        print(f"  {command}", flush=True)
        step(terminal, command)


NAMESPACES = ["unshare", "--user", "--map-root-user", "--net", "--pid", "--fork", "--kill-child", "--mount-proc"]


def follow_here(build: Path, name: str) -> None:
    commands = commands_of(ROOT / f"docs/{name}.md")
    check_order(name, commands)
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        # a clone in which the build is done and the packages are installed
        (tree / "home").mkdir()
        (tree / "build").mkdir()
        (tree / "build/release").symlink_to(build)
        (tree / "deploy").mkdir()
        for source in (ROOT / "deploy").iterdir():
            if source.name != "packages.sh":
                (tree / "deploy" / source.name).symlink_to(source)
        (tree / "deploy/packages.sh").write_text("#!/bin/sh\n")
        (tree / "deploy/packages.sh").chmod(0o755)
        (tree / "physics_node").symlink_to(ROOT / "physics_node")
        terminal = Terminal(NAMESPACES, folder, f"{folder}/home", False, tree / "log")
        try:
            follow(terminal, SET_UP + PAGES[name](terminal), commands)
        finally:
            terminal.close()


def chroot(root: Path, network: bool) -> list[str]:
    return ["unshare", *([] if network else ["--net"]), "--pid", "--fork", "--kill-child", "--mount-proc",
            f"--root={root}"]


def follow_in_root(root: Path, tree: Path, names: list[str]) -> int:
    clone = root / "srv/palpate"
    clone.mkdir(parents=True)
    # as a clone has it
    files = subprocess.run(["git", "-C", tree, "ls-files", "-z"], check=True, capture_output=True).stdout
    subprocess.run(["cp", "--parents", "-P", *files.decode().rstrip("\0").split("\0"), clone], cwd=tree, check=True)
    certificates = Path("/etc/ssl/certs/ca-certificates.crt")  # for npm, where a proxy has its own
    if certificates.exists():
        (root / "etc/ssl/certs").mkdir(parents=True, exist_ok=True)
        shutil.copy(certificates, root / "etc/ssl/certs")
    for name in names:
        check_order(name, commands_of(tree / f"docs/{name}.md"))
    begin = time.monotonic()
    terminal = Terminal(chroot(root, True), "/srv/palpate", "/srv", True, root.parent / "set_up.log")
    set_up = commands_of(tree / f"docs/{names[0]}.md")[: len(SET_UP)]
    follow(terminal, SET_UP, set_up)
    terminal.run("apt-get install -qq --yes iproute2 procps > /dev/null 2>&1", status=0)  # Debian's installer brings them
    terminal.close()
    print(f"  ({(time.monotonic() - begin) / 60:.0f} min)")
    failed = 0
    for name in names:
        commands = commands_of(tree / f"docs/{name}.md")
        if commands[: len(SET_UP)] != set_up:
            raise Broken(f"docs/{name}.md does not begin like docs/{names[0]}.md: {commands[:len(SET_UP)]}")
        print(f"docs/{name}.md", flush=True)
        page = root.parent / name
        for part in ("upper", "work", "root"):
            (page / part).mkdir(parents=True)
        subprocess.run(["mount", "-t", "overlay", "overlay", "-o",
                        f"lowerdir={root},upperdir={page}/upper,workdir={page}/work", page / "root"], check=True)
        try:
            terminal = Terminal(chroot(page / "root", False), "/srv/palpate", "/srv", False, page / "log")
            try:
                works(terminal, set_up[-1])  # PATH, of this shell
                follow(terminal, PAGES[name](terminal), commands[len(SET_UP):])
            finally:
                terminal.close()
        except Broken as broken:
            print(f"docs/{name}.md: {broken}", file=sys.stderr)
            failed = 1
        finally:
            subprocess.run(["umount", "--lazy", page / "root"], check=False)
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path)
    parser.add_argument("--root", nargs=2, type=Path, metavar=("FOLDER", "TREE"))
    parser.add_argument("pages", nargs="+", choices=PAGES, metavar="PAGE")
    options = parser.parse_args()
    try:
        if options.root:
            return follow_in_root(options.root[0], options.root[1], options.pages)
        refused = subprocess.run([*NAMESPACES, "ip", "link", "set", "lo", "up"], capture_output=True, text=True, check=False)
        if refused.returncode != 0:
            print(f"Skipped: no namespaces of its own: {refused.stderr.strip()}")
            return 77
        for name in options.pages:
            print(f"docs/{name}.md")
            follow_here(options.build.resolve(), name)
    except Broken as broken:
        print(broken, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
