"""read_numpy.py FOLDER [y|z [killed]]: compares all formats of a run with its positions.npy or,
if there are render meshes, render_positions.npy. Exit 77: no numpy.

z: frames have z up. killed: formats may be one frame apart, as they are written one after another.
"""
import glob
import json
import os
import struct
import sys

try:
    import numpy as np
except ImportError:
    sys.exit(77)

folder = sys.argv[1]
z_up = sys.argv[2:3] == ["z"]
killed = sys.argv[3:4] == ["killed"]
x = np.load(folder + "/positions.npy")
if os.path.exists(folder + "/render_positions.npy"):  # what the other formats have
    nodes = x
    x = np.load(folder + "/render_positions.npy")
    assert len(x) == len(nodes) and x.shape != nodes.shape
assert x.dtype == np.float64 and x.ndim == 3 and x.shape[2] == 3 and np.isfinite(x).all() and len(x) > 2, x.shape
turned = np.stack([x[..., 0], -x[..., 2], x[..., 1]], axis=-1) if z_up else x


def frames_of(count):
    assert count == len(x) or (killed and abs(count - len(x)) <= 1), (count, len(x))
    return min(count, len(x))


def triangles_of_obj(path):
    with open(path, encoding="ascii") as file:
        lines = [line.split() for line in file]
    nodes = np.array([[float(word) for word in line[1:]] for line in lines if line and line[0] == "v"])
    return nodes, np.array([[int(word) - 1 for word in line[1:]] for line in lines if line and line[0] == "f"])


paths = sorted(glob.glob(folder + "/frame_*.obj"))
for k in range(frames_of(len(paths))):
    nodes, triangles = triangles_of_obj(paths[k])
    assert (nodes == turned[k]).all(), paths[k]

paths = sorted(glob.glob(folder + "/frame_*.ply"))
for k in range(frames_of(len(paths))):
    with open(paths[k], "rb") as file:
        data = file.read()
    start = data.index(b"end_header\n") + 11
    assert (np.frombuffer(data, "<f8", x.shape[1] * 3, start).reshape(-1, 3) == turned[k]).all(), paths[k]
    faces = np.frombuffer(data, np.dtype([("n", "u1"), ("node", "<i4", 3)]), offset=start + x.shape[1] * 24)
    assert (faces["n"] == 3).all() and (faces["node"] == triangles).all()

with open(folder + "/positions.pc2", "rb") as file:
    data = file.read()
magic, version, points, start, step, samples = struct.unpack("<12siiffi", data[:32])
assert (magic, version, points, start, step) == (b"POINTCACHE2\0", 1, x.shape[1], 0, 1), data[:32]
count = frames_of(samples)
cache = np.frombuffer(data, "<f4", samples * points * 3, 32).reshape(samples, points, 3)
assert (cache[:count] == turned[:count].astype(np.float32)).all()
nodes, mesh = triangles_of_obj(folder + "/positions.obj")
assert (nodes == turned[0]).all() and (mesh == triangles).all()

with open(folder + "/positions.glb", "rb") as file:
    data = file.read()
assert data[:8] == b"glTF\2\0\0\0" and struct.unpack("<I", data[8:12])[0] == len(data)
length = struct.unpack("<I", data[12:16])[0]
gltf = json.loads(data[20:20 + length])
binary = data[28 + length:]


def accessor(index):
    one = gltf["accessors"][index]
    view = gltf["bufferViews"][one["bufferView"]]
    assert view.get("byteStride", 12) == 12
    kind, width = {5126: ("<f4", 4), 5125: ("<u4", 4)}[one["componentType"]], {"VEC3": 3, "SCALAR": 1}[one["type"]]
    found = np.frombuffer(binary, kind[0], one["count"] * width, view.get("byteOffset", 0) + one.get("byteOffset", 0))
    found = found.reshape(-1, width)
    if "min" in one:
        assert (found.min(0) == np.float32(one["min"])).all() and (found.max(0) == np.float32(one["max"])).all(), one
    return found


primitive = gltf["meshes"][0]["primitives"][0]
base = accessor(primitive["attributes"]["POSITION"])
targets = [accessor(target["POSITION"]) for target in primitive["targets"]]
count = frames_of(len(targets) + 1)
assert (base == x[0].astype(np.float32)).all()
assert (accessor(primitive["indices"]).reshape(-1, 3) == triangles).all()
# Rounding of the displacement to float32; the sum with the base is exact here.
for k in range(1, count):
    error = np.abs(base.astype(float) + targets[k - 1] - x[k])
    assert (error <= 2.0**-24 * np.abs(targets[k - 1]) + 1e-30).all(), (k, error.max())
# Normals are means over the triangles around a node, weighted by area; a morph target has the difference from the first frame. Three roundings
    # to float32.
upright = accessor(primitive["attributes"]["NORMAL"])
leaning = [accessor(target["NORMAL"]) for target in primitive["targets"]]
assert len(leaning) == len(targets)
for k in range(count):
    a, b, c = (x[k][triangles[:, i]] for i in range(3))
    normal = np.zeros_like(x[k])
    for i in range(3):
        np.add.at(normal, triangles[:, i], np.cross(b - a, c - a))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    found = upright.astype(float) + (leaning[k - 1] if k else 0)
    assert np.abs(found - normal).max() < 3 * 2.0**-24, (k, np.abs(found - normal).max())
if not killed:
    sampler = gltf["animations"][0]["samplers"][0]
    times, weights = accessor(sampler["input"])[:, 0], accessor(sampler["output"]).reshape(count, count - 1)
    with open(folder + "/energy.csv", encoding="ascii") as file:
        wanted = [float(line.split(",")[1]) for line in file.readlines()[1:]]
    assert (times == np.float32(wanted)).all(), (times, wanted)
    assert (weights == np.eye(count)[:, 1:]).all()
