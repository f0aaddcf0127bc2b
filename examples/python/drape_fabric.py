# %% [markdown]
# # Draping a fabric over a ball
#
# A measured denim (Wang, O'Brien & Ramamoorthi 2011) falls on a ball and comes to rest. `stretch.cst` and `bend.midedge` take their stiffnesses
# from the fabric.

# %%
import numpy as np

import drape

scene = drape.Scene({
    "drape": 1, "duration": 0.6, "frame_rate": 30,
    "cloth": [{"name": "cloth", "mesh": {"grid": "square", "columns": 11, "rows": 11, "width": 0.5, "height": 0.5,
                                         "transform": {"translate": [-0.25, 0.22, 0.25]}},
               "material": {"fabric": "wang2011_denim"},
               "terms": ["stretch.cst", "bend.midedge", {"type": "drag.viscous", "coefficient": 0.5}]}],
    "colliders": [{"type": "sphere", "name": "ball", "center": [0, 0, 0], "radius": 0.2, "friction": 0.4}],
    "contact": {"distance": 0.01}, "integrator": {"method": "be", "dt": 0.01, "tolerance": 1e-5}})
sim = drape.Sim(scene)

# %% [markdown]
# Each frame, the force on the ball. Once the cloth has come to rest, that is its weight.

# %%
force = np.array([-sim.collider_force("ball")[1] if frame.index else 0 for frame in sim.frames()])
weight = 9.81 * sim.masses.sum()
print(f"weight {weight:.3f} N, force on the ball at the end {-sim.collider_force('ball')[1]:.3f} N")
print("cloth in the ball:", sim.inside("ball")[0], "triangles; through itself:", sim.intersections(), "edges")
# prints: cloth in the ball: 0 triangles; through itself: 0 edges

# %%
drape.plot.cloth(sim, values=sim.strain[:, 0], label="larger principal strain [1]")

# %% [markdown]
# Softer bending, without losing the state: the material of a running sim may change.

# %%
before = sim.positions[:, 1].min()
scene["/cloth/0/material/fabric"] = "wang2011_tshirt"
sim.change(scene)
sim.advance(0.8)
print(f"lowest point: denim {before:.3f} m, then a T-shirt's fabric {sim.positions[:, 1].min():.3f} m")
drape.plot.cloth(sim)
