"""What people describe: a cockpit's panel with its gauges and scales, and a camera with its lens.

In come YAML documents, from a folder or from a flight file.
Out go immutable descriptions that were checked once, or one sentence that says what to mend.
"""
