"""Rigid-body dynamics of a chain of revolute and prismatic joints, in world coordinates.

There inertias of all that a joint carries just add, and nothing is transformed twice: positions,
velocities and forces of all bodies on the way out (recursive Newton-Euler), inertias of what is
carried and the columns of M on the way back (composite rigid bodies; Featherstone, *Rigid Body
Dynamics Algorithms*, 2008, chapters 5 and 6), then M = L D L^T. Spatial vectors are taken at the
world's origin. Indices 0, 1, 2 stand for x, y, z of the world; a frame's own axes are x, y, z.
Records are BODY and FRAME of `records`. Of the n + 1 frames the first is the world's, and body i,
which body i - 1 carries, has number i + 1.
"""

import math

from fpid_pin.kernels.compiled import kernel


def forward_kinematics(b, c, u, q, v):
    """Put a body's frame c where its joint's angle q and rate v have it; u is the frame below."""
    # The joint's frame at rest, then turned about or moved along its z.
    x0 = u.x0 * b.x0 + u.y0 * b.x1 + u.z0 * b.x2
    x1 = u.x1 * b.x0 + u.y1 * b.x1 + u.z1 * b.x2
    x2 = u.x2 * b.x0 + u.y2 * b.x1 + u.z2 * b.x2
    y0 = u.x0 * b.y0 + u.y0 * b.y1 + u.z0 * b.y2
    y1 = u.x1 * b.y0 + u.y1 * b.y1 + u.z1 * b.y2
    y2 = u.x2 * b.y0 + u.y2 * b.y1 + u.z2 * b.y2
    z0 = u.x0 * b.z0 + u.y0 * b.z1 + u.z0 * b.z2
    z1 = u.x1 * b.z0 + u.y1 * b.z1 + u.z1 * b.z2
    z2 = u.x2 * b.z0 + u.y2 * b.z1 + u.z2 * b.z2
    o0 = u.o0 + u.x0 * b.p0 + u.y0 * b.p1 + u.z0 * b.p2
    o1 = u.o1 + u.x1 * b.p0 + u.y1 * b.p1 + u.z1 * b.p2
    o2 = u.o2 + u.x2 * b.p0 + u.y2 * b.p1 + u.z2 * b.p2
    if b.slides:
        o0 += z0 * q
        o1 += z1 * q
        o2 += z2 * q
        c.x0, c.x1, c.x2, c.y0, c.y1, c.y2 = x0, x1, x2, y0, y1, y2
        c.s0, c.s1, c.s2, c.r0, c.r1, c.r2 = z0, z1, z2, 0.0, 0.0, 0.0
    else:
        cosine, sine = math.cos(q), math.sin(q)
        c.x0, c.y0 = cosine * x0 + sine * y0, cosine * y0 - sine * x0
        c.x1, c.y1 = cosine * x1 + sine * y1, cosine * y1 - sine * x1
        c.x2, c.y2 = cosine * x2 + sine * y2, cosine * y2 - sine * x2
        c.s0, c.s1, c.s2 = o1 * z2 - o2 * z1, o2 * z0 - o0 * z2, o0 * z1 - o1 * z0
        c.r0, c.r1, c.r2 = z0, z1, z2
    c.z0, c.z1, c.z2, c.o0, c.o1, c.o2 = z0, z1, z2, o0, o1, o2
    c.v0, c.v1, c.v2 = u.v0 + c.s0 * v, u.v1 + c.s1 * v, u.v2 + c.s2 * v
    c.w0, c.w1, c.w2 = u.w0 + c.r0 * v, u.w1 + c.r1 * v, u.w2 + c.r2 * v
    # What moves with the joint turns with the body: velocity x motion.
    c.a0 = u.a0 + (c.w1 * c.s2 - c.w2 * c.s1 + c.v1 * c.r2 - c.v2 * c.r1) * v
    c.a1 = u.a1 + (c.w2 * c.s0 - c.w0 * c.s2 + c.v2 * c.r0 - c.v0 * c.r2) * v
    c.a2 = u.a2 + (c.w0 * c.s1 - c.w1 * c.s0 + c.v0 * c.r1 - c.v1 * c.r0) * v
    c.b0 = u.b0 + (c.w1 * c.r2 - c.w2 * c.r1) * v
    c.b1 = u.b1 + (c.w2 * c.r0 - c.w0 * c.r2) * v
    c.b2 = u.b2 + (c.w0 * c.r1 - c.w1 * c.r0) * v


