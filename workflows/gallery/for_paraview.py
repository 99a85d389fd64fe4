"""
For ParaView
============

`export` writes what ParaView opens: a series in time (.pvd) of points, ellipses or cells, and the
flow. On the command line it is ``ellipsoid export RUN``.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import pyvista

import ellipsoid_coupling as ec
from ellipsoid_coupling.output.paraview import export
from ellipsoid_coupling.simulation import scene_flow

settings = {"particles.number": 100, "particles.realisations": 1, "interaction": None}
scene = ec.load_scene("rotation", settings)
flow = scene_flow(scene)
folder = export(ec.simulate(scene, model="microscopic"), Path(tempfile.mkdtemp()), flow=flow)
print(*sorted(path.name for path in folder.iterdir()), sep="\n")

# %%
# ``paraview --script=open_in_paraview.py`` opens all of it: the flow by its speed, the particles as
# ellipses by the colour of their axis, lines along mean axes over the density. By hand, open
# ellipses.pvd, which looks right as it is.
#
# The same files read back without ParaView:

reader = pyvista.PVDReader(str(folder / "ellipses.pvd"))
axes = plt.subplots(
    1, len(reader.time_values), figsize=(9.0, 3.2), sharey=True, layout="constrained"
)[1]
for number, (time, panel) in enumerate(zip(reader.time_values, axes, strict=True)):
    reader.set_active_time_point(number)
    ellipses = reader.read()[0]
    assert isinstance(ellipses, pyvista.PolyData)
    for cell in range(ellipses.n_cells):
        outline = ellipses.get_cell(cell).points
        panel.fill(outline[:, 0], outline[:, 1], color="tab:blue")
    panel.set(title=f"t = {time:g}", aspect="equal", xlim=scene.domain.x, ylim=scene.domain.y)
plt.show()
