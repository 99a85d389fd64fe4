"""Output for people: figures (`output.figures`) and ParaView files (`output.paraview`).

Neither is imported here, since matplotlib and pyvista take a second to load.
"""
