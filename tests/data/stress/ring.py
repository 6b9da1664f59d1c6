"""Thermal strain of a wound ring by finite elements, independent of the program.

Radial quadratic elements for the turn (a composite cylinder) and for the ring (generalised plane strain); the transverse
shear modulus of a layer from a plane mesh: that of a medium in which the turn changes no energy.

    pip install scikit-fem==12.0.2 numpy scipy
    python ring.py            # writes skfem.json beside itself, in about four minutes
"""
import json
from pathlib import Path

import numpy as np
from scipy.sparse import bmat, csr_matrix
from scipy.sparse.linalg import spsolve
import skfem as fem
from skfem.helpers import ddot, sym_grad, trace

def axisymmetric(edges, parts, loads, per=12):
    """Radial displacement of bonded annuli in generalised plane strain, quadratic elements.

    parts: (Crr, Ctt, Czz, Crt, Crz, Ctz, Br, Bt, Bz) an annulus; loads: temperature change of each."""
    nodes = np.unique(np.concatenate([np.linspace(a, b, per + 1) for a, b in zip(edges[:-1], edges[1:])]))
    mesh = fem.MeshLine(nodes)
    basis = fem.Basis(mesh, fem.ElementLineP2(), intorder=8)
    middle = mesh.p[0][mesh.t].mean(axis=0)
    which = np.searchsorted(edges, middle) - 1
    q = {k: np.array([p[i] for p in parts])[which][:, None] for i, k in enumerate("rr tt zz rt rz tz br bt bz".split())}
    T = np.array(loads)[which][:, None]

    @fem.BilinearForm
    def stiff(u, v, w):
        r = w.x[0]
        du, dv = u.grad[0], v.grad[0]
        return (q["rr"] * du * dv + q["tt"] * u * v / r**2 + q["rt"] * (du * v + u * dv) / r) * r

    @fem.LinearForm
    def axial(v, w):
        r = w.x[0]
        return (q["rz"] * v.grad[0] + q["tz"] * v / r) * r

    @fem.LinearForm
    def heat(v, w):
        r = w.x[0]
        return (q["br"] * v.grad[0] + q["bt"] * v / r) * T * r

    @fem.Functional
    def own(w):
        return q["zz"] * w.x[0]

    @fem.Functional
    def heat_axial(w):
        return q["bz"] * T * w.x[0]

    K, f, h = stiff.assemble(basis), axial.assemble(basis), heat.assemble(basis)
    A = bmat([[K, csr_matrix(f[:, None])], [csr_matrix(f[None, :]), csr_matrix([[own.assemble(basis)]])]], format="csc")
    found = spsolve(A, np.concatenate([h, [heat_axial.assemble(basis)]]))
    u, e = found[:-1], found[-1]
    at = basis.interpolator(u)
    a, b = np.array(edges[:-1]), np.array(edges[1:])
    mid = 0.5 * (a + b)
    eps = 1e-12
    hoop = at(mid[None, :]) / mid
    ends = at(np.concatenate([a[:1], b])[None, :] * (1 - eps) + eps * mid[0])
    radial = np.diff(ends) / (b - a)
    return hoop, radial, e

def lame(E, nu):
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

def isotropic(E, nu, alpha):
    l, m = lame(E, nu)
    b = (3 * l + 2 * m) * alpha
    return (l + 2 * m, l + 2 * m, l + 2 * m, l, l, l, b, b, b)

def cell(rings, per=40):
    """k*, l*, n*, β_t, β_a and the glass' transverse strain of a composite cylinder by finite elements."""
    edges = [0.0] + [r for r, *_ in rings]
    nodes = np.unique(np.concatenate([np.linspace(a, b, per + 1) for a, b in zip(edges[:-1], edges[1:])]))
    mesh = fem.MeshLine(nodes)
    basis = fem.Basis(mesh, fem.ElementLineP2(), intorder=10)
    which = np.searchsorted(edges, mesh.p[0][mesh.t].mean(axis=0)) - 1
    lam, mu = (np.array([lame(E, nu)[i] for _, E, nu, _ in rings])[which][:, None] for i in (0, 1))
    alpha = np.array([al for *_, al in rings])[which][:, None]
    beta = (3 * lam + 2 * mu) * alpha
    R = edges[-1]

    @fem.BilinearForm
    def stiff(u, v, w):
        r = w.x[0]
        du, dv = u.grad[0], v.grad[0]
        return ((lam + 2 * mu) * (du * dv + u * v / r**2) + lam * (du * v + u * dv) / r) * r

    def solve(t, a, k):
        @fem.LinearForm
        def load(v, w):
            r = w.x[0]
            return (beta * k - lam * a) * (v.grad[0] + v / r) * r
        K, f = stiff.assemble(basis), load.assemble(basis)
        x = np.zeros(basis.N)
        inner = basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).flatten()
        outer = basis.get_dofs(lambda x: np.isclose(x[0], R)).flatten()
        x[outer] = t * R
        D = np.concatenate([inner, outer])
        x = fem.solve(*fem.condense(K, f, x=x, D=D))
        reaction = (K @ x - f)[outer][0] / R  # σ_r(R)
        @fem.Functional
        def along(w):
            r = w.x[0]
            return (lam * (w["u"].grad[0] + w["u"] / r) + (lam + 2 * mu) * a - beta * k) * r
        mean = along.assemble(basis, u=basis.interpolate(x)) * 2 / R**2
        glass = basis.interpolator(x)(np.array([[0.5 * edges[1]]]))[0] / (0.5 * edges[1])
        return reaction, mean, glass
    (st, _, gt), (sa, na, ga), (sk, nk, gk) = solve(1, 0, 0), solve(0, 1, 0), solve(0, 0, 1)
    return dict(k=st / 2, l=sa, n=na, bt=-sk, ba=-nk, gt=gt, ga=ga, gk=gk)


