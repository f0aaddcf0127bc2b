"""Drape: cloth simulation with exact derivatives and controlled steps.

    import drape
    scene = drape.Scene("flag.json")
    scene["/integrator/dt"] = 1e-3
    sim = drape.Sim(scene)
    sim.advance(1.0)
    print(sim.energy.kinetic, sim.positions.mean(axis=0))

Units are SI, axes are right-handed with y up. docs/python.md shows how things are used together; docs/reference.md has every key of a scene."""
from . import plot
from ._binding import (Attempt, CheckResult, ClothRange, ColliderMotion, Diagnostic, Energy, EventKind, EventRecord, Realtime, Relaxed, SeamReport,
                       Statistics, Status, Untangling, Warning)
from ._library import (ArgumentError, Error, FileError, OutOfMemory, ParseError, SolverError, StepError, Stopped, VersionError, lib as _lib)
from .lab import converge, info, modes, path, schema, stability, tradeoff, validate
from .mesh import Mesh
from .runs import Page, Run, load, run
from .scene import Model, Scene
from .sim import Embedding, Event, Frame, Sim
from .terms import Cloth, Term

__version__: str = _lib.drape_version().decode()

__all__ = ["ArgumentError", "Attempt", "CheckResult", "Cloth", "ClothRange", "ColliderMotion", "Diagnostic", "Embedding", "Energy", "Error", "Event", "EventKind",
           "EventRecord", "FileError", "Frame", "Mesh", "Model", "OutOfMemory", "Page", "ParseError", "Realtime", "Relaxed", "Run", "Scene", "SeamReport",
           "Sim", "SolverError", "Statistics", "Status", "StepError", "Stopped", "Term", "Untangling", "VersionError", "Warning", "converge", "info", "load",
           "modes", "path", "plot", "run", "schema", "stability", "tradeoff", "validate"]
