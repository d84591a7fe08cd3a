"""Derives the blind truck's equations of motion with sympy and writes them as code: `python -m blind.truck_derive`.

Lagrange's equations of the second kind in minimal coordinates,

    d/dt dT/dq' - dT/dq + dV/dq = Q,   q = (X, Y, psi1, phi1, psi2, phi2),

for a tractor (place X, Y of its CG's foot, yaw psi1, roll phi1 of its sprung mass over a roll axis) and a
semi-trailer (yaw psi2, roll phi2) that hangs on the tractor's fifth wheel by a constraint, not by a spring. Nothing
depends on psi1 itself: the equations are taken in axes that lie along the tractor. What is written are M(q) and the
bias b(q, q') of

    M q'' + b = Q,

with potential forces in b. Positive roll: right side down. Needs sympy; the written file needs only numba.
"""

from __future__ import annotations

from pathlib import Path
from textwrap import fill

import sympy as sp

PLACE = Path(__file__).with_name("truck_equations.py")
ARGUMENTS = [
    "psi2", "phi1", "phi2", "u", "v", "r1", "p1", "r2", "p2", "mu1", "ms1", "iz1", "ix1", "hs1", "k1", "mu2",
    "ms2", "iz2", "ix2", "hs2", "k2", "kh", "hx", "lx", "z1", "z2", "g",
]  # fmt: skip
INDENT = "    "
HEAD = '''# ruff: noqa: E501
# fmt: off
"""Mass matrix and bias of the blind truck; written by truck_derive.py, not by hand."""

from math import cos, sin

from numba import njit


@njit(cache=True)
def mass_and_bias(
{arguments}, m, b,
):
    """Writes the mass matrix (6, 6) and the bias (6,) in axes along the tractor; see truck_derive.py."""
'''


def equations() -> tuple[sp.Matrix, sp.Matrix]:
    """Mass matrix and bias, at psi1 = 0."""
    s = sp.symbols(ARGUMENTS, real=True)
    of = dict(zip(ARGUMENTS, s))
    x, y, psi1 = sp.symbols("x y psi1", real=True)
    psi2, phi1, phi2 = of["psi2"], of["phi1"], of["phi2"]
    q = sp.Matrix([x, y, psi1, phi1, psi2, phi2])
    rates = sp.Matrix([of["u"], of["v"], of["r1"], of["p1"], of["r2"], of["p2"]])

    def turned(angle, forward, left):
        return sp.Matrix(
            [forward * sp.cos(angle) - left * sp.sin(angle), forward * sp.sin(angle) + left * sp.cos(angle)]
        )

    foot1 = sp.Matrix([x, y])
    # The pin sways with the tractor's body, and with the semi-trailer's.
    foot2 = foot1 + turned(psi1, -of["hx"], -of["z1"] * sp.sin(phi1)) - turned(psi2, of["lx"], -of["z2"] * sp.sin(phi2))
    kinetic = 0
    for foot, psi, phi, n in ((foot1, psi1, phi1, "1"), (foot2, psi2, phi2, "2")):
        high = of["hs" + n]
        body = foot + turned(psi, 0, -high * sp.sin(phi))
        for mass, place in ((of["mu" + n], foot), (of["ms" + n], body)):
            velocity = place.jacobian(q) * rates
            kinetic += mass * (velocity.T * velocity)[0] / 2
        kinetic += of["ms" + n] * (high * sp.sin(phi) * of["p" + n]) ** 2 / 2  # the CG sinks
        kinetic += of["iz" + n] * of["r" + n] ** 2 / 2 + of["ix" + n] * of["p" + n] ** 2 / 2
    potential = of["kh"] * (phi1 - phi2) ** 2 / 2
    for phi, n in ((phi1, "1"), (phi2, "2")):
        potential += of["k" + n] * phi**2 / 2 + of["ms" + n] * of["g"] * of["hs" + n] * sp.cos(phi)
    momenta = sp.Matrix([sp.diff(kinetic, rate) for rate in rates])
    mass = momenta.jacobian(rates)
    bias = momenta.jacobian(q) * rates
    bias -= sp.Matrix([sp.diff(kinetic - potential, c) for c in q])
    return mass.subs(psi1, 0), bias.subs(psi1, 0)


def code() -> str:
    """The text of truck_equations.py."""
    mass, bias = equations()
    wanted = [mass[i, j] for i in range(6) for j in range(i + 1)] + list(bias)
    shared, results = sp.cse(wanted)
    lines = [f"    {name} = {sp.pycode(value)}" for name, value in shared]
    results = iter(results)
    for i in range(6):
        for j in range(i + 1):
            other = "" if i == j else f" = m[{j}, {i}]"
            lines.append(f"    m[{i}, {j}]{other} = {sp.pycode(next(results))}")
    lines += [f"    b[{i}] = {sp.pycode(next(results))}" for i in range(6)]
    text = "\n".join(lines).replace("math.", "")
    return (
        HEAD.format(arguments=fill(", ".join(ARGUMENTS), 100, initial_indent=INDENT, subsequent_indent=INDENT))
        + text
        + "\n"
    )


if __name__ == "__main__":
    PLACE.write_text(code(), encoding="utf-8")
    print(f"{PLACE.name}: {len(code().splitlines())} lines")
