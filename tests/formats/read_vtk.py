"""read_vtk.py FOLDER [y|z [killed|alone|shows SIMULATED]]: checks frames with VTK's own readers. Exit 77: no VTK.

z: frames have z up. killed: the collection may have one frame more or less than positions.npy. alone: there is no other format.
shows: frames have a render mesh; the folder SIMULATED is of the same run without it.
"""
import csv
import glob
import os
import sys
import xml.etree.ElementTree

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
except ImportError:
    sys.exit(77)

folder = sys.argv[1]
z_up = sys.argv[2:3] == ["z"]
how = sys.argv[3] if len(sys.argv) > 3 else ""
files = sorted(glob.glob(folder + "/frame_*.vtp"))


class Errors:
    """Counts the errors and warnings of a reader: VTK only prints them on stderr and continues."""
    def __init__(self, reader):
        self.count = 0
        for event in "ErrorEvent", "WarningEvent":
            reader.AddObserver(event, self)

    def __call__(self, caller, event):
        self.count += 1


def read(reader, path):
    reader.SetFileName(path)
    errors = Errors(reader)
    reader.Update()
    assert errors.count == 0, path
    return reader.GetOutput()


def fields(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


entries = xml.etree.ElementTree.parse(folder + "/frames.pvd").getroot().findall("Collection/DataSet")
names = [entry.get("file") for entry in entries]
times = [float(entry.get("timestep")) for entry in entries]
assert names == [os.path.basename(path) for path in files[:len(names)]] and len(files) - len(names) <= (how == "killed"), names
assert len(names) > 2 and all(a < b for a, b in zip(times, times[1:])), times
with open(folder + "/energy.csv", encoding="ascii", newline="") as file:
    energies = list(csv.DictReader(file))
x = None if how == "alone" else np.load(folder + ("/render_positions.npy" if how == "shows" else "/positions.npy"))



def carriers(points, triangles, at):
    """Weights (places x triangles x 3) of the corners of a triangle at each place, projected onto it; and which triangles it lies in."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    edges = np.stack([b - a, c - a], axis=-1)
    inverse = np.linalg.inv(edges.transpose(0, 2, 1) @ edges) @ edges.transpose(0, 2, 1)
    within = np.einsum("tij,ptj->pti", inverse, at[:, None, :] - a[None])
    weights = np.concatenate([1 - within.sum(axis=-1, keepdims=True), within], axis=-1)
    off = at[:, None, :] - np.einsum("pti,itj->ptj", weights, np.stack([a, b, c]))
    return weights, (weights.min(axis=-1) > -1e-9) & (np.linalg.norm(off, axis=-1) < 0.02)


def check_carried(name, mesh):
    """Strains are those of a triangle that carries the first corner, other fields are interpolated in one that carries the vertex."""
    simulated = read(vtk.vtkXMLPolyDataReader(), f"{sys.argv[4]}/{name}")
    corners = vtk_to_numpy(simulated.GetPolys().GetData()).reshape(-1, 4)[:, 1:]
    nodes, elements = fields(simulated.GetPointData()), fields(simulated.GetCellData())
    weights, holds = carriers(start, corners, first)
    assert holds.any(axis=1).all()
    shown = fields(mesh.GetCellData())
    first_corner = vtk_to_numpy(mesh.GetPolys().GetData()).reshape(-1, 4)[:, 1]
    for strain in "strain_max", "strain_min":
        assert ((shown[strain][:, None] == elements[strain][None]) & holds[first_corner]).any(axis=1).all(), (name, strain)
    for field in "energy_density", "velocity":
        at_nodes, at_vertices = (np.asarray(f[field], float).reshape(len(f[field]), -1) for f in (nodes, fields(mesh.GetPointData())))
        error = np.abs(np.einsum("pti,tic->ptc", weights, at_nodes[corners]) - at_vertices[:, None]).max(axis=-1)
        assert np.where(holds, error, np.inf).min(axis=1).max() <= 1e-5 * np.abs(at_nodes).max() + 1e-12, (name, field)  # float32


if how == "shows":
    start = vtk_to_numpy(read(vtk.vtkXMLPolyDataReader(), f"{sys.argv[4]}/{names[0]}").GetPoints().GetData())
first = None
for k, name in enumerate(names):
    mesh = read(vtk.vtkXMLPolyDataReader(), folder + "/" + name)
    points = vtk_to_numpy(mesh.GetPoints().GetData())
    cells = vtk_to_numpy(mesh.GetPolys().GetData()).reshape(-1, 4)
    assert points.dtype == np.float64 and (cells[:, 0] == 3).all()
    assert mesh.GetFieldData().GetArray("TimeValue").GetValue(0) == times[k]
    triangles = cells[:, 1:]
    at_points, at_cells = fields(mesh.GetPointData()), fields(mesh.GetCellData())
    back = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=-1) if z_up else points  # y up
    if first is None:
        first = back
    if x is not None and k < len(x):
        assert (back == x[k]).all(), name
    assert set(at_cells["cloth"]) == {0, 1} and at_points["pinned"].sum() == 2
    if how == "shows":
        check_carried(name, mesh)
        continue

    # Strain from its definition: F'F in the basis of the triangle's edges at rest; the first frame is at rest.
    def edges(p):
        return np.stack([p[triangles[:, 1]] - p[triangles[:, 0]], p[triangles[:, 2]] - p[triangles[:, 0]]], axis=-1)
    rest, now = edges(first), edges(back)
    metric = np.linalg.solve(rest.transpose(0, 2, 1) @ rest, now.transpose(0, 2, 1) @ now)
    stretch = np.sqrt(np.sort(np.linalg.eigvals(metric).real, axis=1))
    assert np.abs(at_cells["strain_max"] - (stretch[:, 1] - 1)).max() < 1e-6, name  # rounding to float32
    assert np.abs(at_cells["strain_min"] - (stretch[:, 0] - 1)).max() < 1e-6, name

    # The total energy is that in the row of energy.csv for the frame.
    area = np.linalg.norm(np.cross(rest[..., 0], rest[..., 1]), axis=1) / 2
    node_area = np.zeros(len(points))
    for corner in range(3):
        np.add.at(node_area, triangles[:, corner], area / 3)
    if k < len(energies):
        elastic = float(energies[k]["elastic"])
        for total in (at_points["energy_density"] * node_area).sum(), (at_cells["energy_density"] * area).sum():
            assert abs(total - elastic) <= 1e-5 * elastic + 1e-12, (name, total, elastic)

# Velocities: backward Euler's at step times are differences of positions; between frames they agree to first order.
if x is not None and how != "killed":
    velocity = []
    for name in names:
        mesh = read(vtk.vtkXMLPolyDataReader(), folder + "/" + name)
        v = fields(mesh.GetPointData())["velocity"]
        velocity.append(np.stack([v[:, 0], v[:, 2], -v[:, 1]], axis=-1) if z_up else v)
    velocity = np.array(velocity)
    for k in range(1, len(names)):
        h = times[k] - times[k - 1]
        mean, change = (x[k] - x[k - 1]) / h, np.abs(velocity[k] - velocity[k - 1]).max()
        assert np.abs((velocity[k] + velocity[k - 1]) / 2 - mean).max() < 0.5 * change + 0.1, (k, change)
    assert np.abs(velocity[0][0]).max() == 0 and (how == "shows" or np.abs(velocity[0][1] - [0.3, 0, -0.2]).max() < 1e-7)

if how in ("", "shows"):
    turned = np.stack([x[..., 0], -x[..., 2], x[..., 1]], axis=-1) if z_up else x
    for make, ending in (vtk.vtkPLYReader, "ply"), (vtk.vtkOBJReader, "obj"):
        for k in 0, len(x) - 1:
            mesh = read(make(), f"{folder}/frame_{k:06d}.{ending}")
            assert (vtk_to_numpy(mesh.GetPoints().GetData()) == turned[k].astype(np.float32)).all(), (ending, k)
            found = vtk_to_numpy(mesh.GetPolys().GetData()).reshape(-1, 4)[:, 1:]
            assert (found == triangles).all(), (ending, k)