def body_inertia_and_force(b, c):
    """Write a body's inertia at the world's origin, and the force that its motion takes."""
    m = b.m
    h0 = c.x0 * b.h0 + c.y0 * b.h1 + c.z0 * b.h2
    h1 = c.x1 * b.h0 + c.y1 * b.h1 + c.z1 * b.h2
    h2 = c.x2 * b.h0 + c.y2 * b.h1 + c.z2 * b.h2
    # R J R^T, its upper half.
    t00 = c.x0 * b.j00 + c.y0 * b.j01 + c.z0 * b.j02
    t01 = c.x0 * b.j01 + c.y0 * b.j11 + c.z0 * b.j12
    t02 = c.x0 * b.j02 + c.y0 * b.j12 + c.z0 * b.j22
    t10 = c.x1 * b.j00 + c.y1 * b.j01 + c.z1 * b.j02
    t11 = c.x1 * b.j01 + c.y1 * b.j11 + c.z1 * b.j12
    t12 = c.x1 * b.j02 + c.y1 * b.j12 + c.z1 * b.j22
    t20 = c.x2 * b.j00 + c.y2 * b.j01 + c.z2 * b.j02
    t21 = c.x2 * b.j01 + c.y2 * b.j11 + c.z2 * b.j12
    t22 = c.x2 * b.j02 + c.y2 * b.j12 + c.z2 * b.j22
    # From the frame's origin to the world's (Steiner).
    o0, o1, o2 = c.o0, c.o1, c.o2
    shift = 2.0 * (o0 * h0 + o1 * h1 + o2 * h2) + m * (o0 * o0 + o1 * o1 + o2 * o2)
    j00 = t00 * c.x0 + t01 * c.y0 + t02 * c.z0 + shift - 2.0 * o0 * h0 - m * o0 * o0
    j11 = t10 * c.x1 + t11 * c.y1 + t12 * c.z1 + shift - 2.0 * o1 * h1 - m * o1 * o1
    j22 = t20 * c.x2 + t21 * c.y2 + t22 * c.z2 + shift - 2.0 * o2 * h2 - m * o2 * o2
    j01 = t00 * c.x1 + t01 * c.y1 + t02 * c.z1 - o0 * h1 - h0 * o1 - m * o0 * o1
    j02 = t00 * c.x2 + t01 * c.y2 + t02 * c.z2 - o0 * h2 - h0 * o2 - m * o0 * o2
    j12 = t10 * c.x2 + t11 * c.y2 + t12 * c.z2 - o1 * h2 - h1 * o2 - m * o1 * o2
    h0 += m * o0
    h1 += m * o1
    h2 += m * o2
    c.m, c.h0, c.h1, c.h2 = m, h0, h1, h2
    c.j00, c.j01, c.j02, c.j11, c.j12, c.j22 = j00, j01, j02, j11, j12, j22
    # Momentum, and the rate at which it has to change: I a + v x* (I v).
    v0, v1, v2, w0, w1, w2 = c.v0, c.v1, c.v2, c.w0, c.w1, c.w2
    l0 = m * v0 + w1 * h2 - w2 * h1
    l1 = m * v1 + w2 * h0 - w0 * h2
    l2 = m * v2 + w0 * h1 - w1 * h0
    k0 = j00 * w0 + j01 * w1 + j02 * w2 + h1 * v2 - h2 * v1
    k1 = j01 * w0 + j11 * w1 + j12 * w2 + h2 * v0 - h0 * v2
    k2 = j02 * w0 + j12 * w1 + j22 * w2 + h0 * v1 - h1 * v0
    a0, a1, a2, b0, b1, b2 = c.a0, c.a1, c.a2, c.b0, c.b1, c.b2
    c.f0 = m * a0 + b1 * h2 - b2 * h1 + w1 * l2 - w2 * l1
    c.f1 = m * a1 + b2 * h0 - b0 * h2 + w2 * l0 - w0 * l2
    c.f2 = m * a2 + b0 * h1 - b1 * h0 + w0 * l1 - w1 * l0
    turn0 = w1 * k2 - w2 * k1 + v1 * l2 - v2 * l1
    turn1 = w2 * k0 - w0 * k2 + v2 * l0 - v0 * l2
    turn2 = w0 * k1 - w1 * k0 + v0 * l1 - v1 * l0
    c.n0 = j00 * b0 + j01 * b1 + j02 * b2 + h1 * a2 - h2 * a1 + turn0
    c.n1 = j01 * b0 + j11 * b1 + j12 * b2 + h2 * a0 - h0 * a2 + turn1
    c.n2 = j02 * b0 + j12 * b1 + j22 * b2 + h0 * a1 - h1 * a0 + turn2


