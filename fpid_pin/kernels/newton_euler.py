"""Inverse dynamics by the recursive Newton-Euler rule, in each body's own coordinates.

Velocities and accelerations go out along the chain, forces come back (Featherstone, *Rigid Body
Dynamics Algorithms*, 2008, section 5.3). C(q, v) w with two different velocities is the symmetric
bilinear form of C(q, v) v, so it is one recursion with two velocities:

    A = X A_before + S a + (V x S w + W x S v)/2,    F = I A + (V x* I W + W x* I V)/2

V and W are what the joint rates v and w do to a body. The ten inertial numbers of each body come in
an array of their own, (n, 10): m, h (3), j00 j01 j02 j11 j12 j22, as in `records.BODY`. Torques
are linear in them; `gradient` has the derivatives. Plain Python, compiled by whoever calls it.
"""

import math


def place_links(bodies, links, q):
    """Write where each body is in the coordinates of the one before."""
    for i in range(bodies.size):
        b = bodies[i]
        c = links[i]
        c.z0, c.z1, c.z2 = b.z0, b.z1, b.z2
        if b.slides:
            c.x0, c.x1, c.x2, c.y0, c.y1, c.y2 = b.x0, b.x1, b.x2, b.y0, b.y1, b.y2
            c.p0, c.p1, c.p2 = b.p0 + b.z0 * q[i], b.p1 + b.z1 * q[i], b.p2 + b.z2 * q[i]
        else:
            cosine, sine = math.cos(q[i]), math.sin(q[i])
            c.x0, c.y0 = cosine * b.x0 + sine * b.y0, cosine * b.y0 - sine * b.x0
            c.x1, c.y1 = cosine * b.x1 + sine * b.y1, cosine * b.y1 - sine * b.x1
            c.x2, c.y2 = cosine * b.x2 + sine * b.y2, cosine * b.y2 - sine * b.x2
            c.p0, c.p1, c.p2 = b.p0, b.p1, b.p2


def velocities(bodies, links, rates, motion):
    """Write the velocity that joint rates, (n,), give each body, linear and angular, (n, 6)."""
    n = bodies.size
    for i in range(n):
        b = bodies[i]
        c = links[i]
        own = motion[i]
        for k in range(6):
            own[k] = 0.0
        if i > 0:
            u = motion[i - 1]
            # At this body's origin, then in its coordinates.
            t0 = u[0] + u[4] * c.p2 - u[5] * c.p1
            t1 = u[1] + u[5] * c.p0 - u[3] * c.p2
            t2 = u[2] + u[3] * c.p1 - u[4] * c.p0
            own[0] = c.x0 * t0 + c.x1 * t1 + c.x2 * t2
            own[1] = c.y0 * t0 + c.y1 * t1 + c.y2 * t2
            own[2] = c.z0 * t0 + c.z1 * t1 + c.z2 * t2
            own[3] = c.x0 * u[3] + c.x1 * u[4] + c.x2 * u[5]
            own[4] = c.y0 * u[3] + c.y1 * u[4] + c.y2 * u[5]
            own[5] = c.z0 * u[3] + c.z1 * u[4] + c.z2 * u[5]
        own[2 if b.slides else 5] += rates[i]


def accelerations(bodies, links, motions, gravity, v, w, a):
    """Write the accelerations A of the bodies; the base falls upwards, which is gravity's part."""
    n = bodies.size
    for i in range(n):
        b = bodies[i]
        c = links[i]
        t0, t1, t2 = -gravity[0], -gravity[1], -gravity[2]
        c.b0 = c.b1 = c.b2 = 0.0
        if i > 0:
            u = links[i - 1]
            t0 = u.a0 + u.b1 * c.p2 - u.b2 * c.p1
            t1 = u.a1 + u.b2 * c.p0 - u.b0 * c.p2
            t2 = u.a2 + u.b0 * c.p1 - u.b1 * c.p0
            c.b0 = c.x0 * u.b0 + c.x1 * u.b1 + c.x2 * u.b2
            c.b1 = c.y0 * u.b0 + c.y1 * u.b1 + c.y2 * u.b2
            c.b2 = c.z0 * u.b0 + c.z1 * u.b1 + c.z2 * u.b2
        c.a0 = c.x0 * t0 + c.x1 * t1 + c.x2 * t2
        c.a1 = c.y0 * t0 + c.y1 * t1 + c.y2 * t2
        c.a2 = c.z0 * t0 + c.z1 * t1 + c.z2 * t2
        # V x S w + W x S v, halved; S is the z axis.
        first, second = motions[0, i], motions[1, i]
        half_w, half_v = 0.5 * w[i], 0.5 * v[i]
        if b.slides:
            c.a0 += first[4] * half_w + second[4] * half_v
            c.a1 -= first[3] * half_w + second[3] * half_v
            c.a2 += a[i]
        else:
            c.a0 += first[1] * half_w + second[1] * half_v
            c.a1 -= first[0] * half_w + second[0] * half_v
            c.b0 += first[4] * half_w + second[4] * half_v
            c.b1 -= first[3] * half_w + second[3] * half_v
            c.b2 += a[i]


