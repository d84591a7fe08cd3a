# ruff: noqa: E501
# fmt: off
"""Mass matrix and bias of the blind truck; written by truck_derive.py, not by hand."""

from math import cos, sin

from numba import njit


@njit(cache=True)
def mass_and_bias(
    psi2, phi1, phi2, u, v, r1, p1, r2, p2, mu1, ms1, iz1, ix1, hs1, k1, mu2, ms2, iz2, ix2, hs2,
    k2, kh, hx, lx, g, m, b,
):
    """Writes the mass matrix (6, 6) and the bias (6,) in axes along the tractor; see truck_derive.py."""
    x0 = ms2 + mu2
    x1 = ms1 + mu1 + x0
    x2 = sin(phi1)
    x3 = hs1*ms1
    x4 = x2*x3
    x5 = hx**2
    x6 = hs1**2
    x7 = ms1*x6
    x8 = x3*cos(phi1)
    x9 = sin(psi2)
    x10 = lx*x9
    x11 = ms2*x10
    x12 = mu2*x10
    x13 = cos(psi2)
    x14 = sin(phi2)
    x15 = hs2*ms2
    x16 = x14*x15
    x17 = x13*x16
    x18 = lx*x13
    x19 = ms2*x18
    x20 = mu2*x18
    x21 = -hs2*ms2*x14*x9 + x19 + x20
    x22 = lx**2
    x23 = hs2**2*ms2
    x24 = x15*cos(phi2)
    x25 = x24*x9
    x26 = x13*x24
    x27 = r1**2
    x28 = hx*x27
    x29 = ms2*x28
    x30 = r2**2
    x31 = p2*r2
    x32 = 2*x31
    x33 = p2**2
    x34 = x16*x9
    x35 = x11*x30
    x36 = x12*x30
    x37 = sin(phi2 + psi2)
    x38 = hx*x15
    x39 = sin(2*phi1)
    x40 = (1/2)*x37
    x41 = x33*x38
    x42 = (1/2)*x30
    x43 = x38*x42
    x44 = sin(phi2 - psi2)
    x45 = (1/2)*x44
    x46 = kh*phi2
    x47 = kh*phi1
    x48 = x23*sin(2*phi2)
    x49 = hs2*x29
    x50 = x45*x49
    m[0, 0] = x1
    m[1, 0] = m[0, 1] = 0
    m[1, 1] = x1
    m[2, 0] = m[0, 2] = x4
    m[2, 1] = m[1, 2] = -hx*x0
    m[2, 2] = iz1 + ms2*x5 + mu2*x5 + x2**2*x7
    m[3, 0] = m[0, 3] = 0
    m[3, 1] = m[1, 3] = -x8
    m[3, 2] = m[2, 3] = 0
    m[3, 3] = ix1 + x7
    m[4, 0] = m[0, 4] = x11 + x12 + x17
    m[4, 1] = m[1, 4] = -x21
    m[4, 2] = m[2, 4] = hx*x21
    m[4, 3] = m[3, 4] = 0
    m[4, 4] = iz2 + ms2*x22 + mu2*x22 + x14**2*x23
    m[5, 0] = m[0, 5] = x25
    m[5, 1] = m[1, 5] = -x26
    m[5, 2] = m[2, 5] = hx*x26
    m[5, 3] = m[3, 5] = 0
    m[5, 4] = m[4, 5] = lx*x24
    m[5, 5] = ix2 + x23
    b[0] = mu2*x28 + 2*p1*r1*x8 + x19*x30 + x20*x30 + x26*x32 + x29 - x30*x34 - x33*x34
    b[1] = p1**2*x4 + x17*x30 + x17*x33 + x25*x32 + x27*x4 + x35 + x36
    b[2] = hs2*hx*ms2*p2*r2*x44 - hx*x35 - hx*x36 + ms1*p1*r1*x39*x6 - x31*x37*x38 - x37*x43 - x40*x41 - x41*x45 - x43*x44
    b[3] = -g*x4 + k1*phi1 - 1/2*x27*x39*x7 - x46 + x47
    b[4] = -lx*x16*x33 + x11*x28 + x12*x28 + x31*x48 + x40*x49 + x50
    b[5] = -g*x16 + (1/2)*hs2*hx*ms2*x27*x37 + k2*phi2 - x42*x48 + x46 - x47 - x50