def transverse_shear(rings, k_eff, beyond=10.0, around=16, per=10):
    """Shear modulus of the medium in which the cell changes no energy (plane finite elements, quarter disc)."""
    R = rings[-1][0]
    edges = [r for r, *_ in rings]
    radii = np.concatenate([np.linspace(a, b, per + 1)[1:] for a, b in zip([0.25 * edges[0]] + edges[:-1], edges)])
    radii = np.concatenate([radii, R * np.geomspace(1, beyond, 41)[1:]])
    inner = 0.25 * edges[0]
    # Quads around the axis, with a hole of a fiftieth of the glass's radius.
    radii = np.concatenate([[0.02 * edges[0]], np.linspace(0.02 * edges[0], inner, 8)[1:], radii])
    m = fem.MeshQuad.init_tensor(radii, np.linspace(0, np.pi / 2, around + 1))
    e = fem.ElementVector(fem.ElementQuad2())
    m2 = fem.MeshQuad2.from_mesh(m)
    P = m2.doflocs.copy()
    m2 = fem.MeshQuad2(np.vstack([P[0] * np.cos(P[1]), P[0] * np.sin(P[1])]), m2.t)
    basis = fem.Basis(m2, e, intorder=6)
    centre = m.p[:, m.t].mean(axis=1)[0]
    which = np.searchsorted(edges, centre)
    L = np.array([lame(E, nu)[0] for _, E, nu, _ in rings] + [0.0])
    M = np.array([lame(E, nu)[1] for _, E, nu, _ in rings] + [0.0])
    def energy(mu):
        lam, mm = L.copy(), M.copy()
        lam[-1], mm[-1] = k_eff - mu, mu
        la, mq = lam[which][:, None], mm[which][:, None]
        @fem.BilinearForm
        def a(u, v, w):
            eu, ev = sym_grad(u), sym_grad(v)
            return la * trace(eu) * trace(ev) + 2 * mq * ddot(eu, ev)
        K = a.assemble(basis)
        x = basis.zeros()
        Rb = R * beyond
        xl = basis.doflocs
        d = basis.dofs
        first = np.concatenate([a[0] for a in (d.nodal_dofs, d.facet_dofs, d.interior_dofs)])
        second = np.concatenate([a[1] for a in (d.nodal_dofs, d.facet_dofs, d.interior_dofs)])
        outer = np.hypot(*xl) > Rb * (1 - 1e-6)
        ox, oy = first[outer[first]], second[outer[second]]
        x[ox], x[oy] = xl[0][ox], -xl[1][oy]
        onx = second[np.abs(xl[1][second]) < 1e-9 * Rb]
        ony = first[np.abs(xl[0][first]) < 1e-9 * Rb]
        D = np.unique(np.concatenate([ox, oy, onx, ony]))
        x = fem.solve(*fem.condense(K, x=x, D=D))
        return 0.5 * x @ (K @ x) / (2 * mu * (np.pi / 4) * (Rb**2 - (0.02 * edges[0])**2)) - 1
    low, high = 0.05 * min(M[:-1]) + 1e5, max(M[:-1])
    a, b = np.log(low), np.log(high)
    for _ in range(30):
        c = 0.5 * (a + b)
        if energy(np.exp(c)) > 0: a = c
        else: b = c
    return np.exp(0.5 * (a + b))

um = 1e-6
def nu_of(E, K): return min(0.5 - E / (6 * K), 0.49995)
silica = (72e9, 0.17, 5.5e-7)
soft = (1e6, nu_of(1e6, 2.5e9), 2.2e-4)
hard = (1.5e9, 0.38, 8e-5)
epoxy = (4e9, 0.35, 6e-5)
aluminium = (68.9e9, 0.35, 24e-6)
R = np.sqrt(165 * um * 170 * um / np.pi)
rings = [(40 * um, *silica), (62.5 * um, *soft), (82.5 * um, *hard), (R, *epoxy)]
c = cell(rings)
c = {k: float(v) for k, v in c.items()}
print(c)
test = transverse_shear([(40e-6, 4e9, .35, 0), (R, 4e9, .35, 0)], sum(lame(4e9, .35)))
print("homogeneous check", test / lame(4e9, .35)[1])
c["m"] = float(transverse_shear(rings, c["k"]))
print("m*", c["m"])
k, l, n, m = c["k"], c["l"], c["n"], c["m"]
layer = (k + m, n, k + m, l, k - m, l, c["bt"], c["ba"], c["bt"])
spool = isotropic(*aluminium)
edges = [37e-3] + [40e-3 + j * 165 * um for j in range(25)]
loads = dict(uniform=[1.0] * 25, gradient=[0.0] + [j / 23 for j in range(24)], outermost=[0.0] * 24 + [1.0])
out = dict(cell=c, cases={})
for name, load in loads.items():
    hoop, radial, e = axisymmetric(edges, [spool] + [layer] * 24, load)
    out["cases"][name] = dict(hoop=[float(v) for v in hoop[1:]], radial=[float(v) for v in radial[1:]], axial=float(e))
    print(name, hoop[1], hoop[-1], radial[1], e)
(Path(__file__).parent / "skfem.json").write_text(json.dumps(out, indent=1) + "\n")
