"""Arithmetic that carries two derivatives by time along: motion from a formula for the place alone."""

import numpy as np


class Jet:
    """A quantity on the way: its value and two derivatives by time, complex or real, scalars or arrays."""

    __array_ufunc__ = None  # array * jet is the jet's business

    def __init__(self, value, rate=0.0, acc=0.0):
        self.value, self.rate, self.acc = value, rate, acc

    def __add__(self, other):
        other = _jet(other)
        return Jet(self.value + other.value, self.rate + other.rate, self.acc + other.acc)

    def __sub__(self, other):
        return self + _jet(other) * -1.0

    def __mul__(self, other):
        a, b = self, _jet(other)
        return Jet(
            a.value * b.value,
            a.rate * b.value + a.value * b.rate,
            a.acc * b.value + 2.0 * a.rate * b.rate + a.value * b.acc,
        )

    __radd__, __rmul__ = __add__, __mul__

    def through(self, f, df, ddf):
        """A function of this quantity, given its value and its two derivatives here."""
        return Jet(f, df * self.rate, df * self.acc + ddf * self.rate * self.rate)

    def part(self, which):
        """`which`, a linear map such as `np.conj` or `np.real`, of value and derivatives."""
        return Jet(which(self.value), which(self.rate), which(self.acc))


def _jet(x):
    return x if isinstance(x, Jet) else Jet(x)


def inverse(x):
    """1 / x."""
    return x.through(1 / x.value, -1 / x.value**2, 2 / x.value**3)


def root(x):
    """Square root."""
    s = np.sqrt(x.value)
    return x.through(s, 1 / (2 * s), -1 / (4 * s**3))


def turn(angle):
    """exp(i angle)."""
    e = np.exp(1j * angle.value)
    return angle.through(e, 1j * e, -e)


def direction(z):
    """The angle of a planar vector."""
    return z.through(np.log(z.value), 1 / z.value, -1 / z.value**2).part(np.imag)


def stack(jets, shape):
    """Jets, each spread to `shape`, as one along a new first axis."""
    return Jet(*(np.stack([np.broadcast_to(part, shape) for part in parts]) for parts in _parts(jets)))


def concatenate(jets):
    """Jets of arrays as one along their first axis."""
    return Jet(*map(np.concatenate, _parts(jets)))


def _parts(jets):
    return [jet.value for jet in jets], [jet.rate for jet in jets], [jet.acc for jet in jets]