def forces(links, motions, inertias):
    """Write the force and moment that each body's motion takes."""
    for i in range(inertias.shape[0]):
        c = links[i]
        row = inertias[i]
        v, w = motions[0, i], motions[1, i]
        v0, v1, v2, w0, w1, w2 = v[0], v[1], v[2], v[3], v[4], v[5]
        r0, r1, r2, u0, u1, u2 = w[0], w[1], w[2], w[3], w[4], w[5]
        m, h0, h1, h2 = row[0], row[1], row[2], row[3]
        j00, j01, j02, j11, j12, j22 = row[4], row[5], row[6], row[7], row[8], row[9]
        # Momenta of both velocities.
        l0 = m * v0 + w1 * h2 - w2 * h1
        l1 = m * v1 + w2 * h0 - w0 * h2
        l2 = m * v2 + w0 * h1 - w1 * h0
        k0 = j00 * w0 + j01 * w1 + j02 * w2 + h1 * v2 - h2 * v1
        k1 = j01 * w0 + j11 * w1 + j12 * w2 + h2 * v0 - h0 * v2
        k2 = j02 * w0 + j12 * w1 + j22 * w2 + h0 * v1 - h1 * v0
        d0 = m * r0 + u1 * h2 - u2 * h1
        d1 = m * r1 + u2 * h0 - u0 * h2
        d2 = m * r2 + u0 * h1 - u1 * h0
        e0 = j00 * u0 + j01 * u1 + j02 * u2 + h1 * r2 - h2 * r1
        e1 = j01 * u0 + j11 * u1 + j12 * u2 + h2 * r0 - h0 * r2
        e2 = j02 * u0 + j12 * u1 + j22 * u2 + h0 * r1 - h1 * r0
        # I A + (V x* I W + W x* I V)/2
        c.f0 = m * c.a0 + c.b1 * h2 - c.b2 * h1
        c.f1 = m * c.a1 + c.b2 * h0 - c.b0 * h2
        c.f2 = m * c.a2 + c.b0 * h1 - c.b1 * h0
        c.n0 = j00 * c.b0 + j01 * c.b1 + j02 * c.b2 + h1 * c.a2 - h2 * c.a1
        c.n1 = j01 * c.b0 + j11 * c.b1 + j12 * c.b2 + h2 * c.a0 - h0 * c.a2
        c.n2 = j02 * c.b0 + j12 * c.b1 + j22 * c.b2 + h0 * c.a1 - h1 * c.a0
        c.f0 += 0.5 * (w1 * d2 - w2 * d1 + u1 * l2 - u2 * l1)
        c.f1 += 0.5 * (w2 * d0 - w0 * d2 + u2 * l0 - u0 * l2)
        c.f2 += 0.5 * (w0 * d1 - w1 * d0 + u0 * l1 - u1 * l0)
        c.n0 += 0.5 * (w1 * e2 - w2 * e1 + v1 * d2 - v2 * d1)
        c.n1 += 0.5 * (w2 * e0 - w0 * e2 + v2 * d0 - v0 * d2)
        c.n2 += 0.5 * (w0 * e1 - w1 * e0 + v0 * d1 - v1 * d0)
        c.n0 += 0.5 * (u1 * k2 - u2 * k1 + r1 * l2 - r2 * l1)
        c.n1 += 0.5 * (u2 * k0 - u0 * k2 + r2 * l0 - r0 * l2)
        c.n2 += 0.5 * (u0 * k1 - u1 * k0 + r0 * l1 - r1 * l0)


def joint_torques(bodies, links, out):
    """Gather the forces towards the base; write what each joint has to give, (n,)."""
    n = bodies.size
    for back in range(n):
        i = n - 1 - back
        b = bodies[i]
        c = links[i]
        out[i] = c.f2 if b.slides else c.n2
        if i > 0:
            u = links[i - 1]
            f0 = c.x0 * c.f0 + c.y0 * c.f1 + c.z0 * c.f2
            f1 = c.x1 * c.f0 + c.y1 * c.f1 + c.z1 * c.f2
            f2 = c.x2 * c.f0 + c.y2 * c.f1 + c.z2 * c.f2
            u.f0 += f0
            u.f1 += f1
            u.f2 += f2
            u.n0 += c.x0 * c.n0 + c.y0 * c.n1 + c.z0 * c.n2 + c.p1 * f2 - c.p2 * f1
            u.n1 += c.x1 * c.n0 + c.y1 * c.n1 + c.z1 * c.n2 + c.p2 * f0 - c.p0 * f2
            u.n2 += c.x2 * c.n0 + c.y2 * c.n1 + c.z2 * c.n2 + c.p0 * f1 - c.p1 * f0


