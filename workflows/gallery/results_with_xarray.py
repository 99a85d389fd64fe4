"""
Results with xarray alone
=========================

A run folder holds `result.nc`, NetCDF-4 with names, units and attributes. Whoever reads it needs
xarray, and not this package.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import xarray as xr

import ellipsoid_coupling as ec

settings = {"times": [0.5, 1.0, 1.5], "numerics.cell": 0.05, "interaction": None}
folder = Path(tempfile.mkdtemp()) / "run"
ec.simulate(ec.load_scene("rotation", settings), model="rho_mono_kinetic", folder=folder)
print(sorted(path.name for path in folder.iterdir()))

# %%
# From here on it is xarray.

data = xr.open_dataset(folder / "result.nc", engine="h5netcdf")
print(data)

# %%
# The axes have coordinates, so that a mean or a cut is one line.

mass = data.density.sum(("x", "y")) * 0.05**2
print(mass.values, data.attrs["model"], data.attrs["steps"])
data.density.plot(col="time", cmap="viridis", figsize=(9.0, 3.0))
plt.show()

# %%
along_y = (data.density.sum("x") * 0.05).rename("mass per unit of y")
_, axes = plt.subplots(layout="constrained")
along_y.plot.line(x="y", ax=axes)
plt.show()
