"""`decode calibrate`: a camera from photographs of a ruler or a board, and where it was.

In come photographs, and what their places in the world are.
Out go camera.yaml, facts in words, and squared up pictures.
"""
