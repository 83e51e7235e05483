"""Taylor arithmetic: quantities along a motion, their first two time derivatives, and their gradients.

A vector of the plane is a complex number, so that a turn by phi is a product with exp (i phi).  The motion is q (t)
with velocities v and zero accelerations; accelerations a add the gradient times a to a second derivative."""
import cmath
import math


class Jet:
    """A function of coordinates and time: value x, time derivatives d and dd, gradient g (array) by the coordinates."""
    __slots__ = ("x", "d", "dd", "g")

    def __init__(self, x, d=0.0, dd=0.0, g=0.0):
        self.x, self.d, self.dd, self.g = x, d, dd, g

    def __add__(self, o):
        if not isinstance(o, Jet):
            return Jet(self.x + o, self.d, self.dd, self.g)
        return Jet(self.x + o.x, self.d + o.d, self.dd + o.dd, self.g + o.g)

    def __sub__(self, o):
        if not isinstance(o, Jet):
            return Jet(self.x - o, self.d, self.dd, self.g)
        return Jet(self.x - o.x, self.d - o.d, self.dd - o.dd, self.g - o.g)

    def __mul__(self, o):
        if not isinstance(o, Jet):
            return Jet(self.x * o, self.d * o, self.dd * o, self.g * o)
        return Jet(self.x * o.x, self.d * o.x + self.x * o.d, self.dd * o.x + 2 * self.d * o.d + self.x * o.dd,
                   self.g * o.x + self.x * o.g)

    def __neg__(self):
        return self * -1

    def __rsub__(self, o):
        return -self + o

    def __truediv__(self, o):
        return self * (o.chain(1 / o.x, -1 / o.x**2, 2 / o.x**3) if isinstance(o, Jet) else 1 / o)

    def __rtruediv__(self, o):
        return self.chain(1 / self.x, -1 / self.x**2, 2 / self.x**3) * o

    def __pow__(self, n):
        return self.chain(self.x**n, n * self.x**(n - 1), n * (n - 1) * self.x**(n - 2))

    __radd__, __rmul__ = __add__, __mul__

    def chain(self, f, f1, f2):
        """F (self) by the chain rule; f, f1, f2: F and its derivatives at self.x."""
        return Jet(f, f1 * self.d, f2 * self.d**2 + f1 * self.dd, f1 * self.g)

    def rate(self):
        return Rate(self.d, self.dd, self.g)


class Rate:
    """A function of coordinates, velocities and time that is linear in the velocities: value x, time derivative d at
    zero accelerations, gradient g by the velocities, which is that of the time derivative by the accelerations."""
    __slots__ = ("x", "d", "g")

    def __init__(self, x, d, g):
        self.x, self.d, self.g = x, d, g

    def __add__(self, o):
        return Rate(self.x + o.x, self.d + o.d, self.g + o.g)

    def __sub__(self, o):
        return Rate(self.x - o.x, self.d - o.d, self.g - o.g)

    def __mul__(self, c):
        return Rate(self.x * c, self.d * c, self.g * c)


def real(a):
    return a.real if not isinstance(a, (Jet, Rate)) else \
        Rate(a.x.real, a.d.real, a.g.real) if isinstance(a, Rate) else Jet(a.x.real, a.d.real, a.dd.real, a.g.real)


def conj(a):
    return Jet(a.x.conjugate(), a.d.conjugate(), a.dd.conjugate(),
               a.g.conjugate() if not isinstance(a.g, float) else a.g)


def dot(a, b):
    """Scalar product of the vectors a (a jet) and b (a jet or a rate)."""
    if isinstance(b, Jet):
        return real(conj(a) * b)
    n, m = a.x.conjugate(), a.d.conjugate()
    return real(Rate(n * b.x, m * b.x + n * b.d, n * b.g))


def product(a, w):
    """The product of a jet and a rate."""
    return Rate(a.x * w.x, a.d * w.x + a.x * w.d, a.x * w.g)


def turn(a):
    """exp (i a): the direction at the angle a."""
    e = cmath.exp(1j * a.x)
    return a.chain(e, 1j * e, -e)


def sin(a):
    return a.chain(math.sin(a.x), math.cos(a.x), -math.sin(a.x)) if isinstance(a, Jet) else math.sin(a)


def cos(a):
    return a.chain(math.cos(a.x), -math.sin(a.x), -math.cos(a.x)) if isinstance(a, Jet) else math.cos(a)


def exp(a):
    return a.chain(math.exp(a.x), math.exp(a.x), math.exp(a.x)) if isinstance(a, Jet) else math.exp(a)


def tanh(a):
    if not isinstance(a, Jet):
        return math.tanh(a)
    y = math.tanh(a.x)
    return a.chain(y, 1 - y * y, -2 * y * (1 - y * y))


def sqrt(a):
    return a**0.5 if isinstance(a, Jet) else math.sqrt(a)
