"""How a panel becomes pixels: decompressed pictures, which lens took which, planes, poses, and gauges on polar grids.

In come JPEGs and descriptions of a panel and a camera.
Out go grey levels at any point of the panel, and the geometry that says where that point is.
"""
