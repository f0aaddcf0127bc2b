"""Plots by matplotlib, which is imported at the first call. Each function draws into `ax`, or into a figure of its own, and returns the axes."""
from typing import Any, Optional, Sequence, Union

import numpy as np

from .mesh import Mesh
from .runs import Run
from .sim import Sim


def _axes(ax: Any, **options: Any) -> Any:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt
    return plt.figure(figsize=(6, 4), constrained_layout=True).add_subplot(**options)


def energy(run: Union[Run, Any], which: Union[str, Sequence[str]] = ("kinetic", "elastic", "gravity", "contact", "total", "dissipated", "numerical", "work"), ax: Any = None) -> Any:
    """Energies [J] over time [s], of a run or of its table `energy`."""
    ax, columns = _axes(ax), run.energy if isinstance(run, Run) else run
    for name in [which] if isinstance(which, str) else which:
        ax.plot(np.asarray(columns["t"]), np.asarray(columns[name]), label=name)
    ax.set(xlabel="time [s]", ylabel="energy [J]")
    ax.legend()
    return ax


def steps(run: Union[Run, Any], ax: Any = None) -> Any:
    """Sizes of steps [s] over time [s]; a cross where an attempt was rejected."""
    ax, columns = _axes(ax), run.steps if isinstance(run, Run) else run
    t, h, accepted = (np.asarray(columns[name]) for name in ("t", "h", "accepted"))
    ax.step(t[accepted == 1], h[accepted == 1], where="post", label="accepted")
    if (accepted == 0).any():
        ax.plot(t[accepted == 0], h[accepted == 0], "x", label="rejected")
    ax.set(xlabel="time [s]", ylabel="step [s]", yscale="log")
    ax.legend()
    return ax


def cloth(what: Union[Run, Sim, Mesh], frame: int = -1, values: Optional[np.ndarray] = None, ax: Any = None, label: str = "") -> Any:
    """The cloth in space, of a run at a frame, a sim or a mesh; y points up. values: one number for each triangle, as colours."""
    if isinstance(what, Run):
        mesh = what.mesh(frame)
    elif isinstance(what, Sim):
        mesh = what.model.mesh(positions=what.positions)
    elif isinstance(what, Mesh):
        mesh = what
    else:
        raise TypeError(f"what: needs a drape.Run, Sim or Mesh, has {type(what).__name__}")
    ax = _axes(ax, projection="3d")
    x = mesh.positions[:, [2, 0, 1]]  # matplotlib's third axis points up
    colour = {"color": "tab:blue"} if values is None else {"cmap": "viridis"}
    surface = ax.plot_trisurf(x[:, 0], x[:, 1], x[:, 2], triangles=mesh.triangles, edgecolor=(0, 0, 0, 0.2), linewidth=0.2, **colour)
    if values is not None:
        surface.set_array(np.asarray(values))
        ax.figure.colorbar(surface, ax=ax, label=label, shrink=0.7, pad=0.12)
    ax.set(xlabel="z [m]", ylabel="x [m]", zlabel="y [m]")
    ax.set_box_aspect(np.maximum(np.ptp(x, axis=0), 1e-3 * np.ptp(x)))
    return ax


def stability(results: Any, x: str, y: Optional[str] = None, integrator: Optional[str] = None, ax: Any = None) -> Any:
    """Where runs of drape.stability completed: over one axis a row for each integrator, over two a map for one of them. x, y: columns of the table."""
    ax, columns = _axes(ax), {name: np.asarray(results[name]) for name in results}
    names = list(dict.fromkeys(columns["integrator"]))
    chosen = np.ones(len(columns["integrator"]), bool) if y is None else columns["integrator"] == (integrator or names[0])
    height = np.array([names.index(name) for name in columns["integrator"]], float) if y is None else columns[y].astype(float)
    status = np.where((columns["status"] == "ok") & (columns["rejected"] > 0), "ok, steps rejected", columns["status"])
    for kind in dict.fromkeys(status):
        mask = chosen & (status == kind)
        if mask.any():
            ax.scatter(columns[x][mask].astype(float), height[mask], label=kind, marker="s" if kind.startswith("ok") else "x")
    ax.set(xlabel=x, xscale="log")
    if y is None:
        ax.set_yticks(range(len(names)), names)
    else:
        ax.set(ylabel=y, yscale="log", title=integrator or names[0])
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
    return ax


def converge(results: Any, x: str, error: str, ax: Any = None) -> Any:
    """Differences between refinements over their size, a line for each integrator. x, error: columns of the table of drape.converge or drape.tradeoff."""
    ax, columns = _axes(ax), {name: np.asarray(results[name]) for name in results}
    for name in dict.fromkeys(columns["integrator"]):
        mask = columns["integrator"] == name
        order = np.argsort(columns[x][mask].astype(float))
        ax.loglog(columns[x][mask].astype(float)[order], columns[error][mask].astype(float)[order], "o-", label=name)
    ax.set(xlabel=x, ylabel=error)
    ax.legend()
    return ax
