#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Physics in SOFA (SofaPython3) for `palpate launch`: physics { command: ["./sofa_physics.py", "scene.py"] }.

NOT RUN WITH SOFA HERE: Debian 12 has no SOFA. Tested against a stub of the calls that it makes.

The scene is a Python file with createScene(root), as for runSofa. It needs two MechanicalObjects of
template Rigid3d, both named `state`: in root.goal, without mass, where this program writes the pose of the
tool, and in root.tool, with a small mass, collision models, and a RestShapeSpringsForceField whose
external_rest_shape is @/goal/state: the virtual coupling [Colgate95]. The force on the tool is that of the
coupling, so any contact method of SOFA serves. The file may define

    METRE = 1000.0               lengths of the scene in one metre; default 1
    COUPLING_NEWTON_PER_M = 300  must be the `stiffness` of that force field, in N/m; default 300
    SURFACES = ["tissue.visual"] names of objects with `position` and `triangles`, for the viewers; default none

The scene steps by 1 / physics.rate_hz, in seconds. A contact model is estimated from the force.
"""
import functools
import importlib.util
import sys
from types import ModuleType
from typing import Any

import numpy as np
import Sofa  # type: ignore[import-not-found]
import Sofa.Core  # type: ignore[import-not-found]
import Sofa.Simulation  # type: ignore[import-not-found]

import palpate


def load(file: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location("scene", file)
    if spec is None or spec.loader is None:
        raise palpate.SetupError(f"{file}: no Python file; give the scene")
    scene = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(scene)
    except OSError as error:
        raise palpate.SetupError(f"{file}: {error.strerror}; give the scene") from error
    if not hasattr(scene, "createScene"):
        raise palpate.SetupError(f"{file}: no createScene(root); define it")
    return scene


def find(root: Any, path: str) -> Any:
    try:
        return functools.reduce(getattr, path.split("."), root)
    except AttributeError as error:
        raise palpate.SetupError(f"the scene has no {path}; add it (see the head of {__file__})") from error


def main() -> None:
    if len(sys.argv) != 2:
        raise palpate.SetupError("takes one scene; give a Python file with createScene(root)")
    scene = load(sys.argv[1])
    metre = float(getattr(scene, "METRE", 1.0))
    stiffness = float(getattr(scene, "COUPLING_NEWTON_PER_M", 300.0))
    root = Sofa.Core.Node("root")
    scene.createScene(root)
    # the name of newer versions, and that of older ones
    getattr(Sofa.Simulation, "initRoot", getattr(Sofa.Simulation, "init", None))(root)
    goal = find(root, "goal.state").position
    tool = find(root, "tool.state").position
    meshes = [find(root, name) for name in getattr(scene, "SURFACES", [])]
    surfaces = [
        palpate.Surface(mesh.getName(), mesh.position.array() / metre, mesh.triangles.array()) for mesh in meshes
    ]
    with palpate.Physics(surfaces=surfaces) as physics:
        for motion in physics:
            w, x, y, z = motion.orientation
            with goal.writeableArray() as pose:
                pose[0] = [*(metre * motion.position), x, y, z, w]
            Sofa.Simulation.animate(root, 1.0 / physics.rate_hz)
            lag = np.asarray(tool.array())[0, :3] / metre - motion.position
            for i, mesh in enumerate(meshes):
                physics.show(i, mesh.position.array() / metre)
            physics.reply(force=stiffness * lag)


palpate.run(main)
