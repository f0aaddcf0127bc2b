"""host.py: a sheet drapes over a ball that this program moves, in real time. Run: python3 host.py [FRAMES]"""
import ctypes as c, math, sys, time
import numpy as np

SCENE = b"""{"drape": 1, "cloth": [{"mesh": {"grid": "square", "columns": 20, "rows": 20, "width": 1, "height": 1},
    "material": {"young_modulus": 1e5, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge"]}],
  "colliders": [{"type": "sphere", "center": [0.5, -0.25, -0.5], "radius": 0.2, "friction": 0.5}],
  "integrator": {"method": "newton_k"}, "duration": 5}"""
lib, ctx, scene, model, sim = c.CDLL("libdrape.so.1"), c.c_void_p(), c.c_void_p(), c.c_void_p(), c.c_void_p()
lib.drape_context_message.restype = c.c_char_p
lib.drape_sim_positions.restype = c.POINTER(c.c_double)

def call(name, *arguments):
    if getattr(lib, "drape_" + name)(*arguments):
        sys.exit(lib.drape_context_message(ctx).decode())

call("context_create", None, c.byref(ctx))
call("scene_parse", ctx, SCENE, b"scene", c.byref(scene))
call("scene_compile", scene, c.byref(model))
call("sim_create", ctx, model, None, c.byref(sim))
frame, a, w, start = 1 / 60, 0.1, 3, time.perf_counter()
report = (c.c_double * 20)()  # memory for a drape_realtime, which begins with the time and the debt
for k in range(1, int(sys.argv[1]) + 1 if len(sys.argv) > 1 else 301):
    t, vector = k * frame, c.c_double * 3
    call("sim_move_collider", sim, 0, c.c_double(frame + report[1]), vector(a * math.sin(w * t)), vector(a * w * math.cos(w * t)))
    call("sim_advance_realtime", sim, c.c_double(frame), c.c_double(0.8 * frame), report)
    x = np.ctypeslib.as_array(lib.drape_sim_positions(sim), (lib.drape_model_node_count(model), 3))  # a view, no copy
    if k % 30 == 0: print(f"t {t:.2f} s: {x[:, 1].min():.3f} m to {x[:, 1].max():.3f} m high")
    time.sleep(max(0, start + t - time.perf_counter()))
