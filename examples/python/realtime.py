"""realtime.py: a sheet drapes over a ball that this program moves, in real time. Run: python3 realtime.py [FRAMES]"""
import math
import sys
import time

import drape

sheet = {"mesh": {"grid": "square", "columns": 20, "rows": 20, "width": 1, "height": 1},
         "material": {"young_modulus": 1e5, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge"]}
ball = {"type": "sphere", "name": "ball", "center": [0.5, -0.25, -0.5], "radius": 0.2, "friction": 0.5}
sim = drape.Sim({"drape": 1, "cloth": [sheet], "colliders": [ball], "integrator": {"method": "newton_k"}, "duration": 5})

frame, a, w, debt, start = 1 / 60, 0.1, 3, 0.0, time.perf_counter()
for k in range(1, int(sys.argv[1]) + 1 if len(sys.argv) > 1 else 61):
    t = k * frame
    sim.move_collider("ball", [a * math.sin(w * t), 0, 0], frame + debt, velocity=[a * w * math.cos(w * t), 0, 0])
    debt = sim.advance_realtime(frame, 0.8 * frame).debt
    if k % 30 == 0:
        y = sim.positions[:, 1]  # the library's own memory, no copy
        print(f"t {t:.2f} s: {y.min():.3f} m to {y.max():.3f} m high")
    time.sleep(max(0, start + t - time.perf_counter()))
