#!/usr/bin/env python3
"""check.py FOLDER: integrates the scene that `drape ivp export examples/ivp/swing.json --out FOLDER` wrote, by code
that shares nothing with Drape, and writes FOLDER/positions.npy, to be judged by `drape ivp score`.

The sheet has stretching of its edges and weight alone: m a = m g - grad E, E the sum over edges of
k/2 (l/L - 1)^2, k = E h (A1 + A2), with L the length and A1, A2 the areas of the triangles beside it at rest.
There is no velocity in the forces, so x'' = a(x) is integrated by Stoermer's rule, extrapolated (Hairer, Norsett &
Wanner 1993, Solving Ordinary Differential Equations I, II.14), with steps by the error that the last two
extrapolations show. Python alone: nothing is imported but the standard library.
"""
import csv
import json
import math
import re
import struct
import sys

ORDERS = 8  # columns of the extrapolation: order 16
TOLERANCE = 1e-12  # [m] of a step


def read(folder):
    """Nodes, masses, pins, triangles, E h, gravity, times."""
    with open(folder + "/nodes.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with open(folder + "/start.obj", encoding="utf-8") as file:
        lines = [line.split() for line in file]
    with open(folder + "/times.csv", encoding="utf-8") as file:
        times = [float(row["time_s"]) for row in csv.DictReader(file)]
    with open(folder + "/scene.json", encoding="utf-8") as file:
        scene = json.loads(re.sub(r"^\s*//.*$", "", file.read(), flags=re.M))
    nodes = [[float(word) for word in line[1:4]] for line in lines if line and line[0] == "v"]
    faces = [[int(word.split("/")[0]) - 1 for word in line[1:4]] for line in lines if line and line[0] == "f"]
    cloth = scene["cloth"][0]
    assert cloth["terms"] == ["stretch.edge"], "this program has the forces of stretch.edge and gravity only"
    stiffness = cloth["material"]["young_modulus"] * cloth["material"]["thickness"]
    return (nodes, [float(row["mass_kg"]) for row in rows], [row["pinned"] == "1" for row in rows], faces, stiffness,
            scene["gravity"], times)


def edges_of(nodes, faces, stiffness):
    """(a, b, L, k) of every edge."""
    shares = {}
    for a, b, c in faces:
        u, v = ([nodes[i][k] - nodes[a][k] for k in range(3)] for i in (b, c))
        area = 0.5 * math.sqrt((u[1] * v[2] - u[2] * v[1]) ** 2 + (u[2] * v[0] - u[0] * v[2]) ** 2
                               + (u[0] * v[1] - u[1] * v[0]) ** 2)
        for edge in ((a, b), (b, c), (c, a)):
            key = tuple(sorted(edge))
            shares[key] = shares.get(key, 0) + area
    return [(a, b, math.dist(nodes[a], nodes[b]), stiffness * area) for (a, b), area in shares.items()]


def make_acceleration(edges, masses, pinned, gravity):
    weights = [0.0 if pin else 1 / mass for pin, mass in zip(pinned, masses)]
    rest = [g * (w > 0) for w in weights for g in gravity]
    springs = [(3 * a, 3 * b, 1 / length, k / length, weights[a], weights[b]) for a, b, length, k in edges]
    sqrt = math.sqrt

    def acceleration(x):
        a = rest[:]
        for i, j, inverse, k, wi, wj in springs:
            dx, dy, dz = x[j] - x[i], x[j + 1] - x[i + 1], x[j + 2] - x[i + 2]
            length = sqrt(dx * dx + dy * dy + dz * dz)
            pull = k * (length * inverse - 1) / length  # the force over the length
            dx, dy, dz = pull * dx, pull * dy, pull * dz
            a[i] += wi * dx
            a[i + 1] += wi * dy
            a[i + 2] += wi * dz
            a[j] -= wj * dx
            a[j + 1] -= wj * dy
            a[j + 2] -= wj * dz
        return a

    return acceleration


def stoermer(acceleration, x, v, a, step, parts):
    """x and v after a step in so many parts."""
    h = step / parts
    delta = [h * (p + 0.5 * h * q) for p, q in zip(v, a)]
    y = [p + d for p, d in zip(x, delta)]
    for _ in range(parts - 1):
        delta = [d + h * h * q for d, q in zip(delta, acceleration(y))]
        y = [p + d for p, d in zip(y, delta)]
    return y + [d / h + 0.5 * h * q for d, q in zip(delta, acceleration(y))]


def extrapolated(acceleration, x, v, step):
    """x and v after a step, and how far the last two extrapolations are apart."""
    a = acceleration(x)
    rows = []
    for j in range(ORDERS):
        row = [stoermer(acceleration, x, v, a, step, j + 1)]
        for k in range(j):
            factor = 1 / (((j + 1) / (j - k)) ** 2 - 1)
            row.append([p + factor * (p - q) for p, q in zip(row[k], rows[-1][k])])
        rows.append(row)
    best, other = rows[-1][-1], rows[-1][-2]
    return best[:len(x)], best[len(x):], max(abs(p - q) for p, q in zip(best[:len(x)], other))


def integrate(acceleration, x, v, times):
    t, h = 0.0, times[0] / 8
    for end in times:
        while t < end:
            step = end - t if end - t < 1.01 * h else min(h, 0.5 * (end - t))
            y, w, error = extrapolated(acceleration, x, v, step)
            if error <= TOLERANCE:
                x, v, t = y, w, end if step == end - t else t + step
            factor = 0.9 * (TOLERANCE / max(error, 1e-30)) ** (1 / (2 * ORDERS - 1))
            if error > TOLERANCE or step > 0.7 * h:
                h = step * min(2, max(0.2, factor))
        yield x


def write(path, frames, nodes):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({len(frames)}, {nodes}, 3), }}"
    head = head.ljust(117) + "\n"
    with open(path, "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode())
        for frame in frames:
            file.write(struct.pack(f"<{len(frame)}d", *frame))


def main(folder):
    nodes, masses, pinned, faces, stiffness, gravity, times = read(folder)
    acceleration = make_acceleration(edges_of(nodes, faces, stiffness), masses, pinned, gravity)
    x = [c for node in nodes for c in node]
    frames = list(integrate(acceleration, x, [0.0] * len(x), times))
    write(folder + "/positions.npy", frames, len(nodes))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
