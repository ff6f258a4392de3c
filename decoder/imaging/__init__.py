"""How a panel becomes pixels: decompressed pictures, lenses, planes, camera poses, and gauges on polar grids.

In come JPEGs and descriptions of a panel and a camera.
Out go grey levels at any point of the panel, and the geometry that says where that point is.
"""
