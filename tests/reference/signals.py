"""Signals as text models describe them (docs/model-format.md), with two derivatives and the times at which they are not
smooth.  Between two such times a signal is one smooth function; `middle`, a time between them, says which."""
import bisect
import math
import re
from scipy.interpolate import CubicSpline
import taylor
from taylor import Jet


class Signal:
    """breaks: times [s] of jumps and kinks of the value or a derivative, sorted.  at (t, middle, states): a Jet."""

    def __init__(self, text):
        self.breaks, self.at, self.states = [], None, False  # states: whether it reads any
        if isinstance(text, dict) and "expression" not in text:
            (form, fields), = text.items()
            if form == "constant":
                self.at = lambda t, middle, states: Jet(fields)
            else:
                getattr(self, "_" + form.replace("-", "_"))(**fields)
        else:
            self._expression(text["expression"] if isinstance(text, dict) else text)

    def _harmonic(self, amplitude, omega, phase=0, offset=0):
        self.at = lambda t, middle, states: taylor.cos(Jet(t, 1.0) * omega + phase) * amplitude + offset

    def _from_to(self, shape, a, b, start, duration):
        def at(t, middle, states):
            if middle < start:
                return Jet(a)
            if middle > start + duration:
                return Jet(b)
            return shape((Jet(t, 1.0) - start) / duration) * (b - a) + a
        self.breaks, self.at = [start, start + duration], at

    def _ramp(self, to, duration, start=0, **rest):
        self._from_to(lambda x: x, rest.get("from", 0), to, start, duration)

    def _smooth_step(self, to, duration, start=0, **rest):
        self._from_to(lambda x: x**3 * 10 - x**4 * 15 + x**5 * 6, rest.get("from", 0), to, start, duration)

    def _pulse(self, height, start=0, width=0, period=0, offset=0):
        edges = [start]
        if width > 0:
            edges.append(start + width)
            for n in range(1, 200 if period > 0 else 0):
                edges += [start + n * period, start + n * period + width]
        self.breaks = edges
        self.at = lambda t, middle, states: Jet(offset + height * (bisect.bisect(edges, middle) % 2))

    def _table(self, points, interpolation="linear", ends="free"):
        times, values = [p[0] for p in points], [p[1] for p in points]
        if interpolation == "cubic":
            spline = CubicSpline(times, values, bc_type="not-a-knot" if ends == "free" else "clamped")

        def at(t, middle, states):
            if middle < times[0]:
                return Jet(values[0])
            if middle > times[-1]:
                return Jet(values[-1])
            i = bisect.bisect(times, middle) - 1
            if interpolation == "cubic":
                a, b, c, d = spline.c[:, i]
                s = Jet(t, 1.0) - times[i]
                return ((s * a + b) * s + c) * s + d
            slope = (values[i + 1] - values[i]) / (times[i + 1] - times[i])
            return Jet(values[i] + slope * (t - times[i]), slope)
        self.breaks, self.at = list(times), at

    def _expression(self, text):
        """The operators of expressions that Python writes otherwise, and states as entries of a dict."""
        self.text = str(text)
        code = re.sub(r"\b([A-Za-z]\w*)\.(x|y|phi|vx|vy|omega|spin|spin_rate)\b", r'states["\1.\2"]', self.text)
        self.states = "states[" in code
        code = code.replace("^", "**").replace("&&", " and ").replace("||", " or ")
        self.breaks = sorted(float(x) for x in re.findall(r"\bt [<>]=? ([\d.]+)", self.text))
        # A comparison of t holds on all of a piece, ends included.
        code = re.sub(r"\bt ([<>]=?) ", r"middle \1 ", code)
        branch = re.fullmatch(r"(.*)\?(.*):(.*)", code)
        if branch:
            code = "(({1}) if ({0}) else ({2}))".format(*branch.groups())
        program = compile(code, self.text, "eval")
        names = dict(pi=math.pi, sin=taylor.sin, cos=taylor.cos, exp=taylor.exp, tanh=taylor.tanh, sqrt=taylor.sqrt)

        def at(t, middle, states):
            u = eval(program, names, dict(t=Jet(t, 1.0), middle=middle, states=states))
            return u if isinstance(u, Jet) else Jet(u)
        self.at = at
