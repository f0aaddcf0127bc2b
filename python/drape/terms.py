"""Terms in Python: energies of elements, as functions of numpy arrays."""
import ctypes
import math
import weakref
from typing import Any, Callable, NamedTuple, Optional, Tuple, Union

import numpy as np

from . import _binding as c
from ._binding import Status
from ._library import ArgumentError, Context, encode, lib, numbers, spread


class Cloth(NamedTuple):
    """A cloth at rest, for the author of a term. Node numbers are those of the cloth."""

    rest: np.ndarray
    """positions, nodes x 3 [m]"""
    triangles: np.ndarray
    """triangles x 3"""
    edges: np.ndarray
    """edges x 2"""
    hinges: np.ndarray
    """hinges x 4: the shared edge, then the apices of its two triangles"""
    node_area: np.ndarray
    """[m2] lumped at the nodes"""
    node_mass: np.ndarray
    """[kg] lumped at the nodes"""


Elements = Callable[[Cloth], Union[np.ndarray, Tuple[np.ndarray, np.ndarray]]]
EnergyFunction = Callable[[np.ndarray, np.ndarray], Tuple[np.ndarray, np.ndarray, np.ndarray]]


class Term:
    """An energy that is a sum over elements, for `drape.Model(scene, terms=[term])`, whose scene lists its name among the terms of a cloth.

    elements(cloth) returns the nodes of each element (count x nodes) and, if there are any, numbers of rest data (count x k). energy(x, rest) takes the
    positions of elements (count x nodes x 3 [m]) and their rest data, and returns energies [J] (count), gradients [N] (count x nodes x 3) and Hessians
    [N/m] (count x 3 nodes x 3 nodes, symmetric), all exact: `model.check_derivatives()` compares them with differences. convex: the Hessian is positive
    semidefinite in every state. external: the potential of a load, counted with gravity. The function must depend on its arguments only; it is called
    from any thread. An exception in it rejects the attempt, and comes out of the advance."""

    def __init__(self, name: str, nodes: int, elements: Elements, energy: EnergyFunction, *, element_name: str = "element", reference: str = "a function in Python",
                 convex: bool = False, external: bool = False):
        self.name, self.nodes, self.elements, self.energy = name, nodes, elements, energy
        self._error: Optional[BaseException] = None
        ops = self._ops = c.drape_term_ops()
        kinds: Any = dict(c.drape_term_ops._fields_)  # type: ignore[arg-type]
        ops.struct_size = ctypes.sizeof(ops)
        ops.entry.name, ops.entry.summary, ops.entry.reference = encode(name), b"an energy in Python", encode(reference)
        ops.element_name, ops.nodes, ops.convex, ops.external = encode(element_name), nodes, convex, external
        this = weakref.ref(self)  # a context keeps the callbacks, and must not keep functions that refer to what keeps the context
        ops.build = kinds["build"](lambda *given: term._build(*given) if (term := this()) else Status.E_ARGUMENT)
        ops.energy = kinds["energy"](lambda *given: term._energy(*given) if (term := this()) else None)

    def register(self, context: Context) -> None:
        """Makes the term known to a context. Who uses the context must keep the term."""
        context.keep.append(self._ops)
        context.check(lib.drape_context_add_term(context.address, self._ops))

    def raise_pending(self) -> None:
        """Raises what a callback could not."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    @property
    def failed(self) -> bool:
        """Whether a callback has raised an exception that raise_pending() has not raised yet."""
        return self._error is not None

    def _build(self, pointer, _, builder):
        try:
            v = pointer.contents
            cloth = Cloth(_read(v.rest, (v.node_count, 3)), _read(v.triangle, (v.triangle_count, 3), np.int32), _read(v.edge, (v.edge_count, 2), np.int32),
                          _read(v.hinge, (v.hinge_count, 4), np.int32), _read(v.node_area, (v.node_count,)), _read(v.node_mass, (v.node_count,)))
            result = self.elements(cloth)
            nodes, rest = result if isinstance(result, tuple) else (result, np.empty((len(result), 0)))
            nodes = numbers(nodes, f"{self.name}: nodes", -1, self.nodes, dtype=np.int32)
            rest = numbers(rest, f"{self.name}: rest data", len(nodes), -1)
            if nodes.size and not 0 <= nodes.min() <= nodes.max() < v.node_count:
                raise ArgumentError(f"{self.name}: an element has a node that the cloth, of {v.node_count}, has not")
            status = lib.drape_term_reserve(builder, len(nodes), rest.shape[1])
            for k in range(len(nodes)) if not status else ():
                lib.drape_term_set(builder, k, nodes[k].ctypes.data, rest[k].ctypes.data)
            return status
        except BaseException as error:
            self._error = error
            return Status.E_ARGUMENT

    def _energy(self, pointer, first, count, x, _, energies, gradients, hessians):
        try:
            el, d = pointer.contents, 3 * self.nodes
            nodes = _read(el.node + 4 * first * self.nodes, (count, self.nodes), np.int32)
            rest = _read(el.rest, (el.rest_count, el.count))[:, first:first + count].T if el.rest_count else np.empty((count, 0))
            positions = _read(x, (int(nodes.max()) + 1, 3))[nodes]
            shapes = (count,), (count, self.nodes, 3), (count, d, d)
            results = self.energy(positions, rest)
            if not isinstance(results, (tuple, list)) or len(results) != 3:
                raise TypeError(f"{self.name}: the energy function returned {type(results).__name__}, needs energies, gradients and Hessians")
            for out, name, values, shape in zip((energies, gradients, hessians), ("energies", "gradients", "Hessians"), results, shapes):
                if out:
                    values = spread(values, f"{self.name}: {name}", *shape, finite=False)  # not finite: the attempt is rejected
                    ctypes.memmove(out, values.ctypes.data, values.nbytes)
        except BaseException as error:
            self._error = self._error or error
            for out in (energies, gradients, hessians):
                if out:
                    ctypes.c_double.from_address(out).value = math.nan


def _read(address: int, shape, dtype=np.float64) -> np.ndarray:
    """A copy of memory of the library."""
    array = np.empty(shape, dtype)
    if array.size:
        ctypes.memmove(array.ctypes.data, address, array.nbytes)
    return array
