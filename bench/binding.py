#!/usr/bin/env python3
"""binding.py: how long calls of the Python package take besides the library's own work, on a sheet of 4 nodes, for which that is next to nothing.
The least of 20 repetitions. Run: PYTHONPATH=build/python DRAPE_LIBRARY=build/src/libdrape.so.1 python3 bench/binding.py"""
import time

import drape
import numpy as np
from drape._library import lib

sheet = {"mesh": {"grid": "square", "columns": 2, "rows": 2, "width": 1, "height": 1},
         "material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "drag.wind"], "pins": [{"corner": "top-left"}]}
ball = {"type": "sphere", "name": "ball", "center": [0, -9, 0], "radius": 0.1}
sim = drape.Sim({"drape": 1, "duration": 1, "cloth": [sheet], "colliders": [ball]})
sim.advance(0.1)
address, out = sim._address, np.empty((4, 3))  # pylint: disable=protected-access
forces, here = np.zeros((4, 3)), sim.positions[0].copy()
CALLS = {
    "time": (lambda: sim.time, lambda: lib.drape_sim_time(address)),
    "positions": (lambda: sim.positions, lambda: lib.drape_sim_positions(address)),
    "energy": (lambda: sim.energy, lambda: lib.drape_sim_energy(address)),
    "statistics": (lambda: sim.statistics, lambda: lib.drape_sim_statistics(address)),
    "reactions": (lambda: sim.reactions, lambda: lib.drape_sim_reactions(address, out.ctypes.data)),
    "normals": (lambda: sim.normals, lambda: lib.drape_sim_normals(address, out.ctypes.data)),
    "push": (lambda: sim.push(forces), lambda: lib.drape_sim_push(address, forces.ctypes.data)),
    "move_pins": (lambda: sim.move_pins(0, here, 1.0), None),
    "move_collider": (lambda: sim.move_collider("ball", [0, 0, 0], 1.0), None),
    "advance, without a step": (lambda: sim.advance(0.05), lambda: lib.drape_sim_advance(address, 0.05)),
}


def least(function, calls=500):
    """[us] a call."""
    times = []
    for _ in range(20):
        start = time.perf_counter()
        for _ in range(calls):
            function()
        times.append((time.perf_counter() - start) / calls)
    return 1e6 * min(times)


print("call, us, us by ctypes alone")
for name, (call, plain) in CALLS.items():
    print(f"{name}, {least(call):.2f}, {least(plain):.2f}" if plain else f"{name}, {least(call):.2f},")

# What an observer costs a step: the same steps with and without one.
def steps(observed):
    other = drape.Sim({"drape": 1, "duration": 1, "cloth": [sheet], "integrator": {"method": "verlet", "dt": 1e-3, "substeps": 1}, "frame_rate": 1})
    if observed:
        other.observe(lambda event: None, drape.EventKind.ATTEMPT)
    start = time.perf_counter()
    other.advance(2.0)
    return 1e6 * (time.perf_counter() - start) / other.statistics.steps_accepted


print(f"a step with an observer, {min(steps(True) for _ in range(5)):.2f}, without {min(steps(False) for _ in range(5)):.2f}")
