"""The kinds of values that recorder.yaml has, and the settings of each camera that it may name.

In come what the YAML says, and the folder that its paths are relative to.
Out go frozen settings, each checked for its kind and range, or the places where they are wrong.
"""
