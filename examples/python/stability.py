# %% [markdown]
# # Where is an integrator stable?
#
# A sheet of 36 nodes swings from two corners. Backward Euler takes any step. Velocity Verlet explodes above 2 / omega, where omega is the largest
# frequency of the sheet (Hairer, Lubich & Wanner, Geometric Numerical Integration, I.5), which grows with the square root of the stiffness.

# %%
import numpy as np

import drape

scene = drape.Scene({
    "drape": 1, "duration": 0.3,
    "cloth": [{"mesh": {"grid": "square", "columns": 6, "rows": 6, "width": 0.5, "height": 0.5},
               "material": {"young_modulus": 1e5, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge"],
               "pins": [{"corner": "top-left"}, {"corner": "top-right"}]}]})

# %% [markdown]
# One run each, in memory: what becomes of the energy that the sheet has at the start?

# %%
runs = {dt: drape.run(scene, {"/integrator/dt": dt}) for dt in (1e-3, 5e-3, 20e-3)}
for dt, run in runs.items():
    print(f"be, dt = {1e3 * dt:4.1f} ms: the method took {np.asarray(run.energy['numerical'])[-1]:.4f} J")
ax = drape.plot.energy(runs[5e-3])

# %% [markdown]
# A map over the step and the stiffness: 2 integrators, 6 x 3 cases. The limit of Verlet goes with 1 / sqrt(E).

# %%
table = drape.stability(scene, {"/integrator/dt": (2e-4, 2e-2, "6log"), "/cloth/0/material/young_modulus": (1e4, 1e6, "3log")}, integrators=["be", "verlet"])
columns = {name: np.asarray(table[name]) for name in table}
for stiffness in sorted(set(columns["/cloth/0/material/young_modulus"])):
    mine = (columns["integrator"] == "verlet") & (columns["/cloth/0/material/young_modulus"] == stiffness)
    stable = columns["/integrator/dt"][mine & (columns["status"] == "ok")].max()
    limit = columns["explicit_limit_s"][mine].min()
    print(f"E = {stiffness:7.0f} Pa: verlet ran at {1e3 * stable:.2f} ms; its limit is {1e3 * limit:.2f} ms")
print("be ran everywhere:", bool((columns["status"][columns["integrator"] == "be"] == "ok").all()))
# prints: be ran everywhere: True

# %%
drape.plot.stability(table, "/integrator/dt", "/cloth/0/material/young_modulus", "verlet")
