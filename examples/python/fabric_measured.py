# %% [markdown]
# # A fabric beside its measurements
#
# The cantilever test of ASTM D1388: a strip that overhangs by twice its bending length c = (B / (rho g))^(1/3) hangs so that the chord from the edge to
# the tip makes 41.5 degrees with the horizontal. The strips are simulated with the measured areal density and bending stiffness of four fabrics
# (Wang, O'Brien & Ramamoorthi 2011), as `drape list fabrics` shows them.

# %%
import numpy as np

import drape

g = 9.81
measured = {  # areal density rho [kg/m2], bending stiffness B along the warp [N m]
    "wang2011_denim": (0.324, 16.0e-6), "wang2011_pants": (0.220, 31.4e-6), "wang2011_jacket": (0.113, 3.57e-6), "wang2011_tshirt": (0.187, 5.80e-6)}


def strip(fabric, length):
    """The equilibrium of a strip that overhangs by a length [m] along +x, clamped at x = 0."""
    along = {"warp_direction": [1, 0, 0]}
    return drape.Sim({
        "drape": 1, "duration": 1, "gravity": [0, -g, 0], "integrator": {"method": "static", "tolerance": 1e-10},
        "cloth": [{"mesh": {"grid": "irregular", "columns": 21, "rows": 4, "width": length, "height": 0.1 * length}, "material": {"fabric": fabric},
                   "terms": [{"type": "stretch.cst", **along}, {"type": "bend.midedge", **along}], "pins": [{"edge": "left", "clamp": True}]}]})


angles = {}
for fabric, (rho, B) in measured.items():
    length = 2 * (B / (rho * g)) ** (1 / 3)
    sim = strip(fabric, length)
    sim.advance(1)
    x, y, _ = sim.positions[sim.model.rest_positions[:, 0] > 0.999 * length].mean(axis=0)
    angles[fabric] = np.degrees(np.arctan2(-y, x))
    print(f"{fabric}: bending length {100 * length / 2:.2f} cm, chord at {angles[fabric]:.2f} degrees, expected 41.5")
print("all within half a degree:", all(abs(angle - 41.5) < 0.5 for angle in angles.values()))
# prints: all within half a degree: True

# %% [markdown]
# The same for tension: every fabric that Drape knows, as `drape validate fabric_tension` measures it: how much a strip of 1 m lengthens.

# %%
cases = drape.validate("fabric_tension")
expected, obtained = np.asarray(cases["expected"]), np.asarray(cases["obtained"])
print(f"{len(expected)} fabrics, the largest deviation is {100 * abs(obtained / expected - 1).max():.2f} %")

# %%
import matplotlib.pyplot as plt

ax = plt.figure(constrained_layout=True).add_subplot()
ax.bar(range(1, len(expected) + 1), 100 * (obtained / expected - 1))
ax.set(xlabel="fabric, by its place in `drape list fabrics`", ylabel="lengthening, simulated over measured, minus 1 [%]")