def inverse_dynamics(bodies, inertias, links, motions, gravity, q, v, w, a, out):
    """Write M(q) a + C(q, v) w + G(q), (n,).

    Parameters
    ----------
    bodies, inertias
        Geometry, and the ten numbers of each body, (n, 10).
    links, motions
        Room to work in: V and W stay in `motions`, (3, n, 6).
    gravity
        [m/s^2], (3,).
    q, v, w, a
        Angles, two joint rates and accelerations, (n,).
    out
        The torques, (n,) [N m].
    """
    place_links(bodies, links, q)
    velocities(bodies, links, v, motions[0])
    velocities(bodies, links, w, motions[1])
    accelerations(bodies, links, motions, gravity, v, w, a)
    forces(links, motions, inertias)
    joint_torques(bodies, links, out)
    for i in range(bodies.size):
        out[i] += bodies[i].armature * a[i]


def gravity_torques(bodies, inertias, links, gravity, q, out):
    """Write G(q), (n,): `inverse_dynamics` of an arm at rest, where only the base accelerates."""
    place_links(bodies, links, q)
    n = bodies.size
    for i in range(n):
        c = links[i]
        row = inertias[i]
        t0, t1, t2 = -gravity[0], -gravity[1], -gravity[2]
        if i > 0:
            u = links[i - 1]
            t0, t1, t2 = u.a0, u.a1, u.a2
        c.a0 = c.x0 * t0 + c.x1 * t1 + c.x2 * t2
        c.a1 = c.y0 * t0 + c.y1 * t1 + c.y2 * t2
        c.a2 = c.z0 * t0 + c.z1 * t1 + c.z2 * t2
        c.f0, c.f1, c.f2 = row[0] * c.a0, row[0] * c.a1, row[0] * c.a2
        c.n0 = row[2] * c.a2 - row[3] * c.a1
        c.n1 = row[3] * c.a0 - row[1] * c.a2
        c.n2 = row[1] * c.a1 - row[2] * c.a0
    joint_torques(bodies, links, out)


def add_products(row, x0, x1, x2, y0, y1, y2, a0, a1, a2, b0, b1, b2, factor):
    """Add the derivatives of factor X . I A by the ten numbers of I; X = (x, y), A = (a, b).

    X . I A = m x.a + h.(x cross b + a cross y) + y.J b, with x, a linear and y, b angular.
    """
    row[0] += factor * (x0 * a0 + x1 * a1 + x2 * a2)
    row[1] += factor * (x1 * b2 - x2 * b1 + a1 * y2 - a2 * y1)
    row[2] += factor * (x2 * b0 - x0 * b2 + a2 * y0 - a0 * y2)
    row[3] += factor * (x0 * b1 - x1 * b0 + a0 * y1 - a1 * y0)
    row[4] += factor * y0 * b0
    row[5] += factor * (y0 * b1 + y1 * b0)
    row[6] += factor * (y0 * b2 + y2 * b0)
    row[7] += factor * y1 * b1
    row[8] += factor * (y1 * b2 + y2 * b1)
    row[9] += factor * y2 * b2


def gradient(links, motions, numbers):
    """Write the derivatives of s . tau by the inertial numbers of each body, (n, 10).

    tau as `inverse_dynamics` has left it; s are joint rates whose velocities are in motions[2].
    With them U, s . tau = sum over bodies of U . I A - ((V x U) . I W + (W x U) . I V)/2.
    """
    for i in range(motions.shape[1]):
        c = links[i]
        row = numbers[i]
        for k in range(10):
            row[k] = 0.0
        u = motions[2, i]
        add_products(
            row, u[0], u[1], u[2], u[3], u[4], u[5], c.a0, c.a1, c.a2, c.b0, c.b1, c.b2, 1.0
        )
        for which in range(2):
            one, other = motions[which, i], motions[1 - which, i]
            x0 = one[4] * u[2] - one[5] * u[1] + one[1] * u[5] - one[2] * u[4]
            x1 = one[5] * u[0] - one[3] * u[2] + one[2] * u[3] - one[0] * u[5]
            x2 = one[3] * u[1] - one[4] * u[0] + one[0] * u[4] - one[1] * u[3]
            y0 = one[4] * u[5] - one[5] * u[4]
            y1 = one[5] * u[3] - one[3] * u[5]
            y2 = one[3] * u[4] - one[4] * u[3]
            add_products(
                row, x0, x1, x2, y0, y1, y2,
                other[0], other[1], other[2], other[3], other[4], other[5], -0.5,
            )  # fmt: skip
