"""Planar multibody systems with pin joints and knife-edge wheels.

>>> import pinwheel as pw
>>> r = pw.Model("snakeboard", swing=0.6).run(method="erk8+projection", t_end=10, rtol=1e-9)
>>> r["board.x"][-1], r.units["board.x"]
"""

from ._library import Error, InitialError, InputError, MethodError, ResourceError
from .model import Linear, Model, describe, models
from .results import Result
from .simulation import Simulation
from .studies import command, sweep

__all__ = ["Error", "InitialError", "InputError", "Linear", "MethodError", "Model", "ResourceError", "Result", "Simulation",
           "command", "describe", "models", "sweep"]
__version__ = "0.1.0"
