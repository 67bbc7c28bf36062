"""Steady heat conduction in an endless lattice, solved by MFEM on the wall's own NURBS patches: nothing is meshed."""

import mfem.ser as mfem
import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import spsolve

from gyroid_cad import Lattice
from gyroid_cad.mesh.iga.patches import periodic_points

lattice = Lattice(cells=(1, 1, 1), cell_size=10, density=0.3)
wall = lattice.wall()
volumes = lattice.volumes(degree=3)
mesh_file, numbers_file = "isogeometric_heat.mesh", "control_point_numbers.gf"
volumes.write(mesh_file)
volumes.write("isogeometric_heat.npz")

# MFEM's conductivity matrix, for a material that conducts 1 W/(m K).
mesh = mfem.Mesh(mesh_file)
space = mfem.FiniteElementSpace(mesh, mesh.GetNodes().OwnFEC())
form = mfem.BilinearForm(space)
form.AddDomainIntegrator(mfem.DiffusionIntegrator(mfem.ConstantCoefficient(1.0)))
form.Assemble()
form.Finalize()
matrix = form.SpMat()
conduction = csr_array((matrix.GetDataArray(), matrix.GetJArray(), matrix.GetIArray()))

# Ours for each of MFEM's numbers of control points, and theirs where opposite ends of the cell are one.
volumes.write_field(np.arange(len(volumes.control_points)), numbers_file)
ours = mfem.GridFunction(mesh, numbers_file).GetDataArray().astype(int)
endless = periodic_points(wall, volumes)[ours]
join = csr_array((np.ones(len(ours)), (np.arange(len(ours)), endless)))

# One kelvin more per cell along x, y or z, and what the lattice makes of it in between, so that no heat is lost.
straight = volumes.control_points[ours] / lattice.cell_size
swing = np.zeros((join.shape[1], 3))
swing[1:] = spsolve(csc_array(join.T @ conduction @ join)[1:, 1:], -(join.T @ (conduction @ straight))[1:])
temperature = straight + join @ swing
conductivity = temperature.T @ (conduction @ temperature) / lattice.cell_size

by_number = np.empty_like(temperature)
by_number[ours] = temperature
np.save("temperature.npy", by_number)

density = wall.volume() / lattice.cell_size**3
bound = 2 * density / (3 - density)
print(f"{mesh.GetNE()} elements, {space.GetNDofs()} control points, {100 * density:.2f} % dense")
print(f"conducts {conductivity[0, 0]:.5f} of the material along x, {conductivity[2, 2]:.5f} along z,")
print(f"{100 * conductivity[0, 0] / bound:.2f} % of the Hashin-Shtrikman bound {bound:.5f}")
print(f"and {np.abs(conductivity - np.diag(np.diag(conductivity))).max():.0e} across the gradient")