def accumulate_subtree(u, c):
    """Add a subtree's inertia and force to those of the body that carries it."""
    u.m += c.m
    u.h0 += c.h0
    u.h1 += c.h1
    u.h2 += c.h2
    u.j00 += c.j00
    u.j01 += c.j01
    u.j02 += c.j02
    u.j11 += c.j11
    u.j12 += c.j12
    u.j22 += c.j22
    u.f0 += c.f0
    u.f1 += c.f1
    u.f2 += c.f2
    u.n0 += c.n0
    u.n1 += c.n1
    u.n2 += c.n2


def project_on_axis(c, f0, f1, f2, n0, n1, n2):
    """Return the part of a force that a joint's motion feels."""
    return c.s0 * f0 + c.s1 * f1 + c.s2 * f2 + c.r0 * n0 + c.r1 * n1 + c.r2 * n2


def set_base_acceleration(frames, gravity):
    """Set the world's frame, the first: it falls upwards, which is what gravity amounts to."""
    world = frames[0]
    world.x0 = world.y1 = world.z2 = 1.0
    world.a0, world.a1, world.a2 = -gravity[0], -gravity[1], -gravity[2]


def accumulate(bodies, frames, q, v, bias, mass):
    """Go out along the arm and back: what `mass_matrix_and_bias` writes, from a base that is set.

    A kernel of its own: compiled as one with the base, a whole step takes a tenth longer.
    """
    n = bodies.size
    for i in range(n):
        b = bodies[i]
        c = frames[i + 1]
        forward_kinematics(b, c, frames[i], q[i], v[i])
        body_inertia_and_force(b, c)
    for back in range(n):
        i = n - 1 - back
        c = frames[i + 1]
        bias[i] = project_on_axis(c, c.f0, c.f1, c.f2, c.n0, c.n1, c.n2)
        # The force that a unit of acceleration of this joint takes from all that it carries.
        f0 = c.m * c.s0 + c.r1 * c.h2 - c.r2 * c.h1
        f1 = c.m * c.s1 + c.r2 * c.h0 - c.r0 * c.h2
        f2 = c.m * c.s2 + c.r0 * c.h1 - c.r1 * c.h0
        n0 = c.j00 * c.r0 + c.j01 * c.r1 + c.j02 * c.r2 + c.h1 * c.s2 - c.h2 * c.s1
        n1 = c.j01 * c.r0 + c.j11 * c.r1 + c.j12 * c.r2 + c.h2 * c.s0 - c.h0 * c.s2
        n2 = c.j02 * c.r0 + c.j12 * c.r1 + c.j22 * c.r2 + c.h0 * c.s1 - c.h1 * c.s0
        for j in range(i + 1):
            mass[i, j] = project_on_axis(frames[j + 1], f0, f1, f2, n0, n1, n2)
        mass[i, i] += bodies[i].armature
        if i > 0:
            accumulate_subtree(frames[i], c)


@kernel
def factor_symmetric(mass):
    """Turn M, its lower half, into L and 1/D of M = L D L^T, in place."""
    for i in range(mass.shape[0]):
        row = mass[i]
        d = row[i]
        for j in range(i):
            lower = mass[j]
            t = row[j]
            for k in range(j):
                t -= row[k] * lower[k]
            row[j] = t
        for j in range(i):
            t = row[j]
            row[j] = t * mass[j, j]
            d -= t * row[j]
        row[i] = 1.0 / d


@kernel
def solve_symmetric(factored, x):
    """Turn x into M^-1 x, (n,), in place; `factored` by `factor_symmetric`."""
    n = x.size
    for i in range(n):
        t = x[i]
        for k in range(i):
            t -= factored[i, k] * x[k]
        x[i] = t
    for back in range(n):
        i = n - 1 - back
        t = x[i] * factored[i, i]
        for k in range(i + 1, n):
            t -= factored[k, i] * x[k]
        x[i] = t


@kernel
def mass_matrix_and_bias(bodies, frames, gravity, q, v, bias, mass):
    """Write C q' + G into `bias`, (n,), and M into the lower half of `mass`, (n, n): eq. (5)."""
    set_base_acceleration(frames, gravity)
    accumulate(bodies, frames, q, v, bias, mass)


@kernel
def forward_dynamics(bodies, frames, gravity, q, v, tau, mass, a):
    """Write q'' = M^-1 (tau - C q' - G), (n,); M's factors stay in `mass`."""
    mass_matrix_and_bias(bodies, frames, gravity, q, v, a, mass)
    for i in range(bodies.size):
        a[i] = tau[i] - a[i]
    factor_symmetric(mass)
    solve_symmetric(mass, a)
