"""The folder of a run: run.toml, flow.npz, result.nc and the checkpoint that a run continues from."""
