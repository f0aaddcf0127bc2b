"""What tests of the Python package share: the package of the build folder, a small scene, and errors that are expected."""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
from program import SOURCES, Skip, equal, run_tests  # noqa: E402,F401  pylint: disable=wrong-import-position

BUILD = os.path.abspath(os.environ["DRAPE_BUILD"])
os.environ.setdefault("DRAPE_LIBRARY", BUILD + "/src/libdrape.so.1")
os.environ.setdefault("DRAPE_PROGRAM", BUILD + "/drape")
ENVIRONMENT = {**os.environ, "PYTHONPATH": BUILD + "/python", "MPLBACKEND": "agg"}
sys.path.insert(0, BUILD + "/python")
sys.dont_write_bytecode = True
try:
    import numpy  # noqa: F401
except ImportError:
    print("1..0 # SKIP no numpy")
    sys.exit(0)


def sheet(**changes):
    """A scene of 36 nodes that hang by two corners above a ball; a run of 0.2 s takes milliseconds."""
    cloth = {"name": "sheet", "mesh": {"grid": "square", "columns": 6, "rows": 6, "width": 0.5, "height": 0.5},
             "material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge", "drag.wind"],
             "pins": [{"corner": "top-left"}, {"corner": "top-right"}]}
    ball = {"type": "sphere", "name": "ball", "center": [0.25, -0.12, -0.25], "radius": 0.1}
    whole = {"drape": 1, "cloth": [cloth], "colliders": [ball], "integrator": {"dt": 0.01}, "duration": 0.2, "frame_rate": 30}
    for key, value in changes.items():
        (cloth if key in cloth else whole)[key] = value
    return whole


def raises(kind, function, *arguments, says="", **named):
    """The exception of this kind that a call raises."""
    try:
        function(*arguments, **named)
    except kind as error:
        assert says in str(error), f"{says!r} is not in {str(error)!r}"
        return error
    raise AssertionError(f"no {kind.__name__}")
