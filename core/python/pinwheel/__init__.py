"""Planar multibody systems with pin joints and knife-edge wheels.

Element types are classes made from the library's tables: see ``help(pw.Pin)`` and ``pw.elements.KINDS``.

>>> import pinwheel as pw
>>> r = pw.Model("snakeboard", swing=0.6).run(method="erk8+projection", t_end=10, rtol=1e-9)
>>> r["board.x"][-1], r.units["board.x"]
"""

from typing import TYPE_CHECKING, Any

from . import elements
from ._library import VERSION as __version__
from ._library import Error, InitialError, InputError, MethodError, ResourceError
from .elements import Body, Element
from .model import Feedback, Linear, Model, describe, models, sweep
from .results import Result
from .simulation import Inputs, Simulation
from .studies import command, help_of
from .vector import VectorSimulation

__all__ = ["Body", "Element", "Error", "Feedback", "InitialError", "InputError", "Inputs", "Linear", "MethodError", "Model",
           "ResourceError", "Result", "Simulation", "VectorSimulation", "command", "describe", "elements", "help_of", "models", "sweep",
           "__version__"]

if TYPE_CHECKING:
    def __getattr__(name: str) -> Any: ...
else:
    globals().update(elements.KINDS)
    __all__ += elements.KINDS
